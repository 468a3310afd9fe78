#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "report/contrast.h"

namespace tomofield::report {

/// Maps densities to greys.
class GreyScale {
 public:
  explicit GreyScale(const Contrast& contrast)
      : black_(contrast.black), to_grey_(255.0 / (contrast.white - contrast.black)) {}
  /// Returns the grey of a value, from 0 to 255. NaN is black.
  std::uint8_t grey(double value) const;

 private:
  double black_, to_grey_;
};

/// Returns the pixels a voxel at which pictures of small volumes are at least 512 wide, unless
/// another would then be wider than 4096.
std::int64_t picture_zoom(std::int64_t narrowest, std::int64_t widest);

/// One plane of a volume: values[row × width + column]. The first row is at the bottom.
struct Slice {
  Slice(std::int64_t w, std::int64_t h)
      : width(w), height(h), values(static_cast<std::size_t>(w * h)) {}
  float* row(std::int64_t y) { return values.data() + y * width; }
  const float* row(std::int64_t y) const { return values.data() + y * width; }
  /// Returns columns x0 … x1 − 1 and rows y0 … y1 − 1.
  Slice cut(std::int64_t x0, std::int64_t y0, std::int64_t x1, std::int64_t y1) const;

  std::int64_t width, height;
  std::vector<float> values;
};

/// Reads the three central planes of an MRC volume: xy, xz and yz (the file's own axes). Reads the
/// file once, rows at a time.
std::vector<Slice> read_central_slices(const std::filesystem::path& mrc);

/// Writes a PNG with `zoom` pixels a value; the first row is at the bottom. Replaces `path`.
void write_slice_picture(const std::filesystem::path& path, const Slice& slice,
                         const GreyScale& scale, std::int64_t zoom);

/// Draws the three central planes of an MRC volume, xy, xz and yz (the file's own axes). The first
/// axis of each name runs to the right, the second upwards, as in 3dmod. One grey scale serves all
/// three, the contrast of the volume (contrast.h), densities as stored. Voxels stay square. Small
/// volumes are enlarged, whole pixels a voxel, until each picture is at least 512 pixels wide
/// (unless another would then be wider than 4096).
///
/// Reads the file once, rows at a time. Replaces files.
void write_slice_pictures(const std::filesystem::path& mrc,
                          const std::array<std::filesystem::path, 3>& pictures);

}  // namespace tomofield::report
