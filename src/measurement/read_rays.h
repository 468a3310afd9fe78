#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "distributed/communicator.h"
#include "measurement/slab_views.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::measurement {

/// Says how views become rays.
struct RaySpec {
  SlabViews::Shape shape;
  double unit = 1.0;           ///< the rays are divided by it
  std::int64_t band_rows = 0;  ///< of the bands that processes share (row_share.h)
  const std::filesystem::path& scratch_dir;
};

/// Reads all views of a series as rays: each process reads the views that it owns, on all threads,
/// and keeps the slabs of its share. Every process calls it.
std::shared_ptr<SlabViews> read_rays(const tilt_series::TiltSeries& series, const RaySpec& spec,
                                     const ReadView& read_view,
                                     const distributed::Communicator& processes);

}  // namespace tomofield::measurement
