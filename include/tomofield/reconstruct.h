#pragma once

#include <tomofield/model.h>
#include <tomofield/options.h>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace tomofield {

/// Views in memory: [view, y, x] with x fastest, tilt axis along y through the image centre.
struct ViewImages {
  std::vector<float> values;
  std::int64_t width = 0, height = 0;  ///< pixels of a view
  std::vector<double> tilt_deg;        ///< one a view, rotation about +Y
  double pixel_size_A = 1.0;
};

/// What a reconstruction is made from: files, or arrays in memory. Cheap to copy.
class TiltSeries {
 public:
  /// Names the files; reconstruct() opens them.
  static TiltSeries from_files(SeriesFiles files);
  /// Takes the arrays. Throws Error if sizes do not agree.
  static TiltSeries from_images(ViewImages images);

 private:
  friend struct TiltSeriesAccess;
  struct Impl;
  explicit TiltSeries(std::shared_ptr<const Impl> impl);
  std::shared_ptr<const Impl> impl_;
};

/// How far a reconstruction is.
struct Progress {
  double fraction_done = 0.0;
  double seconds_elapsed = 0.0;
  double seconds_left = 0.0;
  bool is_trial = false;  ///< trials that choose settings come before the fit
  std::string detail;     ///< a few words: epoch, loss, steps a second
};

/// Receives progress after every step. Returns false to stop the reconstruction.
using ProgressCallback = std::function<bool(const Progress&)>;

/// A tomogram in memory: [z, y, x] with x fastest, in the units and the contrast of the views.
struct Tomogram {
  std::array<std::int64_t, 3> size{};  ///< voxels in x, y, z
  double voxel_size_A = 1.0;
  std::vector<float> values;
};

/// What reconstruct() made.
struct Reconstruction {
  bool is_finished = false;          ///< false: the callback stopped it
  std::optional<Tomogram> tomogram;  ///< only if Options::output is empty
  std::optional<Model> model;        ///< of a finished run
  std::string metrics;  ///< JSON: what `tomofield reconstruct` writes beside the volume
};

/// Fits a density field to a tilt series and samples it as a tomogram: the whole job of
/// `tomofield reconstruct`, with the same defaults and the same bits. With Options::output, writes
/// the tomogram, the model (.h5) and the metrics (.json) there and leaves the tomogram out of
/// the result; without it, writes nothing. Throws Error for options or files that cannot be used.
Reconstruction reconstruct(const TiltSeries& series, const Options& options,
                           const ProgressCallback& progress = {});

/// Resolves the options that are chosen from the data or from other options, as reconstruct()
/// does, but for those that trials choose.
Options resolve_options(const TiltSeries& series, const Options& options);

}  // namespace tomofield
