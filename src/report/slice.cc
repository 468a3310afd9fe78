#include "report/slice.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <utility>

#include "base/check.h"
#include "base/threads/parallel.h"
#include "io/images/mrc.h"
#include "io/images/png.h"

namespace tomofield::report {
namespace {

constexpr std::int64_t kChunkValues = std::int64_t{1} << 18;

}  // namespace

Slice Slice::cut(std::int64_t x0, std::int64_t y0, std::int64_t x1, std::int64_t y1) const {
  TOMOFIELD_CHECK(x0 >= 0 && y0 >= 0 && x1 <= width && y1 <= height, "a part beyond a slice");
  Slice part(x1 - x0, y1 - y0);
  for (std::int64_t y = y0; y < y1; ++y) std::copy(row(y) + x0, row(y) + x1, part.row(y - y0));
  return part;
}

std::vector<Slice> read_central_slices(const std::filesystem::path& mrc) {
  const io::MrcReader file(mrc);
  const io::MrcHeader& h = file.header();
  std::vector<Slice> slices{{h.nx, h.ny}, {h.nx, h.nz}, {h.ny, h.nz}};
  Slice &xy = slices[0], &xz = slices[1], &yz = slices[2];
  file.read_section(h.nz / 2, xy.values);
  const std::int64_t chunk = std::clamp<std::int64_t>(kChunkValues / h.nx, 1, h.ny);
  base::parallel_for("read slices", h.nz, [&](std::int64_t z) {
    std::vector<float> rows(static_cast<std::size_t>(chunk * h.nx));
    for (std::int64_t y = 0; y < h.ny; y += chunk) {
      const std::int64_t count = std::min(chunk, h.ny - y);
      file.read_rows(z, y, count, std::span(rows).first(static_cast<std::size_t>(count * h.nx)));
      for (std::int64_t i = 0; i < count; ++i) {
        const float* row = rows.data() + i * h.nx;
        yz.row(z)[y + i] = row[h.nx / 2];
        if (y + i == h.ny / 2) std::copy_n(row, h.nx, xz.row(z));
      }
    }
  });
  return slices;
}

void write_slice_picture(const std::filesystem::path& path, const Slice& slice,
                         const GreyScale& scale, std::int64_t zoom) {
  const std::int64_t width = slice.width * zoom, height = slice.height * zoom;
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(width * height));
  for (std::int64_t y = 0; y < height; ++y) {
    const float* row = slice.row(slice.height - 1 - y / zoom);  // the first row is at the bottom
    for (std::int64_t x = 0; x < width; ++x)
      pixels[static_cast<std::size_t>(y * width + x)] =
          scale.grey(static_cast<double>(row[x / zoom]));
  }
  io::write_png_grey(path, width, height, pixels);
}

std::uint8_t GreyScale::grey(double value) const {
  const double grey = (value - black_) * to_grey_;
  return static_cast<std::uint8_t>(
      std::lround(std::isnan(grey) ? 0.0 : std::clamp(grey, 0.0, 255.0)));
}

std::int64_t picture_zoom(std::int64_t narrowest, std::int64_t widest) {
  constexpr std::int64_t kMinWidth_px = 512;
  constexpr std::int64_t kMaxWidth_px = 4096;
  return std::clamp<std::int64_t>((kMinWidth_px + narrowest - 1) / narrowest, 1,
                                  std::max<std::int64_t>(kMaxWidth_px / widest, 1));
}

void write_slice_pictures(const std::filesystem::path& mrc,
                          const std::array<std::filesystem::path, 3>& pictures) {
  const auto slices = read_central_slices(mrc);
  const GreyScale scale(contrast_of(io::MrcReader(mrc)));
  const auto [narrowest, widest] = std::minmax({slices[0].width, slices[2].width});
  const std::int64_t zoom = picture_zoom(narrowest, widest);
  base::parallel_for("draw slices", std::ssize(slices), [&](std::int64_t i) {
    const auto slice = static_cast<std::size_t>(i);
    write_slice_picture(pictures[slice], slices[slice], scale, zoom);
  });
}

}  // namespace tomofield::report
