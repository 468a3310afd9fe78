#include "compare/pictures.h"

#include <algorithm>
#include <cmath>

namespace tomofield::compare {
namespace {

constexpr std::int64_t kPictureWidth = 320;  // smallest width where whole voxels allow it

double standard_deviation(const report::Slice& plane, const Rectangle& d) {
  double n = 0, sum = 0, squares = 0;
  for (std::int64_t y = d.y0; y < d.y1; ++y) {
    for (std::int64_t x = d.x0; x < d.x1; ++x) {
      const double value = static_cast<double>(plane.row(y)[x]);
      n += 1;
      sum += value;
      squares += value * value;
    }
  }
  return std::sqrt(std::max(squares / n - sum / n * (sum / n), 0.0));
}

report::HtmlFigure figure(const Shown& volume, const report::Slice& slice, const char* part,
                          const report::GreyScale& scale, const std::filesystem::path& folder) {
  const std::filesystem::path path = picture_path(folder, volume.name, part);
  const std::int64_t zoom = std::max<std::int64_t>(1, kPictureWidth / slice.width);
  report::write_slice_picture(path, slice, scale, zoom);
  return {path, volume.title};
}

}  // namespace

std::filesystem::path picture_path(const std::filesystem::path& folder, const std::string& volume,
                                   const std::string& part) {
  return folder / (volume + "_" + part + ".png");
}

Rectangle busiest_detail(const report::Slice& plane) {
  const std::int64_t shorter = std::min(plane.width, plane.height);
  const std::int64_t side = std::min(shorter, std::max<std::int64_t>(shorter / 3, 32));
  const std::int64_t step = std::max<std::int64_t>(side / 2, 1);
  Rectangle best{0, 0, side, side};
  double largest = -1;
  for (std::int64_t y = 0; y + side <= plane.height; y += step) {
    for (std::int64_t x = 0; x + side <= plane.width; x += step) {
      const Rectangle here{x, y, x + side, y + side};
      const double deviation = standard_deviation(plane, here);
      if (deviation > largest) {
        largest = deviation;
        best = here;
      }
    }
  }
  return best;
}

std::vector<report::HtmlFigure> plane_figures(const std::vector<Shown>& volumes, std::size_t plane,
                                              const report::GreyScale& scale,
                                              const std::filesystem::path& folder) {
  std::vector<report::HtmlFigure> figures;
  for (const Shown& volume : volumes)
    figures.push_back(figure(volume, volume.planes[plane], kPictureParts[plane], scale, folder));
  return figures;
}

std::vector<report::HtmlFigure> detail_figures(const std::vector<Shown>& volumes,
                                               const Rectangle& detail,
                                               const report::GreyScale& scale,
                                               const std::filesystem::path& folder) {
  const auto cut = [&](const Shown& volume) {
    return volume.planes.front().cut(detail.x0, detail.y0, detail.x1, detail.y1);
  };
  std::vector<report::HtmlFigure> figures;
  for (const Shown& volume : volumes)
    figures.push_back(figure(volume, cut(volume), kPictureParts.back(), scale, folder));
  return figures;
}

evaluate::LineSegment line_through(const Rectangle& detail, std::int64_t num_planes) {
  const double y = static_cast<double>((detail.y0 + detail.y1) / 2) + 0.5;
  const double z = static_cast<double>(num_planes / 2) + 0.5;
  return {{static_cast<double>(detail.x0) + 0.5, y, z},
          {static_cast<double>(detail.x1) - 0.5, y, z}};
}

}  // namespace tomofield::compare
