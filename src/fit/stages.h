#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fit/options.h"

namespace tomofield::fit {

/// One resolution of a fit and one kind of field (DESIGN §5): projections of pixels `bin` times as
/// wide, and as many of the field's vertices as they resolve (Domain::shape_in). The last stage has
/// bin 1 and the kind of field that was asked for; those before it may have plain vertices for
/// factors.
struct Stage {
  FieldKind field_kind = FieldKind::kVm;
  int bin = 1;
  std::int64_t first_epoch = 0;
  int epochs = 0;
  double first_rate = 0, last_rate = 0;  ///< learning rates; they fall exponentially
  double step_cost = 1;                  ///< of a step, in those of the last stage, about
};

/// How long an optimisation takes, by what the field can express.
struct Schedule {
  int epochs;            ///< at full resolution
  double learning_rate;  ///< of the first step, but for FitOptions::vertex_rate

  /// Epochs of plain vertices, and coarse ones, that go with so many fine ones: the same share of
  /// the usual ones, at most all.
  int vertex_epochs_of(int fine) const;
  int coarse_epochs_of(int fine) const;
};

/// Whether factors usually begin as plain vertices, whose steps are cheaper and of which a third
/// does (docs/results/ablation.md): where these take no more memory than the factors, that is, a
/// leaf has at most twice as many along its side as the factors have ranks (of a margin, which is
/// small, four times), and more than ranks, so that each of these has something to hold.
bool begins_with_vertices(const FieldOptions& field, const FitOptions& fit);

/// Plain vertices, and factors that begin with them, converge in a third of the epochs that factors
/// need, and vertices in smaller steps. Where they are as far apart as the pixels of the last
/// coarse stage, it learns all that the field can express, and full resolution has little left to
/// do (docs/results/ablation.md). Of `fit` only what says which stages there are counts.
Schedule usual_schedule(const FieldOptions& field, const FitOptions& fit);

/// Coarse stages, each of half the pixel of the one before, which share the coarse epochs, unless
/// they are off or leaves do not end with slabs of coarse pixels; the fine one of plain vertices,
/// if factors begin with them; and that of the field. The ray engine has none but that.
std::vector<Stage> make_stages(const FieldOptions& field, const FitOptions& fit);

}  // namespace tomofield::fit
