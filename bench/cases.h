#pragma once

#include <string>
#include <vector>

#include "bench/measure.h"
#include "projection/slab_projector.h"
#include "tomofield/options.h"

namespace tomofield::bench {

// The report looks these cases up by name.
inline constexpr const char* kForward = "projection forward";
inline constexpr const char* kAdjoint = "projection adjoint";
inline constexpr const char* kForwardAlone = "projection forward, one slab";
inline constexpr const char* kAdjointAlone = "projection adjoint, one slab";
inline constexpr const char* kLoadL1 = "two loads and FMAs, L1";
inline constexpr const char* kLoadL2 = "two loads and FMAs, L2";
// Cases "step: …" serve any field, cases "vm: …" and "grid: …" one field. Each case is the share of
// one slab, but the projections are those of kSlabsTogether slabs.
inline constexpr const char* kStepForward = "step: projection forward";
inline constexpr const char* kStepAdjoint = "step: projection adjoint";

/// The number of slabs that a fit projects together.
inline constexpr int kSlabsTogether = projection::SlabProjector::kSlabsTogether;

/// Returns the projections of slabs of 256 × 16 × 64 voxels in 94 views from −70° to 69.5°: of two
/// slabs together and of one.
std::vector<Case> projection_cases();

/// Returns the loads and FMAs of a projection without the work around them, from L1 and from L2.
std::vector<Case> load_bound_cases();

/// Returns the parts of an optimiser step that do not depend on the kind of field: a slab's share
/// on yardstick A (256/150, 94 views) with default options.
std::vector<Case> step_cases();

/// Returns the parts of the same step that depend on the kind of field.
std::vector<Case> field_cases(FieldKind kind);

}  // namespace tomofield::bench
