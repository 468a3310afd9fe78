#pragma once

#include <cstdint>
#include <vector>

#include "reconstruct/options.h"

namespace tomofield::reconstruct {

/// One resolution of a fit (DESIGN §5): projections of pixels `bin` times as wide, and
/// as many of the field's vertices as they resolve (Domain::shape_in). The last stage has bin 1.
struct Stage {
  int bin = 1;
  std::int64_t first_epoch = 0;
  int epochs = 0;
  double first_rate = 0, last_rate = 0;  ///< learning rates; they fall exponentially
};

/// How long an optimisation takes, by what the field can express.
struct Schedule {
  int epochs;            ///< at full resolution
  double learning_rate;  ///< of the first step

  /// Coarse epochs that go with so many fine ones: the same share of the usual ones, at most all.
  int coarse_epochs_of(int fine) const;
};

/// Plain vertices converge in a third of the epochs that factors need, and in smaller steps. Where
/// vertices are as far apart as the pixels of the last coarse stage, it learns all that the field
/// can express, and full resolution has little left to do (docs/results/ablation.md). Of `fit` only
/// what says whether there is a coarse stage counts.
Schedule usual_schedule(const FieldOptions& field, const FitOptions& fit);

/// Coarse stages, each of half the pixel of the one before, which share the coarse epochs, unless
/// they are off or leaves do not end with slabs of coarse pixels, and the fine one. The ray engine
/// has none but that.
std::vector<Stage> make_stages(const FieldOptions& field, const FitOptions& fit);

}  // namespace tomofield::reconstruct
