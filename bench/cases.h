#pragma once

#include <string>
#include <vector>

#include "bench/measure.h"
#include "projection/slab_projector.h"
#include "tomofield/options.h"

namespace tomofield::bench {

// Names that the report refers to.
inline constexpr const char* kForward = "projection forward";
inline constexpr const char* kAdjoint = "projection adjoint";
inline constexpr const char* kForwardAlone = "projection forward, one slab";
inline constexpr const char* kAdjointAlone = "projection adjoint, one slab";
inline constexpr const char* kLoadL1 = "two loads and FMAs, L1";
inline constexpr const char* kLoadL2 = "two loads and FMAs, L2";
// A slab's share of a step, but for projection, which is that of a pair: "step: …" whatever the
// field, "vm: …" and "grid: …" by field.
inline constexpr const char* kStepForward = "step: projection forward";
inline constexpr const char* kStepAdjoint = "step: projection adjoint";

/// Slabs that a fit projects together.
inline constexpr int kSlabsTogether = projection::SlabProjector::kSlabsTogether;

/// The projection of slabs of 256 × 16 × 64 voxels, 94 views, −70 … 69.5°: two together, and one.
std::vector<Case> projection_cases();

/// Its loads and FMAs without any of the work around them, from L1 and from L2.
std::vector<Case> load_bound_cases();

/// A slab's share of an optimiser step on yardstick A (256 / 150, 94 views),
/// default options: the projection, what else no field changes, and what
/// depends on the kind of field.
std::vector<Case> step_cases();
std::vector<Case> field_cases(FieldKind kind);

}  // namespace tomofield::bench
