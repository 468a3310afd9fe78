#pragma once

#include <cstdint>
#include <vector>

#include "base/volume.h"
#include "simulate/ellipsoid.h"

namespace tomofield::simulate {

/// A slab of constant density with ellipsoids added to it. Everything about it
/// is analytic; project_phantom.h and rasterize.h turn it into images.
struct Phantom {
  base::Shape3 shape;             ///< voxels of the truth: field of view × thickness
  bool is_extended = false;       ///< the slab goes on for ever in X and Y
  double half_width_px = 0.0;     ///< ellipsoids lie within |X| <= this
  double slab_density = 0.0;      ///< bounded: within `shape`; extended: within |Z| <= nz / 2
  std::vector<Ellipsoid> bodies;  ///< the cell's ellipsoids, then the gold beads
  std::int64_t num_beads = 0;     ///< how many of `bodies`, at their end, are gold beads
};

/// What make_cell_phantom() shall make.
struct CellOptions {
  std::int64_t size_px = 256;       ///< width and height of the field of view
  std::int64_t thickness_px = 150;  ///< of the slab
  bool is_extended = false;
  double max_tilt_deg = 70.0;  ///< |tilt| that an extended phantom must serve
  std::uint64_t seed = 7;
  std::int64_t num_beads = 0;  ///< gold beads in the field of view (mean, if extended)
  double bead_diameter_px = 10.0;
  double bead_density = 5.0;  ///< added to what is there; the cell itself is in [0, 1]
};

/// The yardstick of the project's scores, after Kniesel et al. 2022: ice with
/// hollow, membrane-bound ellipsoids that do not overlap (bounding spheres).
/// Slab 0.2; semi-axes U(0.7 R, R), one of them R; orientations uniform; inner /
/// outer surface U(0.85, 0.95); wall + U(0.5, 0.98), inside + U(0.1, 0.5). For
/// a thickness T, 125 ellipsoids with R in U(0.15, 0.4) T are tried, then 2000
/// with U(0.05, 0.25) T, each lot from the largest to the smallest; one that
/// would touch an earlier one is dropped. All densities are divided by 1.18,
/// the largest sum, so that the cell lies in [0, 1]. A bounded phantom lies
/// wholly within its box; an extended one goes on in X as far as any ray up to
/// max_tilt_deg reaches, and past the field of view in Y, with as many more tries.
///
/// Beads are solid spheres on the slab's two faces and inside it (a third
/// each), which do not touch each other; they come from a random stream of their
/// own, so the cell of a seed is the same with and without them.
Phantom make_cell_phantom(const CellOptions& options);

}  // namespace tomofield::simulate
