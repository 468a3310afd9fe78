#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "base/log.h"
#include "distributed/communicator.h"
#include "geometry/raw_from_aligned.h"
#include "io/images/image_stack.h"
#include "tilt_series/image.h"
#include "tilt_series/series_plan.h"

namespace tomofield::tilt_series {

/// Opens the images of a series: those in memory, those of the stack, or, if that is a folder,
/// those in it that the .mdoc names. Throws Error as io::open_image_stack() and
/// io::open_mdoc_images() do.
std::shared_ptr<const io::ImageStack> open_views(const TiltSeriesOptions& options);

/// An aligned tilt series as headers and small files describe it: views whose tilt axis is the +Y
/// direction through the image centre. No pixel has been read, so that broken views are not found.
///
/// A plan says nothing. What there is to warn of is said when the views are measured
/// (measured_series.h). Copies share one plan.
class PlannedSeries {
 public:
  /// Opens the files, and checks counts, angles and sizes. Throws Error that names the file, or for
  /// views with fewer than 8 pixels along a side after binning. Processes of a job share an error.
  explicit PlannedSeries(
      const TiltSeriesOptions& options,
      const distributed::Communicator& processes = distributed::Communicator::alone());

  const std::vector<View>& views() const;  ///< in the stack's order, excluded ones absent
  std::int64_t width() const;              ///< pixels of a view as it is fitted, binned
  std::int64_t height() const;
  std::int64_t aligned_width() const;  ///< pixels of an aligned, binned view
  std::int64_t aligned_height() const;
  bool is_resampled() const;  ///< whether fitted views are aligned ones
  /// Returns where the pixels of an aligned view come from in the view as recorded, binned pixels.
  geometry::RawFromAligned raw_from_aligned(std::size_t view) const;
  double pixel_size_A() const;  ///< of an aligned, binned view
  double bin_factor() const;    ///< unbinned pixels a pixel, exact
  /// Returns the axis by which the views are turned, if no alignment of a file turns them.
  const std::optional<StatedAxis>& stated_axis() const;

  /// Returns about the bytes that reading one view takes, if it is decoded.
  std::size_t decoding_memory() const;
  /// Returns the memory that the stored views take at most, in a job of `processes`.
  std::size_t stored_memory(const distributed::Communicator& processes) const;

  const TiltSeriesOptions& options() const;
  const io::ImageStack& stack() const;
  const SeriesPlan& plan() const;
  const base::LogMessages& messages() const;  ///< what the plan has noticed

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

/// Decodes a view in the frame in which it is fitted, as stored intensities without masks of beads:
/// for estimates of the time that this takes.
MaskedImage decode_view(const PlannedSeries& series, std::size_t view);

}  // namespace tomofield::tilt_series
