#pragma once

#include <cstddef>

#include "field/field.h"

namespace tomofield::field {

/// The offsets of the six factors in a leaf's parameters.
struct VmLayout {
  std::size_t vx, myz, vy, mxz, vz, mxy, count;
  explicit VmLayout(const LeafShape& s) {
    const auto size = [](int a, int b, int c) { return static_cast<std::size_t>(a) * b * c; };
    vx = 0;
    myz = vx + size(s.nx, 1, s.rank_x);
    vy = myz + size(s.nz, s.ny, s.rank_x);
    mxz = vy + size(s.ny, 1, s.rank_y);
    vz = mxz + size(s.nx, s.nz, s.rank_y);
    mxy = vz + size(s.nz, 1, s.rank_z);
    count = mxy + size(s.nx, s.ny, s.rank_z);
  }
};

}  // namespace tomofield::field
