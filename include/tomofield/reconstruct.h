#pragma once

#include <tomofield/model.h>
#include <tomofield/options.h>
#include <tomofield/tomogram.h>

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
  double pixel_size_A = 0.0;           ///< 0: ViewOptions::pixel_size_A gives it
};

/// The input of a reconstruction: files, or arrays in memory. It is cheap to copy.
class TiltSeries {
 public:
  /// Takes the names; reconstruct() opens the files.
  static TiltSeries from_files(SeriesFiles files);
  /// Takes the arrays. Throws Error if sizes do not agree.
  static TiltSeries from_images(ViewImages images);

 private:
  friend struct TiltSeriesAccess;
  struct Impl;
  explicit TiltSeries(std::shared_ptr<const Impl> impl);
  std::shared_ptr<const Impl> impl_;
};

/// The state of a reconstruction at one moment, as the callback gets it.
struct Progress {
  double fraction_done = 0.0;
  double seconds_elapsed = 0.0;
  double seconds_left = 0.0;
  bool is_trial = false;  ///< trials that choose settings come before the fit
  std::string detail;     ///< a few words: epoch, loss, steps a second
};

/// Receives progress after every step, in the thread that called reconstruct(). Returns false to
/// stop the reconstruction. May throw: the reconstruction then stops as if it had returned false,
/// and the exception leaves reconstruct().
using ProgressCallback = std::function<bool(const Progress&)>;

/// The results of reconstruct().
struct Reconstruction {
  bool is_finished = false;  ///< false: the callback stopped it, and the rest is empty
  /// The density in the units and the contrast of the views, or in the other contrast with
  /// VolumeOptions::invert. It is there only if RunOptions::output is empty.
  std::optional<Tomogram> tomogram;
  std::optional<Model> model;  ///< halves have none: their models are files beside the tomogram
  std::string metrics;         ///< JSON: what `tomofield reconstruct` writes beside the volume
  Options options;             ///< as they were used, with what trials have chosen
};

/// Fits a density field to a tilt series and samples it as a tomogram: the whole job of
/// `tomofield reconstruct`, with the same defaults and the same bits.
///
/// With RunOptions::output, it writes the tomogram, the model (.h5), the metrics (.json), pictures
/// and the report there, and leaves the tomogram out of the result. A run that the callback stops
/// leaves a checkpoint, from which RunOptions::resume continues.
///
/// Without RunOptions::output, it writes nothing but a scratch file in the temporary folder for
/// views that do not fit in memory. The type and the axes of the volume have no effect then.
///
/// It works on all threads (set_thread_count()). Calls from several threads run one after another.
/// No Model may be opened from a file at the same time, since HDF5 is not thread-safe.
///
/// Throws Error for options or files that cannot be used, and for too little memory.
Reconstruction reconstruct(const TiltSeries& series, const Options& options,
                           const ProgressCallback& progress = {});

/// Aligns the views with each other, as `tomofield align` does with the same options: it writes the
/// alignment for IMOD, AreTomo and RELION beside RunOptions::output, and no tomogram. Returns false
/// if the callback stopped it. Throws Error as reconstruct() does, and for RunOptions::align off.
bool align(const TiltSeries& series, const Options& options, const ProgressCallback& progress = {});

/// Sets the number of threads that the library computes with. 0, the default, means OMP_NUM_THREADS
/// or else the processors that this process may use. Results have the same bits for any number.
/// Throws Error below 0 and above 1024, and while another call of the library works: in another
/// thread, or when a callback calls it.
void set_thread_count(std::int64_t count);

/// Fills in the options that follow from other options, as reconstruct() does. Those that trials on
/// the data choose stay open (Choice::is_open()). `files` are those
/// of the series: with a contrast transfer, plain vertices take more epochs.
Options resolve_options(const Options& options, const SeriesFiles& files = {});

}  // namespace tomofield
