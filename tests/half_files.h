#pragma once

#include <filesystem>
#include <span>

#include "base/volume.h"
#include "io/images/mrc.h"
#include "scratch_directory.h"

namespace tomofield::testing {

inline void write_volume_file(const base::Volume& volume, const std::filesystem::path& path) {
  const auto [nx, ny, nz] = volume.shape;
  io::MrcSpec spec;
  spec.nx = nx;
  spec.ny = ny;
  spec.nz = nz;
  spec.voxel_size_A.fill(volume.voxel_size_A);
  spec.origin_A = {-10, -20, -30};
  io::MrcWriter file(path, spec);
  file.write_sections(0, volume.data);
  file.close();
}

// Two volumes in files that live as long as the object.
class HalfFiles {
 public:
  HalfFiles(const base::Volume& even, const base::Volume& odd) {
    write_volume_file(even, this->even());
    write_volume_file(odd, this->odd());
  }
  std::filesystem::path even() const { return scratch_ / "even.mrc"; }
  std::filesystem::path odd() const { return scratch_ / "odd.mrc"; }
  std::filesystem::path result() const { return scratch_ / "result.mrc"; }

 private:
  ScratchDirectory scratch_;
};

}  // namespace tomofield::testing
