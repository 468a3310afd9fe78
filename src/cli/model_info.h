#pragma once

#include <filesystem>

namespace tomofield::cli {

/// Prints the contents of a model file: the part of `info` for HDF5 files.
void print_model(const std::filesystem::path& path);

}  // namespace tomofield::cli
