#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "report/grey_scale.h"

namespace tomofield::report {

/// One plane of a volume: values[row × width + column]. The first row is at the bottom.
struct Slice {
  Slice(std::string axes, std::int64_t w, std::int64_t h)
      : name(std::move(axes)), width(w), height(h), values(static_cast<std::size_t>(w * h)) {}
  float* row(std::int64_t y) { return values.data() + y * width; }
  const float* row(std::int64_t y) const { return values.data() + y * width; }
  /// Returns columns x0 … x1 − 1 and rows y0 … y1 − 1.
  Slice cut(std::int64_t x0, std::int64_t y0, std::int64_t x1, std::int64_t y1) const;

  std::string name;  ///< its axes: xy, xz or yz, the first to the right
  std::int64_t width, height;
  std::vector<float> values;
};

/// Reads the three central planes of an MRC volume: xy, xz and yz (the file's own axes). Reads the
/// file once, rows at a time.
std::vector<Slice> read_central_slices(const std::filesystem::path& mrc);

/// Returns one grey scale for all slices.
GreyScale grey_scale_of(const std::vector<Slice>& slices);

/// Writes a PNG with `zoom` pixels a value; the first row is at the bottom. Replaces `path`.
void write_slice_picture(const std::filesystem::path& path, const Slice& slice,
                         const GreyScale& scale, std::int64_t zoom);

}  // namespace tomofield::report
