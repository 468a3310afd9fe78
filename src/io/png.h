#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

namespace tomofield::io {

/// Writes an 8-bit grey image, pixels[row × width + column], with the first row on top. Replaces
/// `path` atomically. Throws Error.
void write_png_grey(const std::filesystem::path& path, std::int64_t width, std::int64_t height,
                    std::span<const std::uint8_t> pixels);

/// Writes an 8-bit RGB image, pixels[(row × width + column) × 3 + channel], in the same way.
void write_png_rgb(const std::filesystem::path& path, std::int64_t width, std::int64_t height,
                   std::span<const std::uint8_t> pixels);

}  // namespace tomofield::io
