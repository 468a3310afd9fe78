#include "measurement/slab_views.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "base/check.h"
#include "base/threads/parallel.h"
#include "base/xxhash64.h"
#include "kernels/lanes.h"

namespace tomofield::measurement {

using base::Range;
using kernels::kLanes;

namespace {

// Bytes of a line: the pixels of a slab's rows with one x.
constexpr std::size_t kRayBytes = kLanes * sizeof(float), kMaskBytes = sizeof(std::uint16_t);

// Number of views that are read at a time, if their buffers take no more than this memory.
constexpr std::size_t kMaxBuffers = 64, kBufferBytes = std::size_t{1} << 30;

std::size_t buffer_bytes(const SlabViews::Shape& shape) {
  return static_cast<std::size_t>(shape.width * shape.height) *
         (sizeof(float) + sizeof(std::uint8_t));
}

int views_in_buffers(const SlabViews::Shape& shape) {
  const std::size_t fit = kBufferBytes / std::max<std::size_t>(buffer_bytes(shape), 1);
  return static_cast<int>(std::clamp<std::size_t>(fit, 1, kMaxBuffers));
}

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

std::size_t SlabViews::filling_memory(const Shape& shape) {
  const auto at_once = static_cast<std::size_t>(views_in_buffers(shape));
  return std::min(at_once, shape.num_views) * buffer_bytes(shape);
}

SlabViews::Slabs SlabViews::all_slabs(const Shape& shape) {
  return {0, static_cast<int>((shape.num_rows + kLanes - 1) / kLanes)};
}

ReadViews read_on_all_threads(ReadView read_view) {
  return [read = std::move(read_view)](Range views, std::span<ViewBuffer> buffers) {
    base::parallel_for("read views", views.size(), [&](std::int64_t i) {
      ViewBuffer& buffer = buffers[static_cast<std::size_t>(i)];
      read(static_cast<std::size_t>(views.begin + i), buffer.image, buffer.valid);
    });
  };
}

SlabViews::SlabViews(const Shape& shape, const Holding& holding,
                     const std::filesystem::path& scratch_dir, std::size_t in_memory_bytes)
    : shape_(shape),
      scratch_dir_(scratch_dir),
      holding_(holding),
      memory_(num_lines() * (kRayBytes + kMaskBytes), "the prepared rays", scratch_dir,
              in_memory_bytes),
      rays_(reinterpret_cast<const float*>(memory_.data())),
      mask_(reinterpret_cast<const std::uint16_t*>(rays_ + num_lines() * kLanes)) {}

SlabViews::SlabViews(const Shape& shape, const Holding& holding, double unit,
                     const ReadViews& read_views, const std::filesystem::path& scratch_dir,
                     std::size_t in_memory_bytes)
    : SlabViews(shape, holding, scratch_dir, in_memory_bytes) {
  fill(unit, read_views);
}

// Lines that are made before they are stored.
struct SlabViews::Lines {
  explicit Lines(std::size_t count) : rays(count * kLanes), mask(count) {}

  void set(std::size_t line, int lane, float value) {
    rays[line * kLanes + static_cast<std::size_t>(lane)] = value;
    mask[line] = static_cast<std::uint16_t>(mask[line] | 1u << lane);
  }

  void hide_where_hidden(const std::uint16_t* other) {
    for (std::size_t at = 0; at < mask.size(); ++at) {
      mask[at] = static_cast<std::uint16_t>(mask[at] & other[at]);
      for (std::size_t lane = 0; lane < kLanes; ++lane)
        if ((mask[at] >> lane & 1) == 0) rays[at * kLanes + lane] = 0.0f;
    }
  }

  void subtract(float value) {
    for (std::size_t at = 0; at < mask.size(); ++at)
      for (std::size_t lane = 0; lane < kLanes; ++lane)
        if (mask[at] >> lane & 1) rays[at * kLanes + lane] -= value;
  }

  std::vector<float> rays;
  std::vector<std::uint16_t> mask;
};

SlabViews::Lines SlabViews::copy(int slab, int view) const {
  Lines lines(static_cast<std::size_t>(shape_.width));
  std::copy_n(rays(slab, view), lines.rays.size(), lines.rays.begin());
  std::copy_n(mask(slab, view), lines.mask.size(), lines.mask.begin());
  return lines;
}

void SlabViews::store(std::size_t first_line, const Lines& lines) {
  memory_.write(first_line * kRayBytes, std::as_bytes(std::span(lines.rays)));
  memory_.write(num_lines() * kRayBytes + first_line * kMaskBytes,
                std::as_bytes(std::span(lines.mask)));
}

std::size_t SlabViews::num_lines() const {
  return static_cast<std::size_t>(holding_.all().size()) * shape_.num_views *
         static_cast<std::size_t>(shape_.width);
}

base::Range SlabViews::own_rows() const {
  return {own().begin * kLanes, static_cast<int>(std::min<std::int64_t>(
                                    std::int64_t{own().end} * kLanes, shape_.num_rows))};
}

int SlabViews::rows_of(int slab) const {
  return static_cast<int>(std::min<std::int64_t>(kRows, shape_.num_rows - slab * kRows));
}

std::size_t SlabViews::line(int slab, int view) const {
  return (static_cast<std::size_t>(slab - own().begin) * shape_.num_views +
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

// Reads some views at a time. The threads that work on a slab later write it here, which puts its
// memory near them.
void SlabViews::fill(double unit, const ReadViews& read_views) {
  const float per_unit = static_cast<float>(1.0 / unit);
  const int at_once = views_in_buffers(shape_), num_views = static_cast<int>(shape_.num_views);
  const auto pixels = static_cast<std::size_t>(shape_.width * shape_.height);
  for (int first = 0; first < num_views; first += at_once) {
    const Range views{first, std::min(first + at_once, num_views)};
    std::vector<ViewBuffer> buffers(static_cast<std::size_t>(views.size()));
    base::parallel_for("make buffers", std::ssize(buffers), [&](std::int64_t i) {
      buffers[static_cast<std::size_t>(i)] = {std::vector<float>(pixels),
                                              std::vector<std::uint8_t>(pixels)};
    });
    read_views(views, buffers);
    base::parallel_for("fill slabs", holding_.all().size(), [&](std::int64_t s) {
      const int slab = own().begin + static_cast<int>(s);
      base::parallel_for("fill views", views.size(), [&](std::int64_t v) {
        set_rows(slab, first + static_cast<int>(v), buffers[static_cast<std::size_t>(v)], per_unit);
      });
      release(slab);
    });
  }
}

void SlabViews::set_rows(int slab, int view, const ViewBuffer& from, float per_unit) {
  const auto width = static_cast<std::size_t>(shape_.width);
  Lines lines(width);
  for (int lane = 0; lane < rows_of(slab); ++lane) {
    const std::size_t row = static_cast<std::size_t>(shape_.first_row + slab * kRows + lane);
    for (std::size_t x = 0, at = row * width; x < width; ++x, ++at)
      if (from.valid[at]) lines.set(x, lane, from.image[at] * per_unit);
  }
  store(line(slab, view), lines);
}

SlabViews::Shape SlabViews::binned_shape(const Shape& shape, int bin) {
  const std::int64_t rows = (shape.num_rows + bin - 1) / bin;
  return {shape.num_views, (shape.width + bin - 1) / bin, rows, 0, rows};
}

std::unique_ptr<SlabViews> SlabViews::binned(int bin) const {
  const Slabs slabs{own().begin / bin, (own().end + bin - 1) / bin};
  std::unique_ptr<SlabViews> coarse(new SlabViews(binned_shape(shape_, bin), {slabs}, scratch_dir_,
                                                  io::ScratchMemory::kInMemoryBytes));
  base::parallel_for("bin slabs", slabs.size(), [&](std::int64_t s) {
    const int slab = slabs.begin + static_cast<int>(s);
    base::parallel_for("bin views", num_views(), [&](std::int64_t view) {
      coarse->set_means(slab, static_cast<int>(view), *this, bin);
    });
    coarse->release(slab);
    for (int fine = slab * bin; fine < std::min((slab + 1) * bin, own().end); ++fine) release(fine);
  });
  return coarse;
}

// Sets the rays of a slab of a view to means of `fine`, in units `bin` times as large.
void SlabViews::set_means(int slab, int view, const SlabViews& fine, int bin) {
  const float per_unit = static_cast<float>(1.0 / bin);
  Lines lines(static_cast<std::size_t>(shape_.width));
  std::vector<double> sums(static_cast<std::size_t>(shape_.width));
  std::vector<int> counts(sums.size());
  for (int lane = 0; lane < rows_of(slab); ++lane) {
    std::ranges::fill(sums, 0.0);
    std::ranges::fill(counts, 0);
    const std::int64_t first = (slab * kRows + lane) * bin;
    for (std::int64_t y = first; y < std::min(first + bin, fine.shape_.num_rows); ++y)
      fine.add_row(view, y, bin, sums, counts);
    for (std::size_t x = 0; x < sums.size(); ++x)
      if (2 * counts[x] >= bin * bin)
        lines.set(x, lane, static_cast<float>(sums[x] / counts[x]) * per_unit);
  }
  store(line(slab, view), lines);
}

// Adds the rays of a row that count to the sums of `bin` neighbours each, and counts them.
void SlabViews::add_row(int view, std::int64_t y, int bin, std::span<double> sums,
                        std::span<int> counts) const {
  const int slab = static_cast<int>(y / kRows), lane = static_cast<int>(y % kRows);
  const float* values = rays(slab, view) + lane;
  const std::uint16_t* masks = mask(slab, view);
  for (std::int64_t x = 0; x < shape_.width; ++x) {
    if ((masks[x] >> lane & 1) == 0) continue;
    const auto coarse = static_cast<std::size_t>(x / bin);
    sums[coarse] += static_cast<double>(values[x * kRows]);
    ++counts[coarse];
  }
}

std::unique_ptr<SlabViews> SlabViews::blank(std::size_t num_views) const {
  Shape shape = shape_;
  shape.num_views = num_views;
  return std::unique_ptr<SlabViews>(
      new SlabViews(shape, holding_, scratch_dir_, io::ScratchMemory::kInMemoryBytes));
}

void SlabViews::set_view(int view, std::span<const float> image) {
  const Slabs held = holding_.all();
  base::parallel_for("set view", held.size(), [&](std::int64_t i) {
    const int slab = held.begin + static_cast<int>(i);
    Lines lines(static_cast<std::size_t>(shape_.width));
    for (std::int64_t x = 0; x < shape_.width; ++x)
      for (int lane = 0; lane < rows_of(slab); ++lane)
        lines.set(static_cast<std::size_t>(x), lane,
                  image[static_cast<std::size_t>((slab * kRows + lane) * shape_.width + x)]);
    store(line(slab, view), lines);
  });
}

std::unique_ptr<SlabViews> SlabViews::rows(base::Range rows, std::span<const int> views,
                                           const distributed::Communicator& processes) const {
  const Shape shape{views.size(), shape_.width, rows.size(), 0, rows.size()};
  std::unique_ptr<SlabViews> part(
      new SlabViews(shape, {all_slabs(shape)}, scratch_dir_, io::ScratchMemory::kInMemoryBytes));
  base::parallel_for("copy rows", std::ssize(views), [&](std::int64_t view) {
    for (int slab = 0; slab < part->num_slabs(); ++slab)
      part->copy_rows(slab, static_cast<int>(view), *this, views[static_cast<std::size_t>(view)],
                      rows.begin);
  });
  part->share(processes);
  memory_.release(0, memory_.size());
  return part;
}

// Copies the own rows of `from`; the first row of all is `first_row` of `from`.
void SlabViews::copy_rows(int slab, int view, const SlabViews& from, int from_view,
                          std::int64_t first_row) {
  Lines lines(static_cast<std::size_t>(shape_.width));
  for (int lane = 0; lane < rows_of(slab); ++lane) {
    const std::int64_t y = first_row + slab * kRows + lane;
    if (y < from.own_rows().begin || y >= from.own_rows().end) continue;
    for (std::int64_t x = 0; x < shape_.width; ++x)
      if (from.counts(from_view, x, y))
        lines.set(static_cast<std::size_t>(x), lane, from.ray(from_view, x, y));
  }
  store(line(slab, view), lines);
}

// Gives the rays that any of the processes has to all of them.
void SlabViews::share(const distributed::Communicator& processes) {
  if (processes.size() == 1) return;
  for (int slab = own().begin; slab < own().end; ++slab) {
    for (int view = 0; view < num_views(); ++view) {
      Lines lines = copy(slab, view);
      processes.allreduce_sum(std::span(lines.rays));
      std::vector<std::int64_t> masks(lines.mask.begin(), lines.mask.end());
      processes.allreduce_sum(std::span(masks));  // no two have the same bit
      std::ranges::transform(masks, lines.mask.begin(),
                             [](std::int64_t mask) { return static_cast<std::uint16_t>(mask); });
      store(line(slab, view), lines);
    }
  }
}

std::int64_t SlabViews::num_valid(int view) const {
  std::int64_t count = 0;
  for (int slab = own().begin; slab < own().end; ++slab) {
    const std::uint16_t* m = mask(slab, view);
    for (std::int64_t x = 0; x < shape_.width; ++x) count += std::popcount(m[x]);
  }
  return count;
}

std::vector<double> SlabViews::masked_parts(const distributed::Communicator& processes) const {
  std::vector<std::int64_t> valid(shape_.num_views);
  base::parallel_for("count rays", std::ssize(valid), [&](std::int64_t view) {
    valid[static_cast<std::size_t>(view)] = num_valid(static_cast<int>(view));
  });
  processes.allreduce_sum(std::span(valid));
  const auto num_rays = static_cast<double>(shape_.width * shape_.num_rows);
  std::vector<double> masked;
  for (const std::int64_t n : valid) masked.push_back(1.0 - static_cast<double>(n) / num_rays);
  return masked;
}

void SlabViews::hide(std::span<const std::vector<tilt_series::MaskDisc>> discs) {
  const Slabs held = holding_.all();
  base::parallel_for("hide discs", std::ssize(discs), [&](std::int64_t view) {
    for (const tilt_series::MaskDisc& disc : discs[static_cast<std::size_t>(view)]) {
      tilt_series::for_pixels_in(disc, shape_.width, shape_.num_rows,
                                 [&](std::int64_t x, std::int64_t y) {
                                   const auto slab = static_cast<int>(y / kRows);
                                   if (slab >= held.begin && slab < held.end)
                                     clear_ray(static_cast<int>(view), x, y);
                                 });
    }
  });
  memory_.release(0, memory_.size());
}

void SlabViews::hide_where_hidden(const SlabViews& other) {
  const Slabs held = holding_.all();
  TOMOFIELD_CHECK(other.num_lines() == num_lines(), "the same shape and slabs");
  base::parallel_for("hide rays", held.size(), [&](std::int64_t i) {
    const int slab = held.begin + static_cast<int>(i);
    for (int view = 0; view < num_views(); ++view) {
      Lines lines = copy(slab, view);
      lines.hide_where_hidden(other.mask(slab, view));
      store(line(slab, view), lines);
    }
    release(slab);
    other.release(slab);
  });
}

void SlabViews::subtract(float value) {
  const Slabs held = holding_.all();
  base::parallel_for("subtract from rays", held.size(), [&](std::int64_t i) {
    const int slab = held.begin + static_cast<int>(i);
    for (int view = 0; view < num_views(); ++view) {
      Lines lines = copy(slab, view);
      lines.subtract(value);
      store(line(slab, view), lines);
    }
    release(slab);
  });
}

void SlabViews::clear_ray(int view, std::int64_t x, std::int64_t y) {
  const std::size_t at = line(static_cast<int>(y / kRows), view) + static_cast<std::size_t>(x);
  const auto lane = static_cast<std::size_t>(y % kRows);
  const auto mask = static_cast<std::uint16_t>(mask_[at] & ~(1u << lane));
  if (mask == mask_[at]) return;  // its ray is 0
  const float zero = 0.0f;
  memory_.write((at * kRows + lane) * sizeof(float), std::as_bytes(std::span(&zero, 1)));
  memory_.write(num_lines() * kRayBytes + at * kMaskBytes, std::as_bytes(std::span(&mask, 1)));
}

std::uint64_t SlabViews::checksum_of(int slab) const {
  const std::size_t lines = line(slab + 1, 0) - line(slab, 0);
  base::Xxhash64 hash;
  hash.add(std::as_bytes(std::span(rays(slab, 0), lines * kLanes)));
  hash.add(std::as_bytes(std::span(mask(slab, 0), lines)));
  release(slab);
  return hash.value();
}

std::uint64_t SlabViews::checksum(const distributed::Communicator& processes) const {
  std::vector<std::int64_t> of_slab(static_cast<std::size_t>(num_slabs()));
  base::parallel_for("checksum", own().size(), [&](std::int64_t s) {
    const int slab = own().begin + static_cast<int>(s);
    of_slab[static_cast<std::size_t>(slab)] = static_cast<std::int64_t>(checksum_of(slab));
  });
  processes.allreduce_sum(std::span(of_slab));
  return base::xxhash64(std::as_bytes(std::span<const std::int64_t>(of_slab)));
}

}  // namespace tomofield::measurement
