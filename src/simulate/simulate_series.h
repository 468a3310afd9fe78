#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "simulate/simulation.h"

namespace tomofield::simulate {

/// Metrics of a simulated series.
struct SimulationSummary {
  struct Truth {
    double min = 0.0, max = 0.0, mean = 0.0;
  };
  std::int64_t num_ellipsoids = 0;  ///< without the gold beads
  std::int64_t num_blobs = 0;
  std::int64_t num_beads = 0;
  std::int64_t num_views = 0;
  std::int64_t num_particles = 0;  ///< of a physical specimen, also outside of the field of view
  double empty_beam = 0.0;         ///< intensity without a specimen at gain 1; 0 if bright
  std::optional<double> sigma;     ///< standard deviation of the Gaussian noise; none for counts
  std::optional<Truth> truth;      ///< none if it was not written
};

/// Simulates a tilt series of the cell phantom and writes it into `directory`, which it creates:
///
///   tilt_series.mrc  views × size × size   the series, with noise
///   clean.mrc        views × size × size   the series without noise
///   truth.mrc        thickness × size × size, the density, high = dense; with or without gold
///                    beads (SimulationOptions::reference_has_beads)
///   tilt_series.tlt  the true angles
///   tilt_series.rawtlt  only with errors of the tilt angles: the angles with these errors
///   tilt_series.xf   only with misalignment: transforms that undo all of it but local motion
///   tilt_series_ctf.txt, tilt_series.defocus
///                    only with a defocus: the contrast transfer, as CTFFIND and IMOD write it
///   tilt_series.mdoc only with a dose per tilt: the exposures
///   tilt_series_even.mrc, tilt_series_odd.mrc, membranes.mrc, particles.star, particle_KIND.mrc
///                    only with yardstick D (cryo/particle_files.h)
///   phantom.json     options, views and every ellipsoid, blob and bead
///
/// With bright contrast, the views are line integrals in voxels; with a defocus or a dose per tilt,
/// they are these integrals as the microscope filters them. It keeps one view, or a few
/// sections of the truth, in memory. The same options give the same bytes with any number of
/// threads. Throws Error for invalid options, for files that exist (unless `overwrite`) and if it
/// cannot write.
SimulationSummary simulate_series(const std::filesystem::path& directory,
                                  const SimulationOptions& options, bool overwrite);

}  // namespace tomofield::simulate
