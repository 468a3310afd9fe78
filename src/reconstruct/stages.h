#pragma once

#include <cstdint>
#include <vector>

#include "field/field.h"
#include "reconstruct/options.h"

namespace tomofield::reconstruct {

/// One resolution of a fit (DESIGN §5): projections of pixels `bin` times as wide, a
/// field of vertices as far apart. The last stage has bin 1.
struct Stage {
  int bin = 1;
  std::int64_t first_epoch = 0;
  int epochs = 0;
  double first_rate = 0, last_rate = 0;  ///< learning rates; they fall exponentially
};

/// Coarse stages, which share the coarse epochs, unless they are off or leaves are too small for
/// slabs of coarse pixels, and the fine one. The ray engine has none but that.
std::vector<Stage> make_stages(const FieldOptions& field, const FitOptions& fit);

/// A leaf's vertices `bin` times as far apart, to the next whole number of them.
field::LeafShape coarser_shape(field::LeafShape shape, int bin);

}  // namespace tomofield::reconstruct
