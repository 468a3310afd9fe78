#include "tomofield/version.h"

namespace tomofield {

const char* library_version() { return kVersion; }

}  // namespace tomofield
