#include "reconstruct/stages.h"

#include <algorithm>
#include <cmath>

#include "base/lanes.h"

namespace tomofield::reconstruct {
namespace {

// The largest power of two up to coarse_bin at which no slab straddles two leaves.
int coarse_bin(const FieldOptions& field, const FitOptions& fit) {
  if (fit.coarse_epochs == 0 || fit.engine != "slab") return 1;
  const bool may_halve = field.tree == "adaptive" && field.leaf_size % (2 * base::kLanes) == 0;
  const int smallest_leaf = may_halve ? field.leaf_size / 2 : field.leaf_size;
  int bin = 1;
  while (2 * bin <= fit.coarse_bin && smallest_leaf % (2 * bin * base::kLanes) == 0) bin *= 2;
  return bin;
}

}  // namespace

std::vector<Stage> make_stages(const FieldOptions& field, const FitOptions& fit) {
  const double last_rate = fit.learning_rate * fit.final_rate;
  const int bin = coarse_bin(field, fit);
  if (bin == 1) return {{1, 0, fit.epochs, fit.learning_rate, last_rate}};
  return {{bin, 0, fit.coarse_epochs, fit.learning_rate, fit.learning_rate * fit.coarse_final_rate},
          {1, fit.coarse_epochs, fit.epochs, fit.learning_rate * fit.refined_rate, last_rate}};
}

field::LeafShape coarser_shape(field::LeafShape shape, int bin) {
  for (int* n : {&shape.nx, &shape.ny, &shape.nz})
    *n = std::max(2, static_cast<int>(std::lround(static_cast<double>(*n - 1) / bin)) + 1);
  return shape;
}

}  // namespace tomofield::reconstruct
