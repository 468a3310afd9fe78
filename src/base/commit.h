#pragma once

namespace tomofield::base {

/// `git describe --always --dirty` of the sources when this library was built; "unknown" without
/// git.
const char* source_commit();

}  // namespace tomofield::base
