#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "distributed/communicator.h"
#include "measurement/slab_views.h"
#include "microscope/view_transfer.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::measurement {

/// The shape, the pixels and the unit of the rays that are read from views.
struct RaySpec {
  SlabViews::Shape shape;      ///< of the views
  int bin = 1;                 ///< the views are read in pixels wider by this factor
  double unit = 1.0;           ///< the rays are divided by it, and by `bin`, as they count pixels
  std::int64_t band_rows = 0;  ///< of the bands that processes share (row_share.h)
  const std::filesystem::path& scratch_dir;
};

/// Returns the transfer of a view, or null if there are none.
inline const microscope::ViewTransfer* transfer_of(
    const std::vector<microscope::ViewTransfer>& transfers, std::size_t view) {
  return transfers.empty() ? nullptr : &transfers[view];
}

/// Reads all views of a series as rays. With `bin` above 1, read_view() gets images of the shape of
/// binned views (SlabViews::binned_shape), and the rays are like those of SlabViews::binned(). Each
/// process reads the views that it owns, on all threads, and keeps the slabs of its share. Every
/// process calls it.
std::shared_ptr<SlabViews> read_rays(const tilt_series::TiltSeries& series, const RaySpec& spec,
                                     const ReadView& read_view,
                                     const distributed::Communicator& processes);

}  // namespace tomofield::measurement
