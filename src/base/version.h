#pragma once

namespace tomofield::base {

/// Returns `git describe --always --dirty` of the sources when this library was built, or "unknown"
/// without git.
const char* source_commit();

}  // namespace tomofield::base
