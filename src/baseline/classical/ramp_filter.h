#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

struct kiss_fft_state;

namespace tomofield::baseline {

/// The roll-off of the ramp |f|, with f in cycles a pixel, 0.5 at most.
struct RampFilterOptions {
  std::string window = "hann";  ///< factor: ramp 1, cosine cos πf, hann cos² πf
  double cutoff = 0.5;          ///< the ramp rises up to here, as in IMOD's RADIAL,
  double falloff = 0.05;        ///< and falls beyond as a Gaussian with this σ
};

/// Filters rows of a detector for back-projection: a linear convolution with the ramp of
/// band-limited rows (Kak and Slaney 1988, eq. 3.61) and its roll-off, rows being zero outside.
class RampFilter {
 public:
  RampFilter(const RampFilterOptions& options, std::int64_t width);

  /// Filters the rows of a slab in one view, [x, lane] in place. Thread-safe.
  void apply(float* rays) const;
  /// Response at frequencies i / length(), [length()]; the second half are the negative ones.
  const std::vector<float>& response() const { return response_; }
  int length() const { return length_; }

 private:
  using Plan = std::unique_ptr<kiss_fft_state, void (*)(kiss_fft_state*)>;

  std::int64_t width_;
  int length_;  // of the padded rows
  Plan forward_, inverse_;
  std::vector<float> response_;
};

}  // namespace tomofield::baseline
