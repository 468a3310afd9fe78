#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// The correlation of each pixel of an image with those around it: its product with the mean of the
/// 48 pixels around, after a local mean over 17 × 17 pixels was subtracted. White noise has
/// products of mean 0 and of a known spread.
struct Correlation {
  explicit Correlation(MaskedImage image);

  /// Averages everything over cells with a side of `factor` pixels, at least 1.
  void reduce(double factor);

  // The valid pixels are the same in all of them.
  MaskedImage image;      ///< the pixels themselves
  MaskedImage variances;  ///< squares of the pixels less the local mean
  MaskedImage products;   ///< clipped at four standard deviations of a product of white noise
  double noise = 0.0;     ///< standard deviation of an element of `products` for white noise
};

/// Adds up what some pixels of a Correlation have.
class CorrelationSum {
 public:
  void add(const Correlation& of, std::size_t index) {
    if (!of.image.valid[index]) return;
    const double value = of.image.values[index];
    products_ += of.products.values[index];
    values_ += value;
    squares_ += value * value;
    variances_ += of.variances.values[index];
    count_ += 1.0;
  }
  void operator+=(const CorrelationSum& other);

  double count() const { return count_; }
  double product() const { return products_ / count_; }  ///< the mean one
  double mean() const { return values_ / count_; }
  double deviation() const;                                ///< standard deviation of the pixels
  double variance() const { return variances_ / count_; }  ///< of the pixels less the local mean
  /// Returns the standard error of product() where there is only noise.
  double error(const Correlation& of) const;

 private:
  double products_ = 0.0, values_ = 0.0, squares_ = 0.0, variances_ = 0.0, count_ = 0.0;
};

}  // namespace tomofield::tilt_series
