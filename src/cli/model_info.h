#pragma once

#include <filesystem>

namespace tomofield::cli {

/// Prints what a model file holds: the part of `info` for HDF5 files.
void print_model(const std::filesystem::path& path);

}  // namespace tomofield::cli
