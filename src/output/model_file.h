#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "field/field.h"
#include "geometry/tilt_geometry.h"

namespace tomofield::output {

/// What a field means: where it lies, its scale, and where it came from.
struct ModelInfo {
  geometry::TiltGeometry geometry;
  geometry::Roi roi;  ///< the region that was asked for; the field goes further
  double x_tilt_deg =
      0.0;  ///< the specimen's rotation about X before the tilt, the same for all views
  double pixel_size_A = 1.0;  ///< of the pixels that every length counts
  double density_unit = 1.0;  ///< data units a density unit
  bool is_dark = false;       ///< the series was dark where dense, so volumes leave negated
  std::string options_json;   ///< the resolved options of the reconstruction
  std::string written_by;     ///< program and version; filled in by load_model
  /// What turns densities into values of the input's kind and contrast.
  double output_scale() const { return is_dark ? -density_unit : density_unit; }
};

/// A fitted field with all that is needed to use it.
struct Model : ModelInfo {
  std::unique_ptr<field::Field> field;
};

/// Arrays that a fit needs to go on, bit for bit. Names are free but for '/'.
struct TrainingState {
  std::map<std::string, std::vector<float>> floats;
  std::map<std::string, std::vector<double>> doubles;
  std::map<std::string, std::vector<std::int64_t>> integers;
  bool operator==(const TrainingState&) const = default;
};

/// One float a parameter, in pieces from the first on, for arrays that need not be in one place.
struct FloatSource {
  using Sink = std::function<void(std::span<const float>)>;
  std::size_t size = 0;
  std::function<void(const Sink&)> hand_out;

  FloatSource(std::size_t all, std::function<void(const Sink&)> pieces)
      : size(all), hand_out(std::move(pieces)) {}
  /// An array as it is.
  FloatSource(std::span<const float> whole)
      : size(whole.size()), hand_out([whole](const Sink& sink) { sink(whole); }) {}
};

/// Large arrays of a training state that are written from where they are.
using FloatArrays = std::map<std::string, FloatSource>;

/// Writes a model (docs/model-format.md): atomically, so that `path` holds the
/// old file or the whole new one, whatever happens. Parameters are written
/// from where they are. Throws Error if `path` cannot be written, or if a
/// parameter is not finite, which would replace a good model by a useless one.
/// `more_floats` join those of `training`, without which they are not written.
void save_model(const std::filesystem::path& path, const field::Field& field, const ModelInfo& info,
                const TrainingState* training = nullptr, const FloatArrays& more_floats = {});
/// The same for a field whose parameters are not all kept here (Field::keep_only).
void save_model(const std::filesystem::path& path, const field::Field& field,
                const FloatSource& parameters, const ModelInfo& info, const TrainingState* training,
                const FloatArrays& more_floats);
/// Throws Error if a parameter that is kept is not finite, naming the file that was to be written.
void require_finite(const field::Field& field, const std::filesystem::path& path);
void save_model(const std::filesystem::path& path, const Model& model,
                const TrainingState* training = nullptr);

/// Reads a model, and its training state into `training` if that is asked for:
/// empty where the model was saved without. Throws Error, naming the file and
/// the reason, for anything but a whole model of a known version.
Model load_model(const std::filesystem::path& path, TrainingState* training = nullptr);

/// The leaves of a tree whose parameters are asked for; none: all.
using ChooseLeaves = std::function<std::vector<int>(const field::Quadtree&)>;
/// A model of which only some leaves are kept (Field::keep_only), and its training state but
/// for the floats.
Model load_part(const std::filesystem::path& path, const ChooseLeaves& choose,
                TrainingState& training);
/// One of the floats of a training state, which are one a parameter, into `values`: of the leaves
/// that `field` keeps alone. Throws Error if there is none or it has another size.
void load_floats(const std::filesystem::path& path, const std::string& name,
                 const field::Field& field, std::span<float> values);

}  // namespace tomofield::output
