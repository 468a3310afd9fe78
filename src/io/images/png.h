#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

namespace tomofield::io {

/// Writes an 8-bit grey image, pixels[row × width + column], with the first row on top. Replaces
/// `path` atomically. Throws Error.
void write_png_grey(const std::filesystem::path& path, std::int64_t width, std::int64_t height,
                    std::span<const std::uint8_t> pixels);

/// Writes an 8-bit RGB image, pixels[(row × width + column) × 3 + channel], in the same way.
void write_png_rgb(const std::filesystem::path& path, std::int64_t width, std::int64_t height,
                   std::span<const std::uint8_t> pixels);

/// An 8-bit RGB image, pixels[(row × width + column) × 3 + channel], with the first row on top.
struct RgbImage {
  std::int64_t width = 0, height = 0;
  std::vector<std::uint8_t> pixels;
};

/// Says whether there is a picture of this format at a path.
bool is_png(const std::filesystem::path& path);

/// Reads a picture that this program wrote. Throws Error if it cannot be read.
RgbImage read_png(const std::filesystem::path& path);

}  // namespace tomofield::io
