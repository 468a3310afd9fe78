#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tomofield/options.h"

namespace tomofield::fit {

/// Describes a part of a fit that has one resolution and one kind of field. The views have pixels
/// `bin` times as wide, and the field has as many vertices as these resolve (Domain::shape_in). The
/// last stage has bin 1 and the kind of field that was asked for. Earlier stages may have plain
/// vertices in place of factors.
struct Stage {
  FieldKind field_kind = FieldKind::kVm;
  int bin = 1;
  std::int64_t first_epoch = 0;
  int epochs = 0;
  double first_rate = 0, last_rate = 0;  ///< learning rates; the rate decays exponentially
  double step_cost = 1;                  ///< estimated time of a step, in steps of the last stage
  bool is_light = false;    ///< has little total variation, as the learned prior expects it
  bool has_answer = false;  ///< begins with the answer of the learned prior, and is pulled to it
};

/// The epochs and the learning rate of a fit with the default options.
struct Schedule {
  int epochs;            ///< of the last stage
  double learning_rate;  ///< FitOptions::learning_rate

  /// Returns the epochs of plain vertices that go before `fine` epochs of the last stage.
  int vertex_epochs_of(int fine) const;
  /// Returns the coarse epochs that go before `fine` epochs at full resolution. A fit that is
  /// shorter than usual has proportionally fewer of them.
  int coarse_epochs_of(int fine) const;
};

/// Returns true if a fit of factors begins with plain vertices by default. A step of plain vertices
/// is cheaper, and a third of the epochs is enough (docs/results/ablation.md). They are used in
/// uniform trees with the slab engine if they need no more memory than the factors: a leaf has at
/// most twice as many vertices along its side as the factors have ranks, and a leaf of the margin
/// at most four times as many. A leaf must also have enough vertices along its side beyond the
/// rank, so that each vector along z has something to hold.
bool begins_with_vertices(const FieldOptions& field, const FitOptions& fit);

/// Returns true if a fit can end with the learned prior, which works on plain vertices a pixel
/// apart in the uniform tree of the slab engine.
bool can_have_learned_prior(const FieldOptions& field, const FitOptions& fit);

/// Returns the default schedule of a field. Plain vertices, and factors that begin with them,
/// converge in a third of the epochs that other factors need. Vertices that are at least as far
/// apart as the pixels of the last coarse stage need few epochs at full resolution, because the
/// coarse stages have fitted all that they can express (docs/results/ablation.md). Plain vertices
/// take twice the epochs at full resolution for views that a microscope filtered
/// (`is_filtered`), because the largest transfer bounds the steps to their surrogates
/// (docs/results/convergence.md).
/// Only the members of `fit` that decide which stages there are have an effect.
Schedule usual_schedule(const FieldOptions& field, const FitOptions& fit, bool is_filtered = false);

/// Returns the stages of a fit in order:
///
///   1. Coarse stages share the coarse epochs. The pixels of each are half as wide as those of the
///      one before. There is no stage whose slabs would straddle two leaves.
///   2. A stage at full resolution has plain vertices, if FitOptions::vertex_epochs is above 0.
///   3. A stage has the field that was asked for.
///   4. With the learned prior (FitOptions::prior), a light stage follows. The prior answers to its
///      start and its end. The last stage begins with the answer.
///
/// The ray engine has the last stage alone.
std::vector<Stage> make_stages(const FieldOptions& field, const FitOptions& fit);

}  // namespace tomofield::fit
