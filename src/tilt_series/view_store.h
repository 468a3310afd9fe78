#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "io/saving/scratch_memory.h"
#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// Decoded views of one size, [view, y, x] floats with NaN where there is no measurement. They lie
/// in memory or, if they are large, in a scratch file. Different views may be written, read and
/// discarded by different threads at once.
class ViewStore {
 public:
  /// Makes room for `capacity` of the `num_views` views of a series. Throws Error if there is none
  /// (io/saving/scratch_memory.h).
  ViewStore(std::size_t num_views, std::size_t capacity, std::int64_t width, std::int64_t height,
            const std::filesystem::path& scratch_dir);

  /// Throws Error if the scratch file cannot be written.
  void write(std::size_t view, const MaskedImage& image);
  /// Returns true if a view was written and not discarded.
  bool holds(std::size_t view) const { return place_[view] != kNowhere; }
  /// Returns a view that the store holds.
  MaskedImage read(std::size_t view) const;
  /// Gives up a view that the store holds.
  void discard(std::size_t view);

  /// Returns the bytes of memory that a store of `capacity` views takes.
  static std::size_t resident_memory(std::size_t capacity, std::int64_t width, std::int64_t height);

 private:
  static constexpr std::size_t kNowhere = static_cast<std::size_t>(-1);
  std::size_t view_bytes() const;

  std::int64_t width_, height_;
  std::vector<std::size_t> place_;     // of each view in the memory, in bytes
  std::atomic<std::size_t> used_ = 0;  // bytes
  io::ScratchMemory memory_;
};

}  // namespace tomofield::tilt_series
