#include "microscope/ctf.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace tomofield::microscope {
namespace {

constexpr double kRadians = std::numbers::pi / 180.0;
constexpr double kAngstroms_in_mm = 1e7;

}  // namespace

Optics without_phase_contrast(Optics optics) {
  optics.spherical_aberration_mm = 0.0;
  optics.amplitude_contrast = 1.0;
  return optics;
}

// λ = h / √(2 m e U (1 + e U / (2 m c²))), with the constants of CODATA 2018.
double electron_wavelength_A(double voltage_kV) {
  const double volts = 1000.0 * voltage_kV;
  return 12.264260 / std::sqrt(volts * (1.0 + 0.97847560e-6 * volts));
}

Ctf::Ctf(const Optics& optics, const io::Defocus& defocus)
    : wavelength_A_(electron_wavelength_A(optics.voltage_kV)),
      mean_defocus_A_((defocus.u_A + defocus.v_A) / 2),
      half_difference_A_((defocus.u_A - defocus.v_A) / 2),
      cos_2angle_(std::cos(2 * kRadians * defocus.angle_deg)),
      sin_2angle_(std::sin(2 * kRadians * defocus.angle_deg)),
      aberration_A3_(wavelength_A_ * wavelength_A_ * kAngstroms_in_mm *
                     optics.spherical_aberration_mm / 2),
      phase_turns_((kRadians * defocus.phase_shift_deg + std::asin(optics.amplitude_contrast)) /
                   (2 * std::numbers::pi)),
      quarter_b_factor_A2_(optics.b_factor_A2 / 4) {}

double Ctf::value(double kx, double ky, double more_defocus_A) const {
  return -std::sin(2 * std::numbers::pi * turns(kx, ky, more_defocus_A)) *
         envelope(kx * kx + ky * ky);
}

double Ctf::envelope(double k2) const { return std::exp(-quarter_b_factor_A2_ * k2); }

double Ctf::turns(double kx, double ky, double more_defocus_A) const {
  const double k2 = kx * kx + ky * ky;
  // k² cos(2 (α − angle))
  const double k2_cosine = (kx * kx - ky * ky) * cos_2angle_ + 2 * kx * ky * sin_2angle_;
  return turns_of((mean_defocus_A_ + more_defocus_A) * k2 + half_difference_A_ * k2_cosine, k2);
}

// Returns the argument of the sine over 2π, where the first number is the defocus times k².
double Ctf::turns_of(double defocus_A_k2, double k2) const {
  return wavelength_A_ / 2 * (defocus_A_k2 - aberration_A3_ * k2 * k2) + phase_turns_;
}

double Ctf::largest(double from, double to, double low_A, double high_A) const {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const double k : {from, to}) {
    for (const double defocus_A : {mean_defocus_A_ - std::abs(half_difference_A_) + low_A,
                                   mean_defocus_A_ + std::abs(half_difference_A_) + high_A}) {
      const double turns = turns_of(defocus_A * k * k, k * k);
      least = std::min(least, turns);
      most = std::max(most, turns);
    }
  }
  const double next_extremum = std::ceil(2 * least - 0.5) / 2 + 0.25;  // of the sine
  if (next_extremum <= most) return 1.0;
  return std::max(std::abs(std::sin(2 * std::numbers::pi * least)),
                  std::abs(std::sin(2 * std::numbers::pi * most)));
}

double Ctf::reach_A(double k, double more_defocus_A) const {
  const double spread_A = std::abs(half_difference_A_) + std::abs(more_defocus_A);
  double reach_A = 0.0;
  for (const double defocus_A : {mean_defocus_A_ - spread_A, mean_defocus_A_ + spread_A}) {
    const auto displacement_A = [&](double at) {
      return std::abs(wavelength_A_ * at * (defocus_A - 2 * aberration_A3_ * at * at));
    };
    // Where the displacement is stationary: underfocus and aberration have different signs.
    const double stationary = std::sqrt(std::max(0.0, defocus_A / (6 * aberration_A3_)));
    reach_A = std::max(reach_A, displacement_A(k));
    if (stationary < k) reach_A = std::max(reach_A, displacement_A(stationary));
  }
  return reach_A;
}

io::Defocus aligned_defocus(const io::Defocus& recorded, const geometry::RawFromAligned& map) {
  const double x = std::cos(kRadians * recorded.angle_deg);
  const double y = std::sin(kRadians * recorded.angle_deg);
  const double determinant = map.m11 * map.m22 - map.m12 * map.m21;
  const double aligned_x = (map.m22 * x - map.m12 * y) / determinant;
  const double aligned_y = (map.m11 * y - map.m21 * x) / determinant;
  io::Defocus aligned = recorded;
  aligned.angle_deg = std::atan2(aligned_y, aligned_x) / kRadians;
  return aligned;
}

}  // namespace tomofield::microscope
