#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "simulate/simulation.h"

namespace tomofield::simulate {

/// Metrics of a series that was written.
struct SimulationSummary {
  struct Truth {
    double min = 0.0, max = 0.0, mean = 0.0;
  };
  std::int64_t num_ellipsoids = 0;
  std::int64_t num_beads = 0;
  std::int64_t num_views = 0;
  double empty_beam = 0.0;      ///< intensity of no specimen at gain 1; 0 if bright
  std::optional<double> sigma;  ///< of the Gaussian noise; none for counts
  std::optional<Truth> truth;   ///< none if it was not written
};

/// Simulates a tilt series of the cell phantom into `directory`, which it makes:
///
///   tilt_series.mrc  views × size × size   the series, with noise
///   clean.mrc        the same shape        what it would be without noise
///   truth.mrc        thickness × size × size, the density, high = dense
///   tilt_series.tlt  the true angles
///   tilt_series.xf   only with shifts: transforms that align the series
///   phantom.json     options, views and every ellipsoid
///
/// Bright contrast stores line integrals in voxels. A view at a time is in
/// memory, or a few sections of the truth. The same options give the same
/// bytes, whatever the thread count. Throws Error for options that cannot be,
/// for files that exist (unless `overwrite`) and when it cannot write.
SimulationSummary simulate_series(const std::filesystem::path& directory,
                                  const SimulationOptions& options, bool overwrite);

}  // namespace tomofield::simulate
