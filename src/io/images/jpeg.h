#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace tomofield::io {

/// Returns an 8-bit grey image, pixels[row × width + column] with the first row on top, as the
/// bytes of a JPEG file. `quality` is from 1 to 100. A side has at most 65535 pixels. May be called
/// from several threads.
std::string jpeg_grey(std::int64_t width, std::int64_t height, std::span<const std::uint8_t> pixels,
                      int quality);

/// Returns an 8-bit RGB image, pixels[(row × width + column) × 3 + channel], in the same way.
std::string jpeg_rgb(std::int64_t width, std::int64_t height, std::span<const std::uint8_t> pixels,
                     int quality);

}  // namespace tomofield::io
