#include "evaluate/uncertainty.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>
#include <vector>

#include "base/check.h"
#include "base/range.h"
#include "base/threads/parallel.h"
#include "base/trace.h"
#include "evaluate/box.h"
#include "output/volume.h"
#include "tomofield/version.h"

namespace tomofield::evaluate {
namespace {

constexpr std::int64_t kReach = kUncertaintyBox / 2;

// Two volumes of one size that are read section by section.
class SectionPair {
 public:
  SectionPair(const std::filesystem::path& first, const std::filesystem::path& second)
      : first_(first), second_(second) {
    TOMOFIELD_CHECK(whole_box(first_) == whole_box(second_), "halves have one size");
  }
  const io::MrcHeader& header() const { return first_.header(); }

  // Returns combine(a, b) for each voxel of a section.
  template <typename Combine>
  std::vector<float> section(std::int64_t z, const Combine& combine) const {
    std::vector<float> a(static_cast<std::size_t>(header().nx * header().ny)), b(a.size());
    first_.read_section(z, a);
    second_.read_section(z, b);
    std::ranges::transform(a, b, a.begin(), combine);
    return a;
  }

 private:
  io::MrcReader first_, second_;
};

base::Range reach_of(std::int64_t i, std::int64_t n) {
  return {static_cast<int>(std::max<std::int64_t>(i - kReach, 0)),
          static_cast<int>(std::min(i + kReach + 1, n))};
}

// Replaces each value of a section by the sum over a square around it, as far as that lies within.
void sum_squares(std::int64_t nx, std::int64_t ny, std::vector<float>& section) {
  std::vector<float> along_x(section.size());
  const auto at = [nx](std::int64_t x, std::int64_t y) {
    return static_cast<std::size_t>(y * nx + x);
  };
  base::parallel_for("sum rows", ny, [&](std::int64_t y) {
    for (std::int64_t x = 0; x < nx; ++x) {
      const base::Range reach = reach_of(x, nx);
      float sum = 0.0f;
      for (int i = reach.begin; i < reach.end; ++i) sum += section[at(i, y)];
      along_x[at(x, y)] = sum;
    }
  });
  base::parallel_for("sum columns", ny, [&](std::int64_t y) {
    const base::Range reach = reach_of(y, ny);
    for (std::int64_t x = 0; x < nx; ++x) {
      float sum = 0.0f;
      for (int j = reach.begin; j < reach.end; ++j) sum += along_x[at(x, j)];
      section[at(x, y)] = sum;
    }
  });
}

}  // namespace

void write_uncertainty(const std::filesystem::path& first, const std::filesystem::path& second,
                       const std::filesystem::path& path) {
  const base::TraceSpan span("uncertainty");
  const SectionPair halves(first, second);
  const std::int64_t nx = halves.header().nx, ny = halves.header().ny, nz = halves.header().nz;
  io::MrcWriter map(path, map_like(halves.header(), "standard error of the mean of the halves"));
  const auto half_a_value = static_cast<float>(0.5 / output::stored_factor(halves.header()));
  std::deque<std::vector<float>> sums;  // of the squares of a section, of those within reach
  std::int64_t first_sum = 0;           // the section of sums.front()
  for (std::int64_t z = 0; z < nz; ++z) {
    const base::Range reach = reach_of(z, nz);
    for (; first_sum < reach.begin; ++first_sum) sums.pop_front();
    while (first_sum + std::ssize(sums) < reach.end) {
      sums.push_back(halves.section(first_sum + std::ssize(sums),
                                    [](float a, float b) { return (a - b) * (a - b); }));
      sum_squares(nx, ny, sums.back());
    }
    std::vector<float> error(static_cast<std::size_t>(nx * ny));
    base::parallel_for("write uncertainty", ny, [&](std::int64_t y) {
      for (std::int64_t x = 0; x < nx; ++x) {
        const auto at = static_cast<std::size_t>(y * nx + x);
        float sum = 0.0f;
        for (const std::vector<float>& section : sums) sum += section[at];
        const int voxels = reach.size() * reach_of(y, ny).size() * reach_of(x, nx).size();
        error[at] = half_a_value * std::sqrt(sum / static_cast<float>(voxels));
      }
    });
    map.write_section(z, error);
  }
  map.close();
}

io::MrcSpec map_like(const io::MrcHeader& header, const std::string& what) {
  return {.nx = header.nx,
          .ny = header.ny,
          .nz = header.nz,
          .mode = io::MrcMode::kFloat32,
          .voxel_size_A = header.voxel_size_A,
          .origin_A = header.origin_A,
          .labels = {fmt::format("tomofield {}: {}", library_version(), what)}};
}

}  // namespace tomofield::evaluate
