#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "tilt_series/half_stacks.h"
#include "tilt_series/measured_series.h"

namespace tomofield::microscope {
struct ViewTransfer;
}

namespace tomofield::tilt_series {

class ViewStore;
struct SurveyedViews;

/// A measured tilt series whose views can be read: masked, aligned (unless `resample` is off) and
/// binned, ready to be fitted. Decoded views are kept in a store (view_store.h).
class TiltSeries : public MeasuredSeries {
 public:
  /// Opens, measures and keeps the views, as MeasuredSeries does.
  explicit TiltSeries(const TiltSeriesOptions& options, const distributed::Communicator& processes =
                                                            distributed::Communicator::alone());
  ~TiltSeries();
  TiltSeries(TiltSeries&&) noexcept;

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

  /// Looks for gold beads in the views of a series that is not resampled, each aligned with a
  /// correction, whether they are masked or not. `axis_x_px` is the tilt axis. Places are in the
  /// pixels of the aligned, binned views. Returns the spots [bead] whose places are precise: none
  /// if the options ask for no beads, or if there are none. Without a diameter in the options,
  /// there must clearly be some (find_beads()). Every process calls it and gets the same.
  std::vector<std::vector<BeadSpot>> find_bead_spots(
      std::span<const geometry::ViewCorrection> corrections, double axis_x_px,
      const distributed::Communicator& processes) const;

 private:
  explicit TiltSeries(SurveyedViews surveyed);
  MaskedImage stored_or_decoded(std::size_t view) const;

  std::unique_ptr<ViewStore> views_;
};

}  // namespace tomofield::tilt_series
