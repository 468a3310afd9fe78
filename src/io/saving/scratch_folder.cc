#include "io/saving/scratch_folder.h"

#include <fmt/format.h>

#include <system_error>

#include "tomofield/error.h"

namespace tomofield::io {

namespace fs = std::filesystem;

ScratchFolder::ScratchFolder(const fs::path& folder, const char* name) : path_(folder / name) {
  std::error_code error;
  fs::remove_all(path_, error);
  if (fs::create_directory(path_, error)) return;
  throw Error(fmt::format("the folder '{}' cannot be written ({}): give another with -o",
                          folder.string(), error.message()));
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace tomofield::io
