#pragma once

#include <cstdint>

#include "simulate/phantom.h"

namespace tomofield::simulate {

/// Fills an extended slab with what yardstick C shows: thin membranes, fine structure and smooth
/// densities, in place of the constant densities of hollow ellipsoids. Densities of the specimen
/// are about in [0, 1]. U(a, b) is a uniform random number, T the thickness of the slab.
///
/// Gradients of the ice: blobs of σ = U(0.15, 0.4) T and peak U(−0.06, 0.06), 6 for each area T².
///
/// Vesicles: per area T² of the slab it tries 12 with a radius of U(0.12, 0.34) T, then 12 with
/// U(0.06, 0.14) T, at least 8 voxels. It drops one that would come nearer than 6 voxels to
/// another. The longest semi-axis is the radius R, the others are U(0.8 R, R).
///   membrane                U(2.4, 3.2) voxels thick along the longest semi-axis
///   density                 membrane: ice + U(0.4, 0.7); lumen: ice + U(0.05, 0.22)
///   second membrane inside  two in five with R >= 16 voxels, at a gap of U(4, 7) voxels
///   spikes                  half of those with R >= 12 voxels: blobs of σ = 1.4, U(7, 10) voxels
///                           apart, centred 2.5 voxels above the membrane, peak U(0.3, 0.45)
///   grain in the lumen      a blob for each 100 voxels, σ = U(1, 2), peak ± U(0.05, 0.11), where
///                           the magnitude is that of the vesicle
///
/// Filaments: one is tried for each 100 000 voxels. It is a chain of blobs of σ = 1.3 (3 voxels
/// wide at half height), σ apart, up to U(60, 250) voxels long. It ends near a membrane or a face
/// and is dropped if it is shorter than 24 voxels. Half of them are straight, the others have a
/// curvature of U(0.004, 0.02) per voxel whose direction drifts. Density: ice + U(0.2, 0.35).
///
/// Particles: each cell of a lattice of 20 voxels holds nothing (30 %), a blob of σ = U(3, 6), a
/// cluster of 3 to 5 blobs of σ = U(1.5, 3), or 3 single blobs of σ = U(1.5, 2), which are equally
/// likely. Their centre is uniform in the cell. Blobs nearer to a membrane or a face than 2 σ are
/// left out, so particles lie in the ice and in lumens.
///
/// Walls, blobs and filaments have the same size in voxels at any size of the phantom: they are the
/// finest detail that a tomogram can show.
void add_textured_content(std::uint64_t seed, Phantom& phantom);

}  // namespace tomofield::simulate
