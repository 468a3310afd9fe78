#include "measurement/slab_views.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <vector>

#include "base/check.h"
#include "kernels/lanes.h"
#include "tomofield/error.h"

namespace tomofield::measurement {

using base::Range;
using kernels::kLanes;

namespace {

// Bytes of a line: the pixels of a slab's rows with one x.
constexpr std::size_t kRayBytes = kLanes * sizeof(float), kMaskBytes = sizeof(std::uint16_t);

}  // namespace

std::size_t SlabViews::bytes(const Shape& shape) {
  const std::size_t slabs = static_cast<std::size_t>((shape.num_rows + kLanes - 1) / kLanes);
  const std::size_t lines = slabs * shape.num_views * static_cast<std::size_t>(shape.width);
  return lines * (kRayBytes + kMaskBytes);
}

std::size_t SlabViews::resident_memory(const Shape& shape, int slabs_in_use) {
  const std::size_t all = bytes(shape);
  if (all <= io::ScratchMemory::kInMemoryBytes) return all;
  Shape used = shape;
  used.num_rows = std::min<std::int64_t>(shape.num_rows, std::int64_t{slabs_in_use} * kLanes);
  return bytes(used);
}

SlabViews::Slabs SlabViews::all_slabs(const Shape& shape) {
  return {0, static_cast<int>((shape.num_rows + kLanes - 1) / kLanes)};
}

SlabViews::SlabViews(const Shape& shape, Slabs held, double unit, const ReadView& read_view,
                     const std::filesystem::path& scratch_dir, std::size_t in_memory_bytes)
    : shape_(shape),
      scratch_dir_(scratch_dir),
      held_(held),
      memory_(num_lines() * (kRayBytes + kMaskBytes), "the prepared rays", scratch_dir,
              in_memory_bytes),
      rays_(reinterpret_cast<float*>(memory_.data())),
      mask_(reinterpret_cast<std::uint16_t*>(rays_ + num_lines() * kLanes)) {
  fill(unit, read_view);
}

std::size_t SlabViews::num_lines() const {
  return static_cast<std::size_t>(held_.size()) * shape_.num_views *
         static_cast<std::size_t>(shape_.width);
}

base::Range SlabViews::held_rows() const {
  return {held_.begin * kLanes, static_cast<int>(std::min<std::int64_t>(
                                    std::int64_t{held_.end} * kLanes, shape_.num_rows))};
}

std::size_t SlabViews::line(int slab, int view) const {
  return (static_cast<std::size_t>(slab - held_.begin) * shape_.num_views +
          static_cast<std::size_t>(view)) *
         static_cast<std::size_t>(shape_.width);
}

const float* SlabViews::rays(int slab, int view) const { return rays_ + line(slab, view) * kLanes; }
const std::uint16_t* SlabViews::mask(int slab, int view) const { return mask_ + line(slab, view); }

void SlabViews::release(int slab) const {
  const std::size_t first = line(slab, 0), count = line(slab + 1, 0) - first;
  memory_.release(first * kRayBytes, count * kRayBytes);
  memory_.release(num_lines() * kRayBytes + first * kMaskBytes, count * kMaskBytes);
}

void SlabViews::fill(double unit, const ReadView& read_view) {
  const std::size_t width = static_cast<std::size_t>(shape_.width);
  const std::size_t pixels = width * static_cast<std::size_t>(shape_.height);
  std::vector<float> image(pixels);
  std::vector<std::uint8_t> valid(pixels);
  const float per_unit = static_cast<float>(1.0 / unit);
  for (std::size_t v = 0; v < shape_.num_views; ++v) {
    read_view(v, image, valid);
    for (std::int64_t row = held_rows().begin; row < held_rows().end; ++row) {
      const std::size_t first = static_cast<std::size_t>(shape_.first_row + row) * width;
      const std::size_t to = line(static_cast<int>(row / kLanes), static_cast<int>(v));
      const int lane = static_cast<int>(row % kLanes);
      for (std::size_t x = 0; x < width; ++x) {
        if (!valid[first + x]) continue;
        rays_[(to + x) * kLanes + static_cast<std::size_t>(lane)] = image[first + x] * per_unit;
        mask_[to + x] = static_cast<std::uint16_t>(mask_[to + x] | 1u << lane);
      }
    }
    memory_.release(0, memory_.size());
  }
}

SlabViews::Shape SlabViews::binned_shape(const Shape& shape, int bin) {
  const std::int64_t rows = (shape.num_rows + bin - 1) / bin;
  return {shape.num_views, (shape.width + bin - 1) / bin, rows, 0, rows};
}

std::unique_ptr<SlabViews> SlabViews::binned(int bin) const {
  const Shape coarse = binned_shape(shape_, bin);
  const Slabs held{held_.begin / bin, (held_.end + bin - 1) / bin};
  const auto read_view = [&](std::size_t v, std::span<float> image, std::span<std::uint8_t> valid) {
    const int view = static_cast<int>(v);
    const std::int64_t end = std::min<std::int64_t>(held.end * kLanes, coarse.height);
    for (std::int64_t y = held.begin * kLanes; y < end; ++y) {
      for (std::int64_t x = 0; x < coarse.width; ++x) {
        const std::size_t at = static_cast<std::size_t>(y * coarse.width + x);
        const auto [sum, count] = box_sum(view, x * bin, y * bin, bin);
        valid[at] = 2 * count >= bin * bin;
        image[at] = valid[at] ? static_cast<float>(sum / count) : 0.0f;
      }
    }
    memory_.release(0, memory_.size());
  };
  return std::make_unique<SlabViews>(coarse, held, bin, read_view, scratch_dir_);
}

std::unique_ptr<SlabViews> SlabViews::middle_rows(
    std::int64_t max_rows, std::span<const int> views,
    const distributed::Communicator& processes) const {
  const std::int64_t rows = std::min(max_rows, shape_.num_rows);
  const std::int64_t first = (shape_.num_rows - rows) / 2;
  const auto read_view = [&](std::size_t v, std::span<float> image, std::span<std::uint8_t> valid) {
    const int view = views[v];
    std::fill(image.begin(), image.end(), 0.0f);
    std::vector<float> is_valid(image.size());
    for (std::int64_t y = 0; y < rows; ++y) {
      if (first + y < held_rows().begin || first + y >= held_rows().end) continue;
      for (std::int64_t x = 0; x < shape_.width; ++x) {
        const auto at = static_cast<std::size_t>(y * shape_.width + x);
        image[at] = ray(view, x, first + y);
        is_valid[at] = counts(view, x, first + y);
      }
    }
    processes.allreduce_sum(image);
    processes.allreduce_sum(std::span(is_valid));
    std::ranges::copy(is_valid, valid.begin());
  };
  const Shape shape{views.size(), shape_.width, rows, 0, rows};
  return std::make_unique<SlabViews>(shape, 1.0, read_view, scratch_dir_);
}

// Returns the sum of the rays that count in a box, and how many do.
std::pair<double, int> SlabViews::box_sum(int view, std::int64_t x0, std::int64_t y0,
                                          int size) const {
  double sum = 0.0;
  int count = 0;
  for (std::int64_t y = y0; y < std::min(y0 + size, shape_.num_rows); ++y) {
    for (std::int64_t x = x0; x < std::min(x0 + size, shape_.width); ++x) {
      if (!counts(view, x, y)) continue;
      sum += static_cast<double>(ray(view, x, y));
      ++count;
    }
  }
  return {sum, count};
}

std::int64_t SlabViews::num_valid(int view) const {
  std::int64_t count = 0;
  for (int slab = held_.begin; slab < held_.end; ++slab) {
    const std::uint16_t* m = mask(slab, view);
    for (std::int64_t x = 0; x < shape_.width; ++x) count += std::popcount(m[x]);
  }
  return count;
}

void SlabViews::add_words(std::size_t first, std::size_t count, std::uint64_t& hash) const {
  constexpr std::size_t kBlock = std::size_t{16} << 20;
  for (std::size_t at = first; at < first + count; at += kBlock) {
    const std::size_t size = std::min(kBlock, first + count - at);
    const auto* words = reinterpret_cast<const std::uint32_t*>(memory_.data() + at);
    for (std::size_t i = 0; i < size / sizeof(std::uint32_t); ++i)
      hash = (hash ^ words[i]) * 0x100000001b3ULL;
    memory_.release(at, size);
  }
}

std::uint64_t SlabViews::checksum(const distributed::Communicator& processes) const {
  std::uint64_t hash = 0xcbf29ce484222325ULL;
  // The bytes of all slabs as one process would have them: every process goes on where the
  // one before it ended. Only the last may hold an odd number of slabs, and half a word.
  TOMOFIELD_CHECK(held_.end == num_slabs() || held_.size() % 2 == 0, "slabs are held in pairs");
  const auto add_all = [&](std::size_t first, std::size_t count) {
    for (int rank = 0; rank < processes.size(); ++rank) {
      std::int64_t state = 0;
      if (rank == processes.rank()) {
        add_words(first, count, hash);
        state = static_cast<std::int64_t>(hash);
      }
      processes.allreduce_sum(std::span(&state, 1));
      if (processes.size() > 1) hash = static_cast<std::uint64_t>(state);
    }
  };
  const std::size_t ray_bytes = num_lines() * kRayBytes;
  add_all(0, ray_bytes);
  add_all(ray_bytes, num_lines() * kMaskBytes);
  return hash;
}

Range own_bands(std::int64_t num_rows, std::int64_t band_rows,
                const distributed::Communicator& processes) {
  std::vector<double> rows_of_band;
  for (std::int64_t row = 0; row < num_rows; row += band_rows)
    rows_of_band.push_back(static_cast<double>(std::min(band_rows, num_rows - row)));
  const std::ptrdiff_t num_bands = std::ssize(rows_of_band);
  if (num_bands < processes.size()) {
    throw Error(fmt::format(
        "{} processes cannot share {} rows of root cells ({} rows of pixels each): start at most "
        "{}, or give --leaf-size 16, whose root cells have 32 rows",
        processes.size(), num_bands, band_rows, num_bands));
  }
  return distributed::part_of(rows_of_band, processes.rank(), processes.size());
}

Range slabs_of_bands(Range bands, std::int64_t band_rows, std::int64_t num_rows) {
  const auto slab_at = [&](int band) {
    const std::int64_t row = std::min(band * band_rows, num_rows);
    return static_cast<int>((row + kLanes - 1) / kLanes);
  };
  return {slab_at(bands.begin), slab_at(bands.end)};
}

}  // namespace tomofield::measurement
