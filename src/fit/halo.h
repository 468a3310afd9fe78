#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/aligned_buffer.h"
#include "base/range.h"
#include "distributed/communicator.h"
#include "field/field.h"
#include "field/tree/quadtree_bands.h"
#include "measurement/row_share.h"
#include "tomofield/options.h"

namespace tomofield::fit {

/// Lists the leaves on both sides of the boundaries between a process's bands and those of its
/// neighbours. Terms of the loss that cross a boundary read both sides: boundary consistency, and
/// the total variation from the last row of one band to the first of the next. A process that works
/// on the first rows of its neighbour's bands reads those rows, too. The learned prior reads more
/// rows on both sides.
struct HaloLeaves {
  std::vector<int> own_first, own_last;  ///< own leaves at the start and at the end of the bands
  std::vector<int> before, after;  ///< leaves of the neighbours; empty at the ends of the domain
};
/// Returns the leaves at the boundaries of a process, which reads `rows` rows beyond each of them.
HaloLeaves halo_leaves(const field::Quadtree& tree, const measurement::RowShare& share,
                       std::int64_t rows = 1);

/// Returns the leaves whose parameters a process needs: its own and those of its neighbours in
/// `rows` rows beyond the boundaries.
std::vector<int> needed_leaves(const field::Quadtree& tree, const measurement::RowShare& share,
                               std::int64_t rows = 1);

/// Returns the rows beyond the boundaries that a fit with this prior reads at least once.
std::int64_t rows_beyond(Prior prior);

/// Copies parameters of the neighbours' leaves at the boundaries (the halo) between processes. It
/// copies those that densities depend on at the boundary itself, in the rows after it that the
/// process before the boundary works on, and in some rows more on either side.
class Halo {
 public:
  /// Plans the exchange for a process with this share. Densities are covered up to `reach` pixels
  /// at full resolution beyond the rows: half the height of a pixel of the stage covers the centre
  /// of the next row. The neighbours must have at least these rows, or be at an end of the
  /// domain. `processes` must outlive the halo.
  Halo(const field::Field& field, const measurement::RowShare& share, double reach,
       const distributed::Communicator& processes);
  /// Sends the own parameters at the boundaries to the neighbours and receives theirs.
  /// `parameters` are those of the field or have their places. Every process calls it after it has
  /// changed the parameters of its leaves.
  void refresh(std::span<float> parameters);

  /// Returns the own parameters at the boundaries, and where those of the neighbours belong, until
  /// the next call.
  distributed::Communicator::Halo pack(std::span<const float> parameters);
  /// Copies what has arrived from the neighbours to its places.
  void unpack(std::span<float> parameters) const;

 private:
  // The places of parameters in the whole array, and a buffer for their values.
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
