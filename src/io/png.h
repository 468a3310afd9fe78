#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

namespace tomofield::io {

/// Writes an 8-bit grey picture; pixels[row × width + column], the first row on top.
/// Replaces `path` atomically. Throws Error.
void write_png_grey(const std::filesystem::path& path, std::int64_t width, std::int64_t height,
                    std::span<const std::uint8_t> pixels);

/// The same with three values a pixel: pixels[(row × width + column) × 3 + channel].
void write_png_rgb(const std::filesystem::path& path, std::int64_t width, std::int64_t height,
                   std::span<const std::uint8_t> pixels);

}  // namespace tomofield::io
