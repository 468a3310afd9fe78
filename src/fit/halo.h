#pragma once

#include <cstdint>
#include <vector>

#include "base/aligned_buffer.h"
#include "base/range.h"
#include "distributed/communicator.h"
#include "field/field.h"
#include "field/tree/quadtree_bands.h"
#include "measurement/row_share.h"

namespace tomofield::fit {

/// Lists the leaves on both sides of the boundaries between a process's bands and those of its
/// neighbours. Terms of the loss that cross a boundary read both sides: boundary consistency, and
/// the total variation from the last row of one band to the first of the next. A process that works
/// on the first rows of its neighbour's bands reads those rows, too.
struct HaloLeaves {
  std::vector<int> own_first, own_last;  ///< own leaves at the start and at the end of the bands
  std::vector<int> before, after;  ///< leaves of the neighbours; empty at the ends of the domain
};
/// Returns the leaves at the boundaries of a process.
HaloLeaves halo_leaves(const field::Quadtree& tree, const measurement::RowShare& share);

/// Returns the leaves whose parameters a process needs, ascending: its own and those of its
/// neighbours at the boundaries.
std::vector<int> needed_leaves(const field::Quadtree& tree, const measurement::RowShare& share);

/// Copies parameters of the neighbours' leaves at the boundaries (the halo) between processes. It
/// copies those that densities depend on at the boundary itself, in the rows after it that the
/// process before the boundary works on, and at the centre of the next row of pixels on either
/// side.
class Halo {
 public:
  /// Plans the exchange for a process with this share. Rows are `pixel` high, in pixels at full
  /// resolution. `processes` must outlive the halo.
  Halo(const field::Field& field, const measurement::RowShare& share, int pixel,
       const distributed::Communicator& processes);
  /// Sends the own parameters at the boundaries to the neighbours and receives theirs. Every
  /// process calls it after it has changed the parameters of its leaves.
  void refresh(field::Field& field);

 private:
  // Holds the places of parameters in the whole array, and a buffer for their values.
  struct Part {
    std::vector<field::ParameterRuns> runs;
    std::vector<float> packed;
  };
  static Part part(const field::Field& field, const std::vector<int>& leaves, double low,
                   double high);

  const distributed::Communicator& processes_;
  Part to_before_, to_after_, from_before_, from_after_;
};

}  // namespace tomofield::fit
