#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

struct kiss_fft_state;

namespace tomofield::baseline {

/// The roll-off of the ramp |f|, with f in cycles a pixel, 0.5 at most.
struct RampFilterOptions {
  std::string window = "hann";  ///< the factor: 1 (ramp), cos πf (cosine) or cos² πf (hann)
  double cutoff = 0.5;          ///< end of the rise, cycles a pixel, as in IMOD's RADIAL
  double falloff = 0.05;        ///< σ of the Gaussian fall beyond it, cycles a pixel
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
