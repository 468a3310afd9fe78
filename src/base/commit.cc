#include "base/commit.h"

#include "base/source_commit.h"  // made by cmake/WriteCommit.cmake in every build

namespace tomofield::base {

const char* source_commit() { return kSourceCommit; }

}  // namespace tomofield::base
