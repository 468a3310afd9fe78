#pragma once

#include <cstdint>
#include <vector>

#include "base/aligned_buffer.h"
#include "base/range.h"
#include "distributed/communicator.h"
#include "field/field.h"
#include "measurement/slab_views.h"

namespace tomofield::fit {

/// The leaves of those bands, which are numbered one after another.
base::Range leaves_of_bands(const field::Quadtree& tree, base::Range bands);

/// The leaves along both ends of a process's bands: its own, which its neighbours read, and
/// theirs, which it reads for what crosses the boundary (boundary consistency, and total variation
/// from the last row of one band to the first of the next).
struct HaloLeaves {
  std::vector<int> own_first, own_last;  ///< along the first band's start, the last one's end
  std::vector<int> before, after;        ///< across these; none at the domain's ends
};
HaloLeaves halo_leaves(const field::Quadtree& tree, base::Range bands);

/// The leaves whose parameters a process needs: those of its bands and across their ends.
std::vector<int> needed_leaves(const field::Quadtree& tree, base::Range bands);

/// Keeps what a process needs of its neighbours' leaves as they have it: the parameters that
/// matter on the boundary and in the row on either side of it, whose rows are `pixel` high.
class Halo {
 public:
  Halo(const field::Field& field, base::Range bands, int pixel,
       const distributed::Communicator& processes);
  /// After every process has changed the parameters of its leaves.
  void refresh(field::Field& field);

 private:
  // Runs in all parameters, and room for what they hold.
  struct Part {
    std::vector<field::ParameterRuns> runs;
    std::vector<float> packed;
  };
  enum class Side { kStart, kEnd };  // of a leaf, along y
  static Part part(const field::Field& field, const std::vector<int>& leaves, Side side, int pixel);

  const distributed::Communicator& processes_;
  Part to_before_, to_after_, from_before_, from_after_;
};

}  // namespace tomofield::fit
