#include "io/file_start.h"

#include <fstream>
#include <string>

namespace tomofield::io {

bool begins_with(const std::filesystem::path& file, std::string_view text) {
  std::string start(text.size(), '\0');
  std::ifstream stream(file, std::ios::binary);
  return stream.read(start.data(), std::ssize(start)) && start == text;
}

}  // namespace tomofield::io
