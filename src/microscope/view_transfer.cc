#include "microscope/view_transfer.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "geometry/raw_from_aligned.h"

namespace tomofield::microscope {

double Detector::transfer(double k) const {
  const auto& [frequencies, values] = mtf;
  const double frequency = k * pixel_size_A;
  const auto after = std::ranges::upper_bound(frequencies, frequency);
  if (after == frequencies.begin()) return values.front();
  if (after == frequencies.end()) return values.back();
  const auto i = static_cast<std::size_t>(after - frequencies.begin());
  const double part = (frequency - frequencies[i - 1]) / (frequencies[i] - frequencies[i - 1]);
  return values[i - 1] + part * (values[i] - values[i - 1]);
}

DefocusSlope slope_of_tilt(double tilt_deg, double pixel_size_A, DefocusHand hand,
                           const geometry::RawFromAligned& map) {
  const double per_pixel_A =
      static_cast<double>(hand) * pixel_size_A * std::tan(tilt_deg * std::numbers::pi / 180.0);
  const io::ImodTransform aligned = geometry::invert(map);
  return {per_pixel_A * aligned.shift_x_px, per_pixel_A * aligned.a11, per_pixel_A * aligned.a12};
}

double spread_px(const ViewTransfer& transfer) {
  constexpr double kMillimetre_A = 1e7;
  const double wavelength_A = electron_wavelength_A(transfer.optics.voltage_kV);
  const double cubic =
      transfer.optics.spherical_aberration_mm * kMillimetre_A * std::pow(wavelength_A, 3);
  const double finest = 1.0 / (2.0 * transfer.pixel_size_A);
  double largest_A = 0.0;
  for (const double defocus_A : {transfer.defocus.u_A, transfer.defocus.v_A}) {
    const double linear = wavelength_A * defocus_A;
    const auto spread_A = [&](double k) { return std::fabs(linear * k - cubic * k * k * k); };
    largest_A = std::max(largest_A, spread_A(finest));
    // Where both balance, the spread has a maximum between.
    if (linear > 0.0 && cubic > 0.0)
      largest_A =
          std::max(largest_A, spread_A(std::min(finest, std::sqrt(linear / (3.0 * cubic)))));
  }
  return largest_A / transfer.pixel_size_A;
}

}  // namespace tomofield::microscope
