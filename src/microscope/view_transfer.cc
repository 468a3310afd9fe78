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
  const double largest_A =
      std::max(std::fabs(transfer.defocus.u_A), std::fabs(transfer.defocus.v_A));
  return electron_wavelength_A(transfer.optics.voltage_kV) * largest_A /
         (2.0 * transfer.pixel_size_A * transfer.pixel_size_A);
}

}  // namespace tomofield::microscope
