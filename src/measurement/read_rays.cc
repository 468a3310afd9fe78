#include "measurement/read_rays.h"

#include <span>
#include <vector>

#include "base/trace.h"
#include "kernels/lanes.h"
#include "measurement/row_share.h"
#include "tilt_series/own_views.h"

namespace tomofield::measurement {
namespace {

// Gives some views to all processes: their owners read and broadcast them.
void take_views(const ReadView& read_view, std::size_t at_once, base::Range views,
                const distributed::Communicator& processes, std::span<ViewBuffer> buffers) {
  const std::vector<std::size_t> own = tilt_series::own_views(views, processes);
  processes.run_collectively([&] {
    tilt_series::for_views("read views", own, at_once, [&](std::size_t view) {
      ViewBuffer& buffer = buffers[view - static_cast<std::size_t>(views.begin)];
      read_view(view, buffer.image, buffer.valid);
    });
  });
  for (int i = 0; i < views.size(); ++i) {
    ViewBuffer& buffer = buffers[static_cast<std::size_t>(i)];
    const int owner =
        tilt_series::owner_of_view(static_cast<std::size_t>(views.begin + i), processes);
    processes.broadcast(std::as_writable_bytes(std::span(buffer.image)), owner);
    processes.broadcast(std::as_writable_bytes(std::span(buffer.valid)), owner);
  }
}

}  // namespace

std::shared_ptr<SlabViews> read_rays(const tilt_series::TiltSeries& series, const RaySpec& spec,
                                     const ReadView& read_view,
                                     const distributed::Communicator& processes) {
  const base::TraceSpan span("fill slabs");
  const RowShare share = row_share(spec.shape.num_rows, spec.band_rows, processes);
  const base::Range fine = slabs_of_bands(share.bands, spec.band_rows, spec.shape.num_rows);
  const bool is_fine = spec.bin == 1;
  const SlabViews::Holding slabs{
      {fine.begin / spec.bin, (fine.end + spec.bin - 1) / spec.bin},
      is_fine ? static_cast<int>(share.rows_for_next / kernels::kLanes) : 0};
  const SlabViews::Shape shape =
      is_fine ? spec.shape : SlabViews::binned_shape(spec.shape, spec.bin);
  const auto take = [&](base::Range views, std::span<ViewBuffer> buffers) {
    const std::size_t at_once = tilt_series::views_at_once(series.decoding_memory(), processes);
    take_views(read_view, at_once, views, processes, buffers);
  };
  return std::make_shared<SlabViews>(shape, slabs, spec.unit * spec.bin, take, spec.scratch_dir);
}

}  // namespace tomofield::measurement
