#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/enum_names.h"

struct kiss_fft_state;

namespace tomofield::baseline {

/// The factor of the ramp: 1, cos πf or cos² πf.
enum class RampWindow { kRamp, kCosine, kHann };

/// The roll-off of the ramp |f|, with f in cycles a pixel, 0.5 at most.
struct RampFilterOptions {
  RampWindow window = RampWindow::kHann;
  double cutoff = 0.5;    ///< end of the rise, cycles a pixel, as in IMOD's RADIAL
  double falloff = 0.05;  ///< σ of the Gaussian fall beyond it, cycles a pixel
};

/// Filters rows of a detector for back-projection. It is a linear convolution with the ramp of
/// band-limited rows (Kak and Slaney 1988, equation 3.61) and its roll-off; rows are zero outside.
class RampFilter {
 public:
  RampFilter(const RampFilterOptions& options, std::int64_t width);

  /// Filters the rows of a slab in one view, [x, lane] in place. Thread-safe.
  void apply(float* rays) const;
  /// Returns the response [length()] at frequencies i / length(). The second half holds the
  /// negative frequencies.
  const std::vector<float>& response() const { return response_; }
  int length() const { return length_; }

 private:
  using Plan = std::unique_ptr<kiss_fft_state, void (*)(kiss_fft_state*)>;

  std::int64_t width_;
  int length_;  // pixels of a padded row
  Plan forward_, inverse_;
  std::vector<float> response_;
};

}  // namespace tomofield::baseline

namespace tomofield::base {

template <>
struct EnumNames<baseline::RampWindow> {
  static constexpr std::array kNames{std::pair{baseline::RampWindow::kRamp, "ramp"},
                                     std::pair{baseline::RampWindow::kCosine, "cosine"},
                                     std::pair{baseline::RampWindow::kHann, "hann"}};
};

}  // namespace tomofield::base
