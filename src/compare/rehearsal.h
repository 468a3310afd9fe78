#pragma once

#include <vector>

#include "compare/comparison.h"

namespace tomofield::compare {

/// Finds out before anything is made or run what would stop a comparison later: runs the command of
/// every row that is not done with --dry-run, and holds the volumes that they would make against
/// the first one and against the truth. False if it was asked to stop. Throws Error with the name
/// of the method and what its command said, or for volumes that cannot be compared, a truth that a
/// run would replace, and a folder that cannot be made or written.
bool rehearse(const CompareOptions& options, const RunHooks& hooks, const std::vector<Row>& rows);

}  // namespace tomofield::compare
