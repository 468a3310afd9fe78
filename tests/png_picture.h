#pragma once

#include <gtest/gtest.h>
#include <png.h>

#include <cstdint>
#include <filesystem>
#include <vector>

namespace tomofield::testing {

/// The pixels of a PNG file, rows from the top.
struct PngPicture {
  std::int64_t width = 0, height = 0, channels = 0;
  std::vector<std::uint8_t> pixels;
  int at(std::int64_t x, std::int64_t y, std::int64_t channel = 0) const {
    return pixels[static_cast<std::size_t>((y * width + x) * channels + channel)];
  }
};

/// Reads a PNG file as PNG_FORMAT_GRAY or PNG_FORMAT_RGB.
inline PngPicture read_png(const std::filesystem::path& path, png_uint_32 format) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  EXPECT_TRUE(png_image_begin_read_from_file(&image, path.c_str())) << path;
  image.format = format;
  PngPicture picture{image.width, image.height, PNG_IMAGE_PIXEL_CHANNELS(format),
                     std::vector<std::uint8_t>(PNG_IMAGE_SIZE(image))};
  EXPECT_TRUE(png_image_finish_read(&image, nullptr, picture.pixels.data(), 0, nullptr));
  return picture;
}

}  // namespace tomofield::testing
