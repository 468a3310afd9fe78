#include "measurement/halves.h"

#include <algorithm>
#include <memory>

#include "measurement/read_rays.h"

namespace tomofield::measurement {

using tilt_series::Half;

Measurement half_of_frames(const tilt_series::TiltSeries& series, Half half,
                           const Measurement& whole, const std::filesystem::path& scratch_dir,
                           std::int64_t band_rows, const distributed::Communicator& processes) {
  Measurement measured = whole;
  for (double& sigma : measured.noise_sigma) sigma *= kNoiseOfHalfFrames;
  const std::shared_ptr<SlabViews> rays = read_rays(
      series, {whole.rays_shape(), 1, whole.unit, band_rows, scratch_dir},
      [&](std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) {
        series.read_half(half, view, image, valid, transfer_of(whole.transfers, view));
      },
      processes);
  if (whole.subtracted_background > 0)
    rays->subtract(static_cast<float>(whole.subtracted_background));
  rays->hide_where_hidden(*whole.rays);
  measured.rays = rays;
  return measured;
}

Measurement half_of_tilts(Half half, const Measurement& whole) {
  std::vector<int> by_tilt = whole.fitted_views();
  std::ranges::stable_sort(by_tilt, {}, [&](int view) {
    return whole.geometry.tilt_deg[static_cast<std::size_t>(view)];
  });
  Measurement measured = whole;
  for (std::size_t i = half == Half::kEven ? 0 : 1; i < by_tilt.size(); i += 2)
    measured.left_out.push_back(by_tilt[i]);
  std::ranges::sort(measured.left_out);
  return measured;
}

std::vector<ViewModel> with_noise_of_half_frames(std::vector<ViewModel> models) {
  for (ViewModel& model : models) {
    model.weight /= kNoiseOfHalfFrames * kNoiseOfHalfFrames;
    model.largest_residual *= kNoiseOfHalfFrames;
  }
  return models;
}

}  // namespace tomofield::measurement
