#include "report/page_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "io/images/jpeg.h"
#include "io/images/png.h"
#include "io/saving/positioned_file.h"
#include "tomofield/error.h"

namespace tomofield::report {
namespace {

constexpr std::size_t kMostBytes = std::size_t{1} << 20;
constexpr std::int64_t kLongestSide_px = 1400;
constexpr int kQuality = 85;

std::string read_bytes(const std::filesystem::path& path) {
  const io::PositionedFile file(path, io::PositionedFile::Access::kRead);
  std::string bytes(static_cast<std::size_t>(file.size()), '\0');
  file.read_at(0, bytes.data(), bytes.size());
  return bytes;
}

// Returns the mean of a channel over the square of `factor` pixels a side that begins at a corner.
std::uint8_t mean(const io::RgbImage& image, std::int64_t x0, std::int64_t y0, int channel,
                  std::int64_t factor) {
  std::int64_t sum = 0;
  for (std::int64_t y = y0; y < y0 + factor; ++y)
    for (std::int64_t x = x0; x < x0 + factor; ++x)
      sum += image.pixels[static_cast<std::size_t>(3 * (y * image.width + x) + channel)];
  return static_cast<std::uint8_t>(sum / (factor * factor));
}

// Reduces an image by a whole factor. Pixels at the right and the lower edge that fill no square
// are cut off.
io::RgbImage reduced(const io::RgbImage& image, std::int64_t factor) {
  io::RgbImage small{std::max<std::int64_t>(image.width / factor, 1),
                     std::max<std::int64_t>(image.height / factor, 1),
                     {}};
  for (std::int64_t y = 0; y < small.height; ++y)
    for (std::int64_t x = 0; x < small.width; ++x)
      for (int channel = 0; channel < 3; ++channel)
        small.pixels.push_back(mean(image, x * factor, y * factor, channel, factor));
  return small;
}

}  // namespace

std::string page_picture(const std::filesystem::path& png) {
  const std::string bytes = read_bytes(png);
  if (bytes.size() <= kMostBytes) return "data:image/png;base64," + base64(bytes);
  const io::RgbImage image = io::read_png(png);
  const std::int64_t longest = std::max(image.width, image.height);
  const std::int64_t factor =
      std::min({(longest + kLongestSide_px - 1) / kLongestSide_px, image.width, image.height});
  const io::RgbImage small = reduced(image, factor);
  return "data:image/jpeg;base64," +
         base64(io::jpeg_rgb(small.width, small.height, small.pixels, kQuality));
}

std::string base64(std::string_view bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group <<= 8;
      if (k < count) group |= static_cast<unsigned char>(bytes[i + k]);
    }
    for (std::size_t k = 0; k < 4; ++k)
      text += k <= count ? kDigits[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

}  // namespace tomofield::report
