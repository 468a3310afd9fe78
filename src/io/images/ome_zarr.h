#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>

#include "base/plausible.h"
#include "io/images/mrc.h"
#include "tomofield/options.h"

namespace tomofield::io {

/// Returns the bytes of the arrays of a store: whole chunks, also where a volume ends in one.
/// `size` is (x, y, z).
base::CheckedSize ome_zarr_bytes(std::array<std::int64_t, 3> size, MrcMode mode);

/// Writes an MRC volume as OME-Zarr (https://ngff.openmicroscopy.org/): axes z, y, x in Å, the
/// volume itself in the array "0", and in "1", "2", … the means of 2 × 2 × 2 voxels of the array
/// before, until one chunk holds all. Chunks are uncompressed and have 64 voxels a side. ORIGIN
/// becomes a translation. Voxels stay float32, float16 or int16.
///
/// Holds 64 rows of 64 sections at once, however large the volume is. The folder appears as a whole
/// (AtomicFolder). Throws Error if it cannot be written, and as require_replaceable_zarr() does.
void write_ome_zarr(const std::filesystem::path& mrc, const std::filesystem::path& zarr,
                    const std::string& name, ZarrVersion version);

}  // namespace tomofield::io
