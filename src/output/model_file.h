#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compact/coded_field.h"
#include "field/field.h"
#include "geometry/tilt_geometry.h"
#include "measurement/measurement.h"
#include "tomofield/options.h"

namespace tomofield::output {

// The writer (model_writer.cc) and the reader (model_file.cc) of model files share these values.
// They are in files: do not change one without a new version.
inline constexpr const char* kFormat = "tomofield model";
inline constexpr std::int64_t kFormatVersion = 2;
inline constexpr std::int64_t kCompactVersion = 3;  ///< of models with codes in place of parameters

/// Throws Error, which begins with `complaint`, if a parameter that a field keeps is not
/// plausible (base/plausible.h).
void require_plausible_parameters(const field::Field& field, const std::string& complaint);

/// Throws Error, with what may help, if such a parameter shows that a fit has diverged.
void require_converged(const field::Field& field);

/// The meaning of a field: its place, its scale and its source.
struct ModelInfo {
  geometry::TiltGeometry geometry;
  Rectangle roi;  ///< the region asked for; the field is larger by the margin
  double x_tilt_deg =
      0.0;  ///< the specimen's rotation about X before the tilt, the same for all views
  double pixel_size_A = 1.0;  ///< side of a pixel, the unit of every length
  double density_unit = 1.0;  ///< data units a density unit
  bool is_dark = false;       ///< dense was dark in the series, so volumes are negated
  std::string options_json;   ///< the resolved options of the reconstruction
  /// What the alignment before the fit was made from (alignment::to_json()); empty: there was none.
  std::string alignment_json = {};
  std::string written_by;  ///< program and version; filled in by load_model
  /// Returns the factor from densities to values of the input's units and contrast.
  double output_scale() const { return is_dark ? -density_unit : density_unit; }
};

/// A fitted field with all that is needed to use it.
struct Model : ModelInfo {
  std::unique_ptr<field::Field> field;       ///< may be null if there is `coded`
  std::optional<compact::CodedField> coded;  ///< of a compact model, which stands for `field`

  const field::Quadtree& tree() const { return coded ? coded->tree : field->tree(); }
  double thickness() const { return coded ? coded->thickness : field->thickness(); }
};

/// The place and the tree of a model, without its parameters.
struct ModelOutline : ModelInfo {
  field::Quadtree tree;
};

/// The arrays that a fit needs to continue bit for bit. A name may hold anything but '/'.
struct TrainingState {
  std::map<std::string, std::vector<float>> floats;
  std::map<std::string, std::vector<double>> doubles;
  std::map<std::string, std::vector<std::int64_t>> integers;
  bool operator==(const TrainingState&) const = default;
};

/// One float a parameter, handed out in pieces from the first on. The array need not be in one
/// place.
struct FloatSource {
  using Sink = std::function<void(std::span<const float>)>;
  std::size_t size = 0;
  std::function<void(const Sink&)> hand_out;

  FloatSource(std::size_t all, std::function<void(const Sink&)> pieces)
      : size(all), hand_out(std::move(pieces)) {}
  /// Hands out an array in one piece.
  FloatSource(std::span<const float> whole)
      : size(whole.size()), hand_out([whole](const Sink& sink) { sink(whole); }) {}
};

/// The large arrays of a training state. They are written from where they are, without a copy.
using FloatArrays = std::map<std::string, FloatSource>;

/// Writes a model (docs/model-format.md) atomically: `path` holds the old file or the whole new
/// one, whatever happens. Parameters are written from where they are, without a copy. `more_floats`
/// join those of `training`; they are not written if `training` is null. Throws Error if `path`
/// cannot be written, or if a parameter is not finite, because such a model would replace a good
/// one.
void save_model(const std::filesystem::path& path, const field::Field& field, const ModelInfo& info,
                const TrainingState* training = nullptr, const FloatArrays& more_floats = {});
/// Writes a field of which this process keeps only some parameters (Field::keep_only); `parameters`
/// hands out all of them.
void save_model(const std::filesystem::path& path, const field::Field& field,
                const FloatSource& parameters, const ModelInfo& info, const TrainingState* training,
                const FloatArrays& more_floats);
/// Writes a model; of a compact one the codes, and no training state.
void save_model(const std::filesystem::path& path, const Model& model,
                const TrainingState* training = nullptr);
/// Writes a compact model with a training state that has no floats.
void save_coded(const std::filesystem::path& path, const compact::CodedField& coded,
                const ModelInfo& info, const TrainingState* training = nullptr);

/// Returns the bytes of the file that save_coded() writes without a training state.
std::size_t coded_file_size(const compact::CodedField& coded, const ModelInfo& info);

/// Reads a model, and its training state into `training` unless that is null. The state is empty if
/// the model was saved without one. Throws Error, with the file and the reason, for anything but a
/// whole model of a known version.
Model load_model(const std::filesystem::path& path, TrainingState* training = nullptr);

/// Does the same, but does not decode a compact model: it has no `field`.
Model load_undecoded(const std::filesystem::path& path, TrainingState* training = nullptr);

/// Reads a model. Decodes a compact one only if this takes at most `most_bytes`.
Model load_decoded_up_to(const std::filesystem::path& path, std::size_t most_bytes);

/// Reads the outline of a model, without its parameters. Throws Error as load_model() does.
ModelOutline load_outline(const std::filesystem::path& path);

/// Returns the leaves of a tree whose parameters shall be kept. An empty function keeps all.
using ChooseLeaves = std::function<std::vector<int>(const field::Quadtree&)>;
/// Reads a model and keeps only some of its leaves (Field::keep_only). `choose` sees the tree
/// before anything is made from it, and may throw. A compact model is decoded whole, since leaves
/// take faces from their neighbours.
Model load_part(const std::filesystem::path& path, const ChooseLeaves& choose);
/// Reads the training state of a model without its floats.
TrainingState load_training(const std::filesystem::path& path);
/// Reads one array of floats of a training state, one a parameter, into `values`: only those of the
/// leaves that `field` keeps. Throws Error if there is no such array or if it has another size.
void load_floats(const std::filesystem::path& path, const std::string& name,
                 const field::Field& field, std::span<float> values);

/// Returns what densities that were fitted to a measurement mean.
ModelInfo model_info(const measurement::Measurement& series, Contrast contrast);

}  // namespace tomofield::output
