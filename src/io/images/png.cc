#include "io/images/png.h"

#include <fmt/format.h>
#include <png.h>

#include "base/check.h"
#include "io/is_file.h"
#include "io/saving/atomic_file.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

void write_png(const std::filesystem::path& path, std::int64_t width, std::int64_t height,
               png_uint_32 format, std::span<const std::uint8_t> pixels) {
  const std::int64_t channels = PNG_IMAGE_SAMPLE_CHANNELS(format);
  TOMOFIELD_CHECK(width > 0 && height > 0 &&
                      pixels.size() == static_cast<std::size_t>(width * height * channels),
                  "a picture must have as many pixels as its size says");
  AtomicFile file(path);
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width);
  image.height = static_cast<png_uint_32>(height);
  image.format = format;
  if (png_image_write_to_file(&image, file.temporary_path().c_str(), 0, pixels.data(), 0,
                              nullptr) == 0) {
    throw Error(fmt::format("cannot write the picture '{}': {}", path.string(), image.message));
  }
  file.commit();
}

}  // namespace

void write_png_grey(const std::filesystem::path& path, std::int64_t width, std::int64_t height,
                    std::span<const std::uint8_t> pixels) {
  write_png(path, width, height, PNG_FORMAT_GRAY, pixels);
}

void write_png_rgb(const std::filesystem::path& path, std::int64_t width, std::int64_t height,
                   std::span<const std::uint8_t> pixels) {
  write_png(path, width, height, PNG_FORMAT_RGB, pixels);
}

bool is_png(const std::filesystem::path& path) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  const bool is_picture =
      is_file(path) && png_image_begin_read_from_file(&image, path.c_str()) != 0;
  png_image_free(&image);
  return is_picture;
}

RgbImage read_png(const std::filesystem::path& path) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  RgbImage picture;
  if (png_image_begin_read_from_file(&image, path.c_str()) != 0) {
    image.format = PNG_FORMAT_RGB;
    picture = {image.width, image.height, std::vector<std::uint8_t>(PNG_IMAGE_SIZE(image))};
    if (png_image_finish_read(&image, nullptr, picture.pixels.data(), 0, nullptr) != 0)
      return picture;
  }
  throw Error(fmt::format("cannot read the picture '{}': {}", path.string(), image.message));
}

}  // namespace tomofield::io
