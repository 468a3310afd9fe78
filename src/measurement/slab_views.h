#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <utility>

#include "base/range.h"
#include "distributed/communicator.h"
#include "kernels/lanes.h"

namespace tomofield::measurement {

/// Reads a view as height × width floats and which pixels are measurements. Called for the views
/// in order.
using ReadView =
    std::function<void(std::size_t view, std::span<float> image, std::span<std::uint8_t> valid)>;

/// The measured rays in the order in which slabs use them: [slab, view, x, lane]
/// with 16 rows a slab, and a bit mask [slab, view, x] of the rays that count
/// (rows past the last one are masked). Large series lie in an unlinked file
/// in `scratch_dir` that the kernel pages; small ones in memory. Of a job of several
/// processes each holds some of the slabs alone.
class SlabViews {
 public:
  using Slabs = base::Range;
  struct Shape {
    std::size_t num_views = 0;
    std::int64_t width = 0, height = 0;        ///< of a view
    std::int64_t first_row = 0, num_rows = 0;  ///< rows of the view that slabs cover
  };
  /// Up to here a series is kept in memory: a 1K series of 60 views is 250 MB.
  static constexpr std::size_t kInMemoryBytes = std::size_t{1} << 30;
  /// Memory that they take while so many slabs are in use: of large series, what has not been
  /// released.
  static std::size_t resident_memory(const Shape& shape, int slabs_in_use);
  static Slabs all_slabs(const Shape& shape);

  /// Intensities are divided by `unit`. Throws Error if the scratch file cannot be made.
  SlabViews(const Shape& shape, double unit, const ReadView& read_view,
            const std::filesystem::path& scratch_dir, std::size_t in_memory_bytes = kInMemoryBytes)
      : SlabViews(shape, all_slabs(shape), unit, read_view, scratch_dir, in_memory_bytes) {}
  /// Some slabs of it, at least one; others must not be asked for.
  SlabViews(const Shape& shape, Slabs held, double unit, const ReadView& read_view,
            const std::filesystem::path& scratch_dir, std::size_t in_memory_bytes = kInMemoryBytes);
  ~SlabViews();
  SlabViews(const SlabViews&) = delete;
  SlabViews& operator=(const SlabViews&) = delete;

  /// Means over bin × bin pixels, from the first column and row on, in units `bin` times
  /// as large, as rays count pixels; coarse pixels that at least half of their pixels
  /// count for count. Columns and rows of fewer than `bin` are coarse ones too.
  std::unique_ptr<SlabViews> binned(int bin) const;
  /// A copy of so many rows in the middle, or of all if there are fewer, of these views, on every
  /// process: each of those that hold some of the slabs contributes what it has.
  std::unique_ptr<SlabViews> middle_rows(
      std::int64_t most_rows, std::span<const int> views,
      const distributed::Communicator& processes = distributed::Communicator::alone()) const;
  /// The shape of `binned` ones.
  static Shape binned_shape(const Shape& shape, int bin);

  const Shape& shape() const { return shape_; }
  int num_slabs() const { return all_slabs(shape_).end; }
  Slabs held() const { return held_; }
  const float* rays(int slab, int view) const;          ///< [x, lane]
  const std::uint16_t* mask(int slab, int view) const;  ///< [x], bit = lane
  /// Those of a large series leave the process's memory until they are used again.
  void release(int slab) const;
  /// Whether the ray of a pixel counts, and its value; y is counted from the first row.
  bool counts(int view, std::int64_t x, std::int64_t y) const {
    return mask(static_cast<int>(y / kRows), view)[x] >> (y % kRows) & 1;
  }
  float ray(int view, std::int64_t x, std::int64_t y) const {
    return rays(static_cast<int>(y / kRows), view)[x * kRows + y % kRows];
  }
  /// Rays that count in a view, of the slabs that are held.
  std::int64_t num_valid(int view) const;
  /// 64-bit FNV-1a over rays and masks, of all slabs, each held by one of the processes in
  /// order: tells one series from another.
  std::uint64_t checksum(
      const distributed::Communicator& processes = distributed::Communicator::alone()) const;

 private:
  static constexpr std::int64_t kRows = kernels::kLanes;  // of a slab
  std::pair<double, int> box_sum(int view, std::int64_t x0, std::int64_t y0, int size) const;
  static std::size_t bytes(const Shape& shape);
  void fill(double unit, const ReadView& read_view);
  void release_bytes(std::size_t first, std::size_t count) const;
  void add_words(std::size_t first, std::size_t count, std::uint64_t& hash) const;
  std::size_t line(int slab, int view) const;
  std::size_t num_lines() const;  // of a pixel in x: rays of a slab
  base::Range held_rows() const;

  Shape shape_;
  std::filesystem::path scratch_dir_;
  Slabs held_;
  std::size_t bytes_ = 0;
  bool is_in_file_ = false;
  void* memory_ = nullptr;
  float* rays_ = nullptr;
  std::uint16_t* mask_ = nullptr;
};

}  // namespace tomofield::measurement
