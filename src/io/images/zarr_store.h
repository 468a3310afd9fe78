#pragma once

#include <filesystem>

namespace tomofield::io {

/// The file by which a folder is known as a store that this program made; only such a folder is
/// replaced.
inline constexpr const char* kZarrMarker = ".tomofield";

/// Throws Error if something is at `path` that write_ome_zarr() must not replace: anything but a
/// store that this program made, or such a store with something that its own descriptions do not
/// list, which others put into it: labels, further levels, chunks beyond an array.
void require_replaceable_zarr(const std::filesystem::path& path);

}  // namespace tomofield::io
