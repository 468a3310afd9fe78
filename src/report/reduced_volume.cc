#include "report/reduced_volume.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/threads/parallel.h"

namespace tomofield::report {
namespace {

constexpr std::int64_t kChunkValues = std::int64_t{1} << 18;
constexpr double kLongestSide = 4096;

// An interval [begin, end) of voxels along one axis, of which the first and the last may count in
// part.
struct Cover {
  double begin, end;
  std::int64_t first() const { return static_cast<std::int64_t>(begin); }
  std::int64_t last() const { return static_cast<std::int64_t>(std::ceil(end)) - 1; }
  /// Returns the part of the interval that lies in voxel i.
  double weight(std::int64_t i) const {
    const auto low = static_cast<double>(i);
    return (std::min(end, low + 1) - std::max(begin, low)) / (end - begin);
  }
};

// Returns what each of `reduced` voxels covers of `size` voxels. Rounding moves no end beyond the
// last voxel.
std::vector<Cover> covers(std::int64_t size, std::int64_t reduced) {
  const double factor = static_cast<double>(size) / static_cast<double>(reduced);
  std::vector<Cover> all;
  for (std::int64_t i = 0; i < reduced; ++i) {
    const auto at = static_cast<double>(i);
    all.push_back({at * factor, std::min((at + 1) * factor, static_cast<double>(size))});
  }
  return all;
}

// Adds a row, reduced along x, to another one.
void add_reduced_row(std::span<const float> row, const std::vector<Cover>& x, double weight,
                     float* sum) {
  for (std::size_t i = 0; i < x.size(); ++i) {
    double mean = 0;
    for (std::int64_t column = x[i].first(); column <= x[i].last(); ++column) {
      const float value = row[static_cast<std::size_t>(column)];
      if (std::isfinite(value)) mean += x[i].weight(column) * static_cast<double>(value);
    }
    sum[i] += static_cast<float>(weight * mean);
  }
}

// Calls `use` with each row of a section.
template <typename Use>
void for_each_row(const io::MrcReader& volume, std::int64_t section, std::vector<float>& buffer,
                  Use&& use) {
  const io::MrcHeader& h = volume.header();
  const auto nx = static_cast<std::size_t>(h.nx);
  const std::int64_t chunk = std::clamp<std::int64_t>(kChunkValues / h.nx, 1, h.ny);
  buffer.resize(static_cast<std::size_t>(chunk) * nx);
  for (std::int64_t y = 0; y < h.ny; y += chunk) {
    const std::int64_t count = std::min(chunk, h.ny - y);
    const std::span rows = std::span(buffer).first(static_cast<std::size_t>(count) * nx);
    volume.read_rows(section, y, count, rows);
    for (std::int64_t i = 0; i < count; ++i)
      use(y + i, std::span<const float>(rows.subspan(static_cast<std::size_t>(i) * nx, nx)));
  }
}

}  // namespace

std::array<std::int64_t, 3> reduced_size(const io::MrcHeader& header, std::int64_t most_voxels) {
  const std::array<std::int64_t, 3> size{header.nx, header.ny, header.nz};
  const double voxels = static_cast<double>(header.nx) * static_cast<double>(header.ny) *
                        static_cast<double>(header.nz);
  const double longest = static_cast<double>(*std::ranges::max_element(size));
  const double factor =
      std::max({1.0, std::cbrt(voxels / static_cast<double>(most_voxels)), longest / kLongestSide});
  std::array<std::int64_t, 3> reduced{};
  for (std::size_t a = 0; a < 3; ++a)
    reduced[a] =
        std::max<std::int64_t>(1, static_cast<std::int64_t>(static_cast<double>(size[a]) / factor));
  return reduced;
}

void reduce_volume(const io::MrcReader& volume, const std::array<std::int64_t, 3>& size,
                   const SectionSink& sink) {
  const io::MrcHeader& h = volume.header();
  TOMOFIELD_CHECK(size[0] <= h.nx && size[1] <= h.ny && size[2] <= h.nz,
                  "a reduced volume is not larger");
  const std::vector<Cover> x = covers(h.nx, size[0]), y = covers(h.ny, size[1]),
                           z = covers(h.nz, size[2]);
  const auto width = static_cast<std::size_t>(size[0]);
  base::parallel_for("reduce volume", size[2], [&](std::int64_t section) {
    std::vector<float> buffer, sum(width * y.size());
    const Cover& depth = z[static_cast<std::size_t>(section)];
    for (std::int64_t s = depth.first(); s <= depth.last(); ++s) {
      std::size_t row_of_sum = 0;  // the first that the row of the section belongs to
      for_each_row(volume, s, buffer, [&](std::int64_t row, std::span<const float> values) {
        while (y[row_of_sum].last() < row) ++row_of_sum;
        for (std::size_t r = row_of_sum; r < y.size() && y[r].first() <= row; ++r)
          add_reduced_row(values, x, depth.weight(s) * y[r].weight(row), &sum[r * width]);
      });
    }
    sink(section, sum);
  });
}

std::vector<float> sample_voxels(const io::MrcReader& volume) {
  constexpr std::int64_t kSections = 32;
  constexpr std::size_t kMostVoxels = std::size_t{1} << 22;
  const io::MrcHeader& h = volume.header();
  const std::int64_t sections = std::min(h.nz, kSections);
  const std::size_t stride =
      static_cast<std::size_t>(h.nx * h.ny) * static_cast<std::size_t>(sections) / kMostVoxels + 1;
  std::vector<std::vector<float>> of_section(static_cast<std::size_t>(sections));
  base::parallel_for("sample voxels", sections, [&](std::int64_t i) {
    std::vector<float> buffer;
    std::vector<float>& sample = of_section[static_cast<std::size_t>(i)];
    std::size_t skip = 0;  // values of the next row before the next of the sample
    for_each_row(volume, (2 * i + 1) * h.nz / (2 * sections), buffer,
                 [&](std::int64_t, std::span<const float> row) {
                   std::size_t x = skip;
                   for (; x < row.size(); x += stride)
                     if (std::isfinite(row[x])) sample.push_back(row[x]);
                   skip = x - row.size();
                 });
  });
  std::vector<float> all;
  for (const auto& sample : of_section) all.insert(all.end(), sample.begin(), sample.end());
  return all;
}

}  // namespace tomofield::report
