#pragma once

#include <filesystem>

namespace tomofield::cli {

/// Writes pictures of the central slices of a volume (report/slices.h) and prints where they are.
void write_pictures(const std::filesystem::path& volume, const std::filesystem::path& prefix);

}  // namespace tomofield::cli
