#pragma once

#include <cstdint>
#include <span>

#include "base/volume.h"
#include "simulate/phantom.h"

namespace tomofield::simulate {

/// Returns the density of the phantom at a position relative to its centre, in voxels.
double density_at(const Phantom& phantom, double x, double y, double z);

/// Computes the densities at the voxel centres of sections [first_section, first_section +
/// num_sections) of phantom.shape, as [num_sections, ny, nx], bands of rows in parallel.
void rasterize_sections(const Phantom& phantom, std::int64_t first_section,
                        std::int64_t num_sections, std::span<float> sections);

/// Returns the whole truth in memory, for tests and small phantoms.
base::Volume rasterize(const Phantom& phantom, double voxel_size_A = 1.0);

}  // namespace tomofield::simulate
