#include "microscope/ctf.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tomofield::microscope {
namespace {

TEST(ElectronWavelength, IsThatOfTheTextbooks) {
  EXPECT_NEAR(electron_wavelength_A(80), 0.0417572, 1e-7);
  EXPECT_NEAR(electron_wavelength_A(200), 0.0250793, 1e-7);
  EXPECT_NEAR(electron_wavelength_A(300), 0.0196875, 1e-7);
}

// The expected values are those of a Python script that has the two terms of the paper,
// −√(1 − w²) sin χ − w cos χ, and the wavelength from the constants of nature.
TEST(Ctf, IsThatOfCtffind) {
  struct Case {
    Optics optics;
    io::Defocus defocus;
    double kx, ky, expected;
  };
  const Case cases[] = {
      {{300, 2.7, 0.07, 0}, {30000, 30000, 0, 0}, 0.02, 0.03, -0.613061187712},
      {{300, 2.7, 0.07, 0}, {31000, 29000, 25, 0}, 0.04, 0.05, -0.999606144153},
      {{200, 1.4, 0.1, 0}, {15000, 12000, -70, 90}, -0.1, 0.06, 0.641689578220},
      {{300, 2.7, 0.07, 150}, {31000, 29000, 25, 30}, 0.1, -0.12, -0.148889196018},
      {{120, 2.0, 0.2, 40}, {-5000, -6000, 10, 0}, 0.05, 0.0, 0.881742454028},
  };
  for (const Case& c : cases) {
    const Ctf ctf(c.optics, c.defocus);
    EXPECT_NEAR(ctf.value(c.kx, c.ky), c.expected, 1e-6);
    EXPECT_EQ(ctf.value(c.kx, c.ky), ctf.value(-c.kx, -c.ky));
  }
}

TEST(Ctf, IsMinusTheAmplitudeContrastAtZero) {
  EXPECT_NEAR(Ctf({300, 2.7, 0.07, 0}, {30000, 30000, 0, 0}).value(0, 0), -0.07, 1e-12);
}

TEST(Ctf, HasItsZerosWhereTheFormulaSays) {
  // Without aberration and amplitude contrast the n-th zero is at k² = n / (λ Δf).
  const Ctf ctf({300, 0, 0, 0}, {20000, 20000, 0, 0});
  for (int n = 1; n < 20; ++n)
    EXPECT_NEAR(ctf.value(std::sqrt(n / (ctf.wavelength_A() * 20000)), 0), 0.0, 1e-9);
  // A quarter turn of the phase plate puts an extremum at 0.
  EXPECT_NEAR(Ctf({300, 2.7, 0, 0}, {0, 0, 0, 90}).value(0, 0), -1.0, 1e-12);
}

TEST(Ctf, HasItsFirstDefocusAlongTheAngle) {
  const io::Defocus astigmatic{32000, 28000, 35, 0};
  const Ctf ctf({}, astigmatic);
  const Ctf along({}, {32000, 32000, 0, 0}), across({}, {28000, 28000, 0, 0});
  const double k = 0.031, x = std::cos(35 * std::numbers::pi / 180),
               y = std::sin(35 * std::numbers::pi / 180);
  EXPECT_NEAR(ctf.value(k * x, k * y), along.value(k, 0), 1e-9);
  EXPECT_NEAR(ctf.value(-k * y, k * x), across.value(k, 0), 1e-9);
}

TEST(Ctf, OfAPartOfATiltedViewHasMoreDefocus) {
  const Ctf ctf({}, {32000, 28000, 35, 0}), deeper({}, {33500, 29500, 35, 0});
  EXPECT_NEAR(ctf.value(0.02, -0.03, 1500), deeper.value(0.02, -0.03), 1e-9);
}

TEST(Ctf, IsNowhereAboveItsLargestValue) {
  const Ctf ctf(Optics{}, {32000, 28000, 35, 20});
  for (double from = 0.0; from < 0.1; from += 0.002) {
    double largest = 0.0;
    for (int i = 0; i <= 20; ++i) {
      const double k = from + 0.0001 * i;
      for (double angle = 0.0; angle < 3.1; angle += 0.1)
        for (double more_A = -500; more_A <= 1500; more_A += 250)
          largest = std::max(largest,
                             std::abs(ctf.value(k * std::cos(angle), k * std::sin(angle), more_A)));
    }
    const double bound = ctf.largest(from, from + 0.002, -500, 1500);
    EXPECT_GE(bound, largest - 1e-9) << from;
    EXPECT_LE(bound, largest + 0.05) << from;
  }
}

TEST(Ctf, ReachesAsFarAsItsPhaseChanges) {
  for (const double defocus_A : {20000.0, -3000.0, 1500.0}) {
    const Ctf ctf({300, 2.7, 0.07, 0}, {defocus_A, defocus_A, 0, 0});
    const double lambda = ctf.wavelength_A(), cs = 2.7e7, k_max = 0.3, h = 1e-6;
    const auto phase = [&](double k) {
      return std::numbers::pi * lambda * k * k * (defocus_A - lambda * lambda * k * k * cs / 2);
    };
    double farthest = 0.0;
    for (double k = h; k <= k_max; k += 0.001)
      farthest = std::max(farthest,
                          std::abs(phase(k + h) - phase(k - h)) / (2 * h) / 2 / std::numbers::pi);
    EXPECT_NEAR(ctf.reach_A(k_max) / farthest, 1.0, 0.01) << defocus_A;
  }
}

TEST(AlignedDefocus, TurnsWithTheImage) {
  // The raw image is the aligned one turned by +20 degrees, so what lies along 50 degrees in it
  // lies along 30 in the aligned one.
  const double c = std::cos(20 * std::numbers::pi / 180), s = std::sin(20 * std::numbers::pi / 180);
  const io::Defocus raw{32000, 28000, 50, 10};
  const io::Defocus aligned = aligned_defocus(raw, {c, -s, s, c, 3, 4});
  EXPECT_NEAR(aligned.angle_deg, 30, 1e-9);
  EXPECT_EQ(aligned.u_A, raw.u_A);
  EXPECT_EQ(aligned.v_A, raw.v_A);
  EXPECT_EQ(aligned.phase_shift_deg, raw.phase_shift_deg);
  // A mirrored image mirrors the direction.
  EXPECT_NEAR(aligned_defocus(raw, {1, 0, 0, -1, 0, 0}).angle_deg, -50, 1e-9);
}

}  // namespace
}  // namespace tomofield::microscope
