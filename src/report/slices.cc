#include "report/slices.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <utility>

#include "base/percentile.h"
#include "io/mrc.h"
#include "io/png.h"

namespace tomofield::report {
namespace {

constexpr std::int64_t kMinWidth_px = 512;
constexpr std::int64_t kMaxWidth_px = 4096;  // of an enlarged picture
constexpr std::int64_t kChunkValues = std::int64_t{1} << 22;
constexpr std::size_t kMaxSample = std::size_t{1} << 20;

/// One plane [height, width] of a volume.
struct Slice {
  Slice(const char* axes, std::int64_t w, std::int64_t h)
      : name(axes), width(w), height(h), values(static_cast<std::size_t>(w * h)) {}
  float* row(std::int64_t y) { return values.data() + y * width; }
  const float* row(std::int64_t y) const { return values.data() + y * width; }
  std::string name;
  std::int64_t width, height;
  std::vector<float> values;
};

std::vector<Slice> read_central_slices(const io::MrcReader& file) {
  const io::MrcHeader& h = file.header();
  std::vector<Slice> slices{{"xy", h.nx, h.ny}, {"xz", h.nx, h.nz}, {"yz", h.ny, h.nz}};
  Slice &xy = slices[0], &xz = slices[1], &yz = slices[2];
  file.read_section(h.nz / 2, xy.values);
  const std::int64_t chunk = std::clamp<std::int64_t>(kChunkValues / h.nx, 1, h.ny);
  std::vector<float> rows(static_cast<std::size_t>(chunk * h.nx));
  for (std::int64_t z = 0; z < h.nz; ++z) {
    for (std::int64_t y = 0; y < h.ny; y += chunk) {
      const std::int64_t count = std::min(chunk, h.ny - y);
      file.read_rows(z, y, count, std::span(rows).first(static_cast<std::size_t>(count * h.nx)));
      for (std::int64_t i = 0; i < count; ++i) {
        const float* row = rows.data() + i * h.nx;
        yz.row(z)[y + i] = row[h.nx / 2];
        if (y + i == h.ny / 2) std::copy_n(row, h.nx, xz.row(z));
      }
    }
  }
  return slices;
}

/// Black and white for all the slices.
std::pair<double, double> grey_range(const std::vector<Slice>& slices) {
  std::size_t total = 0;
  for (const Slice& slice : slices) total += slice.values.size();
  const std::size_t stride = total / kMaxSample + 1;
  std::vector<float> sample;
  for (const Slice& slice : slices)
    for (std::size_t i = 0; i < slice.values.size(); i += stride)
      if (std::isfinite(slice.values[i])) sample.push_back(slice.values[i]);
  if (sample.empty()) return {0.0, 1.0};
  return {base::percentile(sample, 0.5), base::percentile(sample, 99.5)};
}

void write_picture(const std::filesystem::path& path, const Slice& slice,
                   std::pair<double, double> range, std::int64_t zoom) {
  const double to_grey = range.second > range.first ? 255.0 / (range.second - range.first) : 0.0;
  const std::int64_t width = slice.width * zoom, height = slice.height * zoom;
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(width * height));
  for (std::int64_t y = 0; y < height; ++y) {
    const float* row = slice.row(slice.height - 1 - y / zoom);  // the first row at the bottom
    for (std::int64_t x = 0; x < width; ++x) {
      const double grey = (static_cast<double>(row[x / zoom]) - range.first) * to_grey;
      const double shown = std::isnan(grey) ? 0.0 : std::clamp(grey, 0.0, 255.0);  // NaN: black
      pixels[static_cast<std::size_t>(y * width + x)] =
          static_cast<std::uint8_t>(std::lround(shown));
    }
  }
  io::write_png_grey(path, width, height, pixels);
}

}  // namespace

std::vector<std::filesystem::path> write_slice_pictures(const std::filesystem::path& mrc,
                                                        const std::filesystem::path& prefix) {
  const auto slices = read_central_slices(io::MrcReader(mrc));
  const auto range = grey_range(slices);
  const auto [narrowest, widest] = std::minmax({slices[0].width, slices[2].width});
  const std::int64_t zoom =
      std::clamp<std::int64_t>((kMinWidth_px + narrowest - 1) / narrowest, 1,
                               std::max<std::int64_t>(kMaxWidth_px / widest, 1));
  std::vector<std::filesystem::path> paths;
  for (const Slice& slice : slices) {
    paths.emplace_back(prefix.string() + "_" + slice.name + ".png");
    write_picture(paths.back(), slice, range, zoom);
  }
  return paths;
}

}  // namespace tomofield::report
