#pragma once

#include <cstdint>
#include <vector>

namespace tomofield::microscope {

/// Extends a line of pixels to a longer, periodic one without a step. Behind its end, the line goes
/// on as its mirror image, which turns over the gap into the mirror image of its beginning.
class LineExtension {
 public:
  /// Each value of the longer line is the sum of two pixels with these weights.
  struct Value {
    std::int64_t pixels[2];
    float weights[2];
  };

  /// Makes an extension of `length` pixels to `extended_length`.
  LineExtension(std::int64_t length, std::int64_t extended_length);

  std::int64_t length() const { return length_; }
  std::int64_t extended_length() const { return std::ssize(values_); }
  const Value& operator[](std::int64_t i) const { return values_[static_cast<std::size_t>(i)]; }

 private:
  std::int64_t length_;
  std::vector<Value> values_;
};

}  // namespace tomofield::microscope
