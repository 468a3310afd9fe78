#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "distributed/communicator.h"
#include "geometry/raw_from_aligned.h"
#include "tomofield/options.h"

namespace tomofield::tilt_series {

/// Where a tilt series is and how its intensities are to be read.
struct TiltSeriesOptions {
  std::filesystem::path stack;                 ///< MRC stack, raw or aligned
  std::optional<std::filesystem::path> tlt;    ///< .tlt or .rawtlt, one angle in degrees a section
  std::optional<std::filesystem::path> xf;     ///< IMOD raw → aligned transforms
  std::optional<std::filesystem::path> xtilt;  ///< IMOD x-axis tilt, degrees a section
  std::optional<std::filesystem::path> aln;    ///< AreTomo alignment (angles, rotation, shifts)
  std::optional<std::filesystem::path> mdoc;   ///< SerialEM metadata (angles, pixel size)
  std::string exclude;                         ///< 1-based sections left out: "1-3,40"
  double bin = 1.0;                            ///< reduce views by this factor, >= 1
  std::optional<double> angpix;                ///< or to this pixel size in Å
  std::optional<double> pixel_size_A;          ///< overrides the header's pixel size
  Contrast contrast = Contrast::kDark;
  bool take_log = false;  ///< −ln(I / I0) instead of I0 − I; dark only
  bool resample = true;   ///< false: views stay as they were recorded, with their alignment beside

  std::optional<std::filesystem::path> mask;       ///< MRC as the stack: 0 is no measurement
  std::optional<std::filesystem::path> fiducials;  ///< text of model2point, stack coordinates
  /// Gold beads are looked for and masked; 0: they are not. None: of dark
  /// series the diameter is estimated, of bright ones nothing is looked for.
  std::optional<double> bead_diameter_nm;
};

/// What was masked beside the fill of rotated images.
struct MaskMetrics {
  std::size_t num_beads = 0;              ///< with one position in the specimen
  double bead_diameter_A = 0.0;           ///< given or estimated; 0: no beads
  std::vector<std::size_t> beads_found;   ///< of each view: with a spot of their own
  std::vector<std::size_t> beads_masked;  ///< of each view: discs, by tracks and --fiducials too
  std::int64_t num_bad_pixels = 0;        ///< of all sections: hot, dead
};

/// One view of the series.
struct View {
  std::int64_t section = 0;  ///< zero-based section of the stack
  double tilt_deg = 0.0;     ///< rotation about +Y
  double x_tilt_deg = 0.0;   ///< rotation about +X, before the tilt
};

/// An aligned tilt series: views whose tilt axis is the +Y direction through
/// the image centre, dense specimen high, ready to be fitted. Images stay in
/// the file and are read a view at a time: aligned (unless `resample` is off),
/// binned, converted.
class TiltSeries {
 public:
  /// Opens and checks everything: counts, angles, sizes, every pixel of every
  /// view once. Throws Error as docs/errors.md lists; warnings go to base/log.h.
  explicit TiltSeries(const TiltSeriesOptions& options)
      : TiltSeries(options, distributed::Communicator::alone()) {}
  /// The same by several processes, of which each checks some of the views.
  TiltSeries(const TiltSeriesOptions& options, const distributed::Communicator& processes);
  ~TiltSeries();
  TiltSeries(TiltSeries&&) noexcept;

  const std::vector<View>& views() const;  ///< in the stack's order, excluded ones absent
  std::int64_t width() const;              ///< pixels of a view as read_view gives it, binned
  std::int64_t height() const;
  std::int64_t aligned_width() const;  ///< pixels of an aligned, binned view
  std::int64_t aligned_height() const;
  /// Whether read_view gives aligned views, and where their pixels else come from
  /// in the views as recorded, in binned pixels.
  bool is_resampled() const;
  geometry::RawFromAligned raw_from_aligned(std::size_t view) const;
  double pixel_size_A() const;  ///< of an aligned, binned view
  double bin_factor() const;    ///< unbinned pixels a pixel, exact

  /// View `view` (an index into views()) as height × width line integrals in
  /// the data's units (I0 − I, −ln(I/I0), or as stored), and which pixels are
  /// measurements: false for NaN, infinity, hot and dead pixels, fill outside a
  /// rotated image, beads, fiducials and what the user's mask leaves out.
  /// Pixels that are not measurements are 0. Thread-safe.
  void read_view(std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) const;

  /// Standard deviation of the noise of each view, in the units of read_view.
  const std::vector<double>& noise_sigma() const;

  /// Intensity that stands for an empty beam (I0), in the stack's units; for
  /// kBright 0, where none is needed.
  double empty_beam() const;

  const MaskMetrics& mask_metrics() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tomofield::tilt_series
