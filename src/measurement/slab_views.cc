#include "measurement/slab_views.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <string>
#include <vector>

#include "base/check.h"
#include "kernels/lanes.h"
#include "tomofield/error.h"

namespace tomofield::measurement {
namespace {

using kernels::kLanes;

void* map_scratch_file(const std::filesystem::path& dir, std::size_t bytes) {
  std::string name = (dir / "tomofield-rays-XXXXXX").string();
  const int fd = mkstemp(name.data());
  if (fd < 0) {
    throw Error(
        fmt::format("cannot make a scratch file in {} ({}): the prepared rays need {} bytes there",
                    dir.string(), std::strerror(errno), bytes));
  }
  unlink(name.c_str());
  void* memory = MAP_FAILED;
  int code = posix_fallocate(fd, 0, static_cast<off_t>(bytes));
  if (code == 0) {
    memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    code = errno;
  }
  close(fd);
  if (memory == MAP_FAILED) {
    throw Error(fmt::format(
        "cannot reserve {} bytes for the prepared rays in {} ({}): free some space there", bytes,
        dir.string(), std::strerror(code)));
  }
  return memory;
}

}  // namespace

// Of a line: the pixels of a slab's rows with one x.
constexpr std::size_t kRayBytes = kLanes * sizeof(float), kMaskBytes = sizeof(std::uint16_t);

std::size_t SlabViews::bytes(const Shape& shape) {
  const std::size_t slabs = static_cast<std::size_t>((shape.num_rows + kLanes - 1) / kLanes);
  const std::size_t lines = slabs * shape.num_views * static_cast<std::size_t>(shape.width);
  return lines * (kRayBytes + kMaskBytes);
}

std::size_t SlabViews::resident_memory(const Shape& shape, int slabs_in_use) {
  const std::size_t all = bytes(shape);
  if (all <= kInMemoryBytes) return all;
  Shape used = shape;
  used.num_rows = std::min<std::int64_t>(shape.num_rows, std::int64_t{slabs_in_use} * kLanes);
  return bytes(used);
}

SlabViews::Slabs SlabViews::all_slabs(const Shape& shape) {
  return {0, static_cast<int>((shape.num_rows + kLanes - 1) / kLanes)};
}

SlabViews::SlabViews(const Shape& shape, Slabs held, double unit, const ReadView& read_view,
                     const std::filesystem::path& scratch_dir, std::size_t in_memory_bytes)
    : shape_(shape), scratch_dir_(scratch_dir), held_(held) {
  bytes_ = num_lines() * (kRayBytes + kMaskBytes);
  is_in_file_ = bytes_ > in_memory_bytes;
  if (!is_in_file_) {
    memory_ = mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory_ == MAP_FAILED)
      throw Error(fmt::format("not enough memory for the rays: {} bytes", bytes_));
  } else {
    memory_ = map_scratch_file(scratch_dir, bytes_);
  }
  rays_ = static_cast<float*>(memory_);
  mask_ = reinterpret_cast<std::uint16_t*>(rays_ + num_lines() * kLanes);
  try {
    fill(unit, read_view);
  } catch (...) {
    munmap(memory_, bytes_);
    throw;
  }
}

SlabViews::~SlabViews() { munmap(memory_, bytes_); }

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

// Pages of the file stay in the kernel's cache as long as there is memory for them. What is not
// whole pages stays.
void SlabViews::release_bytes(std::size_t first, std::size_t count) const {
  if (!is_in_file_) return;
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  const std::size_t begin = (first + page - 1) / page * page, end = (first + count) / page * page;
  if (end > begin) madvise(static_cast<char*>(memory_) + begin, end - begin, MADV_DONTNEED);
}

void SlabViews::release(int slab) const {
  const std::size_t first = line(slab, 0), count = line(slab + 1, 0) - first;
  release_bytes(first * kRayBytes, count * kRayBytes);
  release_bytes(num_lines() * kRayBytes + first * kMaskBytes, count * kMaskBytes);
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
    release_bytes(0, bytes_);
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
    release_bytes(0, bytes_);
  };
  return std::make_unique<SlabViews>(coarse, held, bin, read_view, scratch_dir_);
}

std::unique_ptr<SlabViews> SlabViews::middle_rows(
    std::int64_t most_rows, std::span<const int> views,
    const distributed::Communicator& processes) const {
  const std::int64_t rows = std::min(most_rows, shape_.num_rows);
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

// Over the rays that count in a box, and how many do.
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
    const auto* words = reinterpret_cast<const std::uint32_t*>(static_cast<char*>(memory_) + at);
    for (std::size_t i = 0; i < size / sizeof(std::uint32_t); ++i)
      hash = (hash ^ words[i]) * 0x100000001b3ULL;
    release_bytes(at, size);
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
  add_all(ray_bytes, bytes_ - ray_bytes);
  return hash;
}

}  // namespace tomofield::measurement
