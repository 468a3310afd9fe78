#include "simulate/imaging.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/random.h"
#include "microscope/view_transfer.h"

namespace tomofield::simulate {
namespace {

constexpr std::uint64_t kDefocusStream = 12;
constexpr double kAngstroms_in_um = 1e4;

}  // namespace

std::vector<std::optional<io::Defocus>> draw_defoci(const Imaging& imaging, std::uint64_t seed,
                                                    std::size_t num_views) {
  std::vector<std::optional<io::Defocus>> defoci(num_views);
  if (!imaging.defocus) return defoci;
  base::Random random(seed, kDefocusStream);
  const auto [low_um, high_um] = *imaging.defocus;
  const double of_series_um = imaging.defocus_scatter_um ? random.uniform(low_um, high_um) : 0.0;
  for (std::optional<io::Defocus>& defocus : defoci) {
    // The files state tenths of Å and hundredths of degrees.
    const double mean_um = imaging.defocus_scatter_um
                               ? of_series_um + *imaging.defocus_scatter_um * random.normal()
                               : random.uniform(low_um, high_um);
    const double mean_A = std::round(10.0 * kAngstroms_in_um * mean_um) / 10.0;
    const double half_A = kAngstroms_in_um * imaging.astigmatism_um / 2.0;
    const double angle_deg = std::round(100.0 * random.uniform(-90.0, 90.0)) / 100.0;
    defocus = {mean_A + half_A, mean_A - half_A, half_A > 0.0 ? angle_deg : 0.0, 0.0};
  }
  return defoci;
}

std::vector<std::size_t> dose_symmetric_order(std::span<const double> tilts_deg) {
  std::vector<std::size_t> order(tilts_deg.size());
  std::iota(order.begin(), order.end(), 0);
  const auto from_zero = [&](std::size_t i) { return std::abs(tilts_deg[i]); };
  const std::size_t start = *std::ranges::min_element(order, {}, from_zero);
  // Groups +1 | −1 −2 | +2 +3 | −3 −4 …, where n counts tilts from the first one on each side.
  const auto group = [&](std::size_t i) {
    const std::size_t n = i > start ? i - start : start - i;
    return i > start ? 2 * (n / 2) : 2 * ((n + 1) / 2) - 1;
  };
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) {
    if (a == start || b == start) return a == start && b != start;
    if (group(a) != group(b)) return group(a) < group(b);
    return from_zero(a) < from_zero(b);
  });
  return order;
}

microscope::ViewTransfer transfer_of(const ViewFrame& view, const Imaging& imaging,
                                     const std::optional<io::Defocus>& defocus, double exposure,
                                     double pixel_size_A) {
  microscope::ViewTransfer transfer;
  transfer.optics = imaging.optics;
  transfer.exposure = exposure;
  transfer.pixel_size_A = pixel_size_A;
  if (!defocus) {
    transfer.optics = microscope::without_phase_contrast(transfer.optics);
    return transfer;
  }
  transfer.defocus = *defocus;
  transfer.slope = microscope::slope_of_tilt(
      view.tilt_deg, pixel_size_A, microscope::DefocusHand::kRight, view.raw_from_aligned);
  return transfer;
}

void image_view(const Phantom& phantom, const ViewFrame& view, const Imaging& imaging,
                const std::optional<io::Defocus>& defocus, double exposure, double pixel_size_A,
                std::span<float> image) {
  const auto transfer = transfer_of(view, imaging, defocus, exposure, pixel_size_A);
  constexpr std::int64_t kDamage_px = 8;  // damage alone blurs, by a few pixels
  const std::int64_t margin = kDamage_px + microscope::reach_px(transfer, view.width, view.height);
  ViewFrame wide = view;
  wide.width += 2 * margin;
  wide.height += 2 * margin;
  std::vector<float> projection(static_cast<std::size_t>(wide.width * wide.height));
  project_view(phantom, wide, projection);
  const auto filtered = microscope::ViewFilter(wide.width, wide.height, transfer).apply(projection);
  for (std::int64_t y = 0; y < view.height; ++y)
    std::copy_n(filtered.begin() + (y + margin) * wide.width + margin, view.width,
                image.begin() + y * view.width);
}

}  // namespace tomofield::simulate
