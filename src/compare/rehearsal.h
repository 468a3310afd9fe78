#pragma once

#include <vector>

#include "compare/comparison.h"

namespace tomofield::compare {

/// Finds out before the first run what would stop a comparison later. Runs the commands of all
/// unfinished rows with --dry-run, and compares the grids of the volumes with the first one's and
/// with the truth's. Returns false if it was asked to stop. Throws Error with the name of the
/// method and the message of its command, for volumes that cannot be compared, for a truth that a
/// run would replace, and for a folder that cannot be made or written.
bool rehearse(const CompareOptions& options, const RunHooks& hooks, const std::vector<Row>& rows);

}  // namespace tomofield::compare
