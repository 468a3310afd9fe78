#include "base/version.h"

#include "base/source_commit.h"  // made by cmake/WriteCommit.cmake in every build
#include "tomofield/version.h"

namespace tomofield {

const char* library_version() { return kVersion; }

const char* base::source_commit() { return kSourceCommit; }

}  // namespace tomofield
