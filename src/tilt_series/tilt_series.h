#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/enum_names.h"
#include "distributed/communicator.h"
#include "geometry/raw_from_aligned.h"
#include "geometry/view_correction.h"
#include "io/images/image_stack.h"
#include "tilt_series/fixed_pattern/fixed_pattern.h"
#include "tilt_series/half.h"
#include "tilt_series/masks/bead_spot.h"
#include "tilt_series/masks/mask_disc.h"
#include "tomofield/options.h"

namespace tomofield::microscope {
struct ViewTransfer;
}

namespace tomofield::tilt_series {

/// The files of a tilt series, how they are read, and what the program adds to that.
struct TiltSeriesOptions : SeriesFiles, ViewOptions {
  std::shared_ptr<const io::ImageStack> images = {};  ///< views in memory, in place of `stack`
  bool resample = true;  ///< false: views stay as they were recorded, with their alignment beside
  /// The views will be aligned from the direction of their tilt axis on, as files state it. Else a
  /// stack whose stated axis is not vertical needs an alignment.
  bool starts_raw = false;
  /// False: decoded views are given up as soon as they have been checked and measured.
  bool keep_views = true;
  /// False: no view is looked at, so that only what follows from headers and small files is known.
  /// There are no noise, no beads and no empty beam, and broken views are not found.
  bool look_at_views = true;
  /// Takes decoded views that do not fit in memory; empty: the system's folder for such files.
  std::filesystem::path scratch_dir = {};
  /// [section]: changes of the alignment that the files give. Empty: none. Local motion
  /// needs `resample`.
  std::vector<geometry::ViewCorrection> corrections = {};
  /// Sections that are left out beside `exclude`, counted from 0, ascending.
  std::vector<std::int64_t> left_out = {};
};

/// The use of the pixels of beads that were found.
enum class BeadMasking {
  kNone,       ///< no beads were found, or nobody looked for them
  kMasked,     ///< they carry no loss
  kUndecided,  ///< they count until a decision is made; statistics leave them out
  kUnmasked,   ///< they count as all others do
};

/// Counts of what was masked beside the fill of rotated images.
struct MaskMetrics {
  std::size_t num_beads = 0;              ///< beads with one position in the specimen
  double bead_diameter_A = 0.0;           ///< given or estimated; 0: no beads
  std::vector<std::size_t> beads_found;   ///< [view]: beads with a spot of their own
  std::vector<std::size_t> beads_masked;  ///< [view]: discs, also from tracks and --fiducials
  BeadMasking bead_masking = BeadMasking::kNone;
  std::int64_t num_bad_pixels = 0;    ///< hot and dead pixels of all sections
  FixedPatternMetrics fixed_pattern;  ///< what was removed from all views
};

/// The direction of the tilt axis in the images of a stack, and what states it.
struct StatedAxis {
  double angle_deg = 0.0;  ///< counter-clockwise from +Y, from −180 to 180
  std::string source;      ///< for messages: "'TS_01.mdoc', line 9"
  bool is_given = false;   ///< by the user with --tilt-axis
};

/// Describes the beads in a few words: "12 beads of 10 nm", or "no beads".
std::string describe_beads(const MaskMetrics& masks);

/// One view of the series.
struct View {
  std::int64_t section = 0;  ///< zero-based section of the stack
  double tilt_deg = 0.0;     ///< rotation about +Y
  double x_tilt_deg = 0.0;   ///< rotation about +X, before the tilt
};

/// An aligned tilt series: views whose tilt axis is the +Y direction through
/// the image centre, dense specimen high, ready to be fitted.
///
/// Each view is decoded once: masked, aligned (unless `resample` is off), binned and put into a
/// store (view_store.h), on which everything is measured that needs more than one look. Of a job of
/// several processes each decodes and stores the views that it owns (view_owner.h).
class TiltSeries {
 public:
  /// Opens the files, decodes every view, and checks counts, angles, sizes and all pixels.
  /// Throws Error that names the file and the section; warnings go to base/log.h.
  explicit TiltSeries(const TiltSeriesOptions& options)
      : TiltSeries(options, distributed::Communicator::alone()) {}
  /// Does the same with several processes, each of which decodes some of the views.
  TiltSeries(const TiltSeriesOptions& options, const distributed::Communicator& processes);
  ~TiltSeries();
  TiltSeries(TiltSeries&&) noexcept;

  const std::vector<View>& views() const;  ///< in the stack's order, excluded ones absent
  std::int64_t width() const;              ///< pixels of a view as read_view gives it, binned
  std::int64_t height() const;
  std::int64_t aligned_width() const;  ///< pixels of an aligned, binned view
  std::int64_t aligned_height() const;
  bool is_resampled() const;  ///< whether read_view gives aligned views
  /// Returns where the pixels of an aligned view come from in the view as recorded, binned pixels.
  geometry::RawFromAligned raw_from_aligned(std::size_t view) const;
  double pixel_size_A() const;  ///< of an aligned, binned view
  double bin_factor() const;    ///< unbinned pixels a pixel, exact

  /// Copies view `view` (an index into views()) as height × width line integrals in
  /// the data's units (I0 − I, −ln(I/I0), or as stored), and which pixels are
  /// measurements (PixelState): 0 for NaN, infinity, hot and dead pixels, fill
  /// outside a rotated image, masked beads, fiducials and what the user's mask leaves out, and
  /// kUndecidedBead for beads that are undecided.
  /// Pixels that are not measurements are 0. A view that is not in this process's store is
  /// decoded again. With the `transfer` of the view, the fringes that a contrast transfer makes of
  /// masked beads are subtracted (masks/subtract_beads.h). Thread-safe.
  void read_view(std::size_t view, std::span<float> image, std::span<std::uint8_t> valid,
                 const microscope::ViewTransfer* transfer = nullptr) const;

  /// Does the same with one half of the frames, in the units of all of them (half_stacks.h) and
  /// with the masks of all of them. It decodes the view. The options must name the halves.
  void read_half(Half half, std::size_t view, std::span<float> image, std::span<std::uint8_t> valid,
                 const microscope::ViewTransfer* transfer = nullptr) const;

  /// Gives up the stored pixels of a view that will not be read soon, to make room.
  void forget_view(std::size_t view) const;
  /// Returns the memory that the stored views take at most, in a job of `processes`.
  std::size_t stored_memory(const distributed::Communicator& processes) const;

  /// Returns about the bytes that reading one view takes, if it is decoded again.
  std::size_t decoding_memory() const;

  /// Returns the standard deviation of each view's noise, in the units of read_view. Beads, also
  /// undecided ones, are left out.
  const std::vector<double>& noise_sigma() const;

  /// Returns the intensity of an empty beam (I0), in the stack's units; for
  /// kBright 0, where none is needed.
  double empty_beam() const;

  /// Returns the intensity of the emptiest places of a bright series (intensity.h), in the units of
  /// read_view; 0 for kDark.
  double background() const;

  /// Returns the axis by which the views are turned, if no alignment of a file turns them.
  const std::optional<StatedAxis>& stated_axis() const;

  const MaskMetrics& mask_metrics() const;

  /// Returns the discs of undecided beads in each view, in the pixels of read_view().
  const std::vector<std::vector<MaskDisc>>& undecided_beads() const;

  /// Looks for gold beads in the views of a series that is not resampled, each aligned with a
  /// correction, whether they are masked or not. `axis_x_px` is the tilt axis. Places are in the
  /// pixels of the aligned, binned views. Returns the spots [bead] whose places are precise: none
  /// if the options ask for no beads, or if there are none. Without a diameter in the options,
  /// there must clearly be some (find_beads()). Every process calls it and gets the same.
  std::vector<std::vector<BeadSpot>> find_bead_spots(
      std::span<const geometry::ViewCorrection> corrections, double axis_x_px,
      const distributed::Communicator& processes) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tomofield::tilt_series

template <>
struct tomofield::base::EnumNames<tomofield::tilt_series::BeadMasking> {
  using BeadMasking = tomofield::tilt_series::BeadMasking;
  static constexpr std::array kNames{std::pair{BeadMasking::kNone, "none"},
                                     std::pair{BeadMasking::kMasked, "masked"},
                                     std::pair{BeadMasking::kUndecided, "undecided"},
                                     std::pair{BeadMasking::kUnmasked, "unmasked"}};
};
