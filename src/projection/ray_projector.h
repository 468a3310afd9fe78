#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/aligned_buffer.h"
#include "field/field.h"
#include "field/tree/quadtree.h"
#include "geometry/ray_geometry.h"
#include "kernels/ray_samples.h"

namespace tomofield::projection {

/// The piece of a ray inside one leaf.
struct LeafCrossing {
  int leaf = 0;
  geometry::HeightRange heights;  ///< never empty
};

/// Appends the leaves that a line crosses within `heights`, in the order of the leaves. Leaves are
/// vertical prisms, so only (X, Y) matters. Each point of the line over the tree belongs to exactly
/// one crossing.
void find_crossings(const field::Quadtree& tree, const geometry::RayBundle::Line& line,
                    const geometry::HeightRange& heights, std::vector<LeafCrossing>& crossings);

/// The ray that ends in the centre of pixel (x, y) of a view as it was recorded.
struct Ray {
  std::int32_t view = 0;
  std::int32_t x = 0, y = 0;
  bool operator==(const Ray&) const = default;
};

/// The result of a forward projection that its adjoint needs: the places at which each ray was
/// sampled, and the densities found there, leaf by leaf.
class RayTrace {
  friend class RayProjector;
  struct Piece {
    kernels::RayPiece samples;
    std::uint32_t ray = 0;
    std::size_t first_density = 0;
    double sum = 0.0;
  };
  std::vector<Piece> pieces_;  // sorted by leaf; within a leaf in the order of the rays
  std::vector<std::size_t> first_of_leaf_;  // one more than there are leaves
  base::AlignedBuffer<float> densities_;
};

/// The ray engine computes line integrals of a field along any straight rays by the paper's
/// stratified sampling (eq. 10). A ray's piece of length l in a leaf of diagonal d has
/// ⌈samples_per_diagonal · l / d⌉ segments, each with one sample at a random place. The integral is
/// Σ segment length · density.
///
/// A leaf's factors are contracted at its vertices once for all rays of a batch. A sample is then
/// eight gathers. Leaves are the unit of work, forward and back, and a leaf takes its rays in their
/// order, so the bits do not depend on the number of threads. `field` must outlive the projector.
/// Its parameters may change, but not its tree.
class RayProjector {
 public:
  /// Treats the density as zero outside `support`, even if the domain reaches further.
  RayProjector(const geometry::RayGeometry& geometry, const field::Field& field,
               const geometry::Extent2& support, int samples_per_diagonal);

  /// Returns the line integrals of the rays, in density units times pixels. `draw` chooses the
  /// random positions: the same draw puts a ray's samples at the same places.
  std::vector<float> forward(std::span<const Ray> rays, std::uint32_t draw, RayTrace& trace) const;
  /// Adds dL/d parameters to gradient (all parameters), given dL/d ray for the rays of `trace`. The
  /// parameters must still be those of the forward projection. Returns dL/d bias.
  double backward(const RayTrace& trace, std::span<const float> grad_rays, float* gradient) const;

 private:
  void trace_rays(std::span<const Ray> rays, std::uint32_t draw, RayTrace& trace) const;
  kernels::RayPiece sample_positions(const geometry::RayBundle& bundle,
                                     const geometry::RayBundle::Line& line,
                                     const LeafCrossing& crossing) const;

  const field::Field& field_;
  geometry::Extent2 support_;
  int samples_per_diagonal_;
  std::vector<geometry::RayBundle> bundles_;  // rays of each view
};

}  // namespace tomofield::projection
