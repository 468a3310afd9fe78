#include "io/images/jpeg.h"

#include <fmt/format.h>
#include <turbojpeg.h>

#include <memory>

#include "base/check.h"
#include "tomofield/error.h"

namespace tomofield::io {

namespace {

std::string encoded(std::int64_t width, std::int64_t height, TJPF format, TJSAMP subsampling,
                    std::span<const std::uint8_t> pixels, int quality) {
  constexpr std::int64_t kLargestSide_px = 65535;
  TOMOFIELD_CHECK(width > 0 && height > 0 && width <= kLargestSide_px && height <= kLargestSide_px,
                  "a picture must have a size that JPEG can hold");
  TOMOFIELD_CHECK(pixels.size() == static_cast<std::size_t>(width * height * tjPixelSize[format]),
                  "a picture must have as many pixels as its size says");
  const std::unique_ptr<void, decltype(&tjDestroy)> encoder(tjInitCompress(), &tjDestroy);
  if (!encoder) throw Error(fmt::format("cannot make a JPEG picture: {}", tjGetErrorStr2(nullptr)));
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  const int status = tjCompress2(encoder.get(), pixels.data(), static_cast<int>(width), 0,
                                 static_cast<int>(height), format, &bytes, &size, subsampling,
                                 quality, TJFLAG_ACCURATEDCT);
  const std::unique_ptr<unsigned char, decltype(&tjFree)> owner(bytes, &tjFree);
  if (status != 0)
    throw Error(fmt::format("cannot make a JPEG picture: {}", tjGetErrorStr2(encoder.get())));
  return {reinterpret_cast<const char*>(bytes), size};
}

}  // namespace

std::string jpeg_grey(std::int64_t width, std::int64_t height, std::span<const std::uint8_t> pixels,
                      int quality) {
  return encoded(width, height, TJPF_GRAY, TJSAMP_GRAY, pixels, quality);
}

std::string jpeg_rgb(std::int64_t width, std::int64_t height, std::span<const std::uint8_t> pixels,
                     int quality) {
  return encoded(width, height, TJPF_RGB, TJSAMP_444, pixels, quality);
}

}  // namespace tomofield::io
