#include "kernels/spikes.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "base/aligned_buffer.h"
#include "base/check.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/spikes.cc"
#include <hwy/foreach_target.h>
// Highway requires foreach_target to come before its other headers.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Holds the kRank largest and smallest values so far, the most extreme first.
template <int kRank, class D, class V = hn::Vec<D>>
class Extremes {
 public:
  HWY_INLINE explicit Extremes(D d) {
    for (int i = 0; i < kRank; ++i) {
      largest_[i] = hn::Set(d, -HUGE_VALF);
      smallest_[i] = hn::Set(d, HUGE_VALF);
    }
  }
  HWY_INLINE void add(V value) {
    V up = value, down = value;
    for (int i = 0; i < kRank; ++i) {
      const V high = hn::Max(largest_[i], up), low = hn::Min(smallest_[i], down);
      up = hn::Min(largest_[i], up);
      down = hn::Max(smallest_[i], down);
      largest_[i] = high;
      smallest_[i] = low;
    }
  }
  HWY_INLINE V limited(V value) const {
    return hn::Min(hn::Max(value, smallest_[kRank - 1]), largest_[kRank - 1]);
  }

 private:
  V largest_[kRank], smallest_[kRank];
};

// Limits the values of vertices y, y + 1, … of a row. `rows` has the nine rows around it and
// itself, which is number 4; each begins one vertex before the first. The bound is arithmetic: 26
// values take 4 kRank minima and maxima each.
template <int kRank, class D>
HWY_INLINE void limit_vector(D d, const float* const* rows, int y, float* out) {
  Extremes<kRank, D> extremes(d);
  for (int r = 0; r < 9; ++r) {
    for (int shift = 0; shift < 3; ++shift)
      if (r != 4 || shift != 1) extremes.add(hn::LoadU(d, rows[r] + y + shift));
  }
  hn::StoreU(extremes.limited(hn::LoadU(d, rows[4] + y + 1)), d, out + y);
}

template <int kRank>
void limit_row(const float* const* rows, int ny, float* out) {
  const hn::ScalableTag<float> d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  int y = 0;
  for (; y + lanes <= ny; y += lanes) limit_vector<kRank>(d, rows, y, out);
  if (y == ny) return;
  // The last vector overlaps the one before it: vertices one by one would take as long each.
  if (ny >= lanes) return limit_vector<kRank>(d, rows, ny - lanes, out);
  for (; y < ny; ++y) limit_vector<kRank>(hn::CappedTag<float, 1>(), rows, y, out);
}

// Calls limit_row() of a rank from 1 to kRank.
template <int kRank>
void limit_row_of_rank(int rank, const float* const* rows, int ny, float* out) {
  if constexpr (kRank > 1) {
    if (rank < kRank) return limit_row_of_rank<kRank - 1>(rank, rows, ny, out);
  }
  limit_row<kRank>(rows, ny, out);
}

void limit_row_of_any_rank(int rank, const float* const* rows, int ny, float* out) {
  limit_row_of_rank<kMostSpikeRank>(rank, rows, ny, out);
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(limit_row_of_any_rank);

namespace {

// Returns the vertex that stands for vertex `i`, which may be one beyond the lattice: its mirror
// image about the outermost vertex, which is not repeated.
int mirrored_about_ends(int i, int n) { return n == 1 ? 0 : n - 1 - std::abs(n - 1 - std::abs(i)); }

// Copies the rows of a lattice, each with one mirrored vertex before it and one after it.
void copy_mirrored(const LatticeShape& shape, const float* values, float* copy) {
  for (int row = 0; row < shape.nx * shape.nz; ++row, values += shape.ny, copy += shape.ny + 2) {
    copy[0] = values[mirrored_about_ends(-1, shape.ny)];
    std::copy_n(values, shape.ny, copy + 1);
    copy[shape.ny + 1] = values[mirrored_about_ends(shape.ny, shape.ny)];
  }
}

}  // namespace

void limit_spikes(const LatticeShape& shape, int rank, float* values) {
  TOMOFIELD_CHECK(rank >= 1 && rank <= kMostSpikeRank, "a rank of the spike limit from 1 to 8");
  thread_local base::AlignedBuffer<float> copy;
  const std::ptrdiff_t row_size = shape.ny + 2;
  copy.reserve(static_cast<std::size_t>(shape.nx * shape.nz * row_size));
  copy_mirrored(shape, values, copy.data());
  for (int x = 0; x < shape.nx; ++x) {
    for (int z = 0; z < shape.nz; ++z, values += shape.ny) {
      const float* rows[9];
      for (int i = 0; i < 9; ++i) {
        const int at_x = mirrored_about_ends(x + i / 3 - 1, shape.nx),
                  at_z = mirrored_about_ends(z + i % 3 - 1, shape.nz);
        rows[i] = copy.data() + (static_cast<std::ptrdiff_t>(at_x) * shape.nz + at_z) * row_size;
      }
      HWY_DYNAMIC_DISPATCH(limit_row_of_any_rank)(rank, rows, shape.ny, values);
    }
  }
}
}  // namespace tomofield::kernels
#endif
