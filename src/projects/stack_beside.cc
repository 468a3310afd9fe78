#include "projects/stack_beside.h"

#include "io/images/image_stack.h"
#include "io/images/mrc.h"
#include "io/is_file.h"
#include "tomofield/error.h"

namespace tomofield::projects {

namespace fs = std::filesystem;
namespace {

// A file that cannot be read may be the stack: the error says so when it is opened.
bool is_stack(const fs::path& path) {
  if (!io::is_file(path)) return false;
  try {
    return !io::is_own_volume(io::open_image_stack(path)->header());
  } catch (const Error&) {
    return true;
  }
}

}  // namespace

std::optional<fs::path> find_stack_beside(const fs::path& file, const std::string& named) {
  fs::path stem = file;
  stem.replace_extension();
  if (is_stack(stem)) return stem;
  if (const fs::path stack = file.parent_path() / named; !named.empty() && is_stack(stack))
    return stack;
  for (const char* extension : {".mrc", ".st", ".mrcs", ".tif", ".tiff"})
    if (const fs::path stack = stem.string() + extension; is_stack(stack)) return stack;
  return std::nullopt;
}

}  // namespace tomofield::projects
