#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <vector>

#include "distributed/communicator.h"
#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// Finds single pixels that differ from those around them in all views, by less than makes them
/// hot or dead in one view (masks/bad_pixels.h).
///
/// It averages over the views how far each pixel lies above those around it, in standard deviations
/// of this difference in its view. Noise and specimen fade in the mean, and the pixels that stand
/// alone in it are those of the detector. The sums are integers, so that they are the same for
/// any number of threads and processes. They take two images of memory.
class PixelPattern {
 public:
  PixelPattern(std::int64_t width, std::int64_t height);

  /// Takes in a view as recorded, unbinned. Thread-safe.
  void add(const MaskedImage& image);

  /// Returns the indices of the pixels. Pixels that were measured in fewer than half of the
  /// `num_views` views are left out. All processes must call.
  std::vector<std::size_t> find(std::size_t num_views, const distributed::Communicator& processes);

 private:
  void share(const distributed::Communicator& processes);

  std::int64_t width_, height_;
  std::mutex mutex_;
  std::vector<std::int32_t> sums_, counts_;
};

}  // namespace tomofield::tilt_series
