#pragma once

#include <optional>
#include <vector>

#include "measurement/view_residuals.h"
#include "reconstruct/run.h"

namespace tomofield::reconstruction {

/// Finds the models of the views that both halves keep: scale, offset, weight and largest residual.
/// They come from a fit of all views in some rows in the middle (selection::kTrialRows), with the
/// settings of the run. The list is empty if the options fit none of these. Returns nothing if a
/// stop was requested. Every process calls it.
std::optional<std::vector<measurement::ViewModel>> find_shared_views(const Run& run);

}  // namespace tomofield::reconstruction
