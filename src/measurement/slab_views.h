#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "base/range.h"
#include "distributed/communicator.h"
#include "io/saving/scratch_memory.h"
#include "kernels/lanes.h"
#include "tilt_series/masks/mask_metrics.h"

namespace tomofield::measurement {

/// Copies a view as height × width floats, and which pixels are measurements (0: not). It is called
/// for several views at once, on different threads.
using ReadView =
    std::function<void(std::size_t view, std::span<float> image, std::span<std::uint8_t> valid)>;

/// A view that is being read: height × width pixels, zeros at first.
struct ViewBuffer {
  std::vector<float> image;
  std::vector<std::uint8_t> valid;
};
/// Reads some views into as many buffers. It is called for all views in order, in the thread that
/// makes the SlabViews.
using ReadViews = std::function<void(base::Range views, std::span<ViewBuffer> buffers)>;
/// Returns a function that reads each view with `read_view`, on all threads.
ReadViews read_on_all_threads(ReadView read_view);

/// The measured rays in the order in which slabs use them: [slab, view, x, lane]
/// with 16 rows a slab, and a bit mask [slab, view, x] of the rays that count
/// (rows past the last one are masked). Small series lie in memory, large ones in a scratch file
/// (io/saving/scratch_memory.h). Each process of a job holds some of the slabs.
class SlabViews {
 public:
  using Slabs = base::Range;
  struct Shape {
    std::size_t num_views = 0;
    std::int64_t width = 0, height = 0;        ///< of a view
    std::int64_t first_row = 0, num_rows = 0;  ///< rows of the view that slabs cover
  };
  /// Returns the memory that views take while `slabs_in_use` slabs are in use. Of a series in a
  /// scratch file, only what has not been released takes memory.
  static std::size_t resident_memory(const Shape& shape, int slabs_in_use);
  /// Returns the memory of the buffers into which views are read.
  static std::size_t filling_memory(const Shape& shape);
  static Slabs all_slabs(const Shape& shape);
  /// Returns the bytes of the rays and their masks.
  static std::size_t bytes(const Shape& shape);

  /// Reads every view and divides its intensities by `unit`. This and all that makes or changes
  /// views throws Error if the scratch file cannot be made or written.
  SlabViews(const Shape& shape, double unit, ReadView read_view,
            const std::filesystem::path& scratch_dir,
            std::size_t in_memory_bytes = io::ScratchMemory::kInMemoryBytes)
      : SlabViews(shape, {all_slabs(shape)}, unit, read_on_all_threads(std::move(read_view)),
                  scratch_dir, in_memory_bytes) {}
  /// The slabs that a process holds: at least one of its own, which no other process has for its
  /// own, and perhaps the next ones.
  struct Holding {
    Slabs own;
    int num_next = 0;
    Slabs all() const { return {own.begin, own.end + num_next}; }
  };
  /// Keeps some of the slabs; others must not be asked for.
  SlabViews(const Shape& shape, const Holding& holding, double unit, const ReadViews& read_views,
            const std::filesystem::path& scratch_dir,
            std::size_t in_memory_bytes = io::ScratchMemory::kInMemoryBytes);
  SlabViews(const SlabViews&) = delete;
  SlabViews& operator=(const SlabViews&) = delete;

  /// Returns means over bin × bin pixels, from the first column and row on, in units `bin` times
  /// as large, as rays count pixels. A coarse pixel counts if at least half of its pixels do.
  /// Columns and rows of fewer than `bin` pixels are coarse ones too.
  std::unique_ptr<SlabViews> binned(int bin) const;
  /// Returns a copy of some rows, counted from the first one, of these views, on every process.
  /// Each process contributes its own slabs.
  std::unique_ptr<SlabViews> rows(
      base::Range rows, std::span<const int> views,
      const distributed::Communicator& processes = distributed::Communicator::alone()) const;
  /// Returns zeros in the place of `num_views` views, none of which counts, in the same slabs.
  std::unique_ptr<SlabViews> blank(std::size_t num_views) const;
  /// Returns the shape of binned views.
  static Shape binned_shape(const Shape& shape, int bin);

  const Shape& shape() const { return shape_; }
  int num_slabs() const { return all_slabs(shape_).end; }
  Slabs own() const { return holding_.own; }
  const float* rays(int slab, int view) const;          ///< [x, lane]
  const std::uint16_t* mask(int slab, int view) const;  ///< [x], bit = lane
  /// Removes a slab in a scratch file from the process's memory until it is used again.
  void release(int slab) const;
  /// Returns true if the ray of a pixel counts; y is counted from the first row.
  bool counts(int view, std::int64_t x, std::int64_t y) const {
    return mask(static_cast<int>(y / kRows), view)[x] >> (y % kRows) & 1;
  }
  /// Returns the ray of a pixel; y is counted from the first row.
  float ray(int view, std::int64_t x, std::int64_t y) const {
    return rays(static_cast<int>(y / kRows), view)[x * kRows + y % kRows];
  }
  /// Counts the rays of a view that count, in the own slabs.
  std::int64_t num_valid(int view) const;
  /// Returns the part of each view's rays that does not count, of all processes.
  std::vector<double> masked_parts(
      const distributed::Communicator& processes = distributed::Communicator::alone()) const;
  /// Sets all rays of a view, in all slabs that this process holds, and lets them count. `image` is
  /// [y, x], from the first row on.
  void set_view(int view, std::span<const float> image);
  /// Masks the rays of the pixels whose centres lie in the discs of their view, in all slabs that
  /// this process holds. `discs` are [view], in pixels, with y from the first row.
  void hide(std::span<const std::vector<tilt_series::MaskDisc>> discs);
  /// Masks the rays that do not count in `other`, which has the same shape and slabs.
  void hide_where_hidden(const SlabViews& other);
  /// Subtracts a value from all rays that count, in all slabs that this process holds.
  void subtract(float value);
  /// Returns a hash of rays and masks of all slabs (XXH64 of the XXH64 of each slab), which tells
  /// one series from another.
  std::uint64_t checksum(
      const distributed::Communicator& processes = distributed::Communicator::alone()) const;

 private:
  static constexpr std::int64_t kRows = kernels::kLanes;  // of a slab
  // Makes slabs of zeros.
  SlabViews(const Shape& shape, const Holding& holding, const std::filesystem::path& scratch_dir,
            std::size_t in_memory_bytes);
  void fill(double unit, const ReadViews& read_views);
  void set_rows(int slab, int view, const ViewBuffer& from, float per_unit);
  void set_means(int slab, int view, const SlabViews& fine, int bin);
  void copy_rows(int slab, int view, const SlabViews& from, int from_view, std::int64_t first_row);
  struct Lines;
  Lines copy(int slab, int view) const;
  void store(std::size_t first_line, const Lines& lines);
  void add_row(int view, std::int64_t y, int bin, std::span<double> sums,
               std::span<int> counts) const;
  void share(const distributed::Communicator& processes);
  void clear_ray(int view, std::int64_t x, std::int64_t y);
  std::uint64_t checksum_of(int slab) const;
  int rows_of(int slab) const;
  int num_views() const { return static_cast<int>(shape_.num_views); }
  std::size_t line(int slab, int view) const;
  std::size_t num_lines() const;  // each has one x of a slab and a view
  base::Range own_rows() const;

  Shape shape_;
  std::filesystem::path scratch_dir_;
  Holding holding_;
  io::ScratchMemory memory_;
  const float* rays_;
  const std::uint16_t* mask_;
};

}  // namespace tomofield::measurement
