#include "projection/view_crossings.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "base/threads/parallel.h"
#include "kernels/lanes.h"

namespace tomofield::projection {
namespace {

using kernels::kLanes;
using kernels::LineCrossing;

// Returns the beam of a view on rows of z.
Beam row_beam(const geometry::TiltGeometry& g, const SampleSegment& s, int view) {
  const double cosine = g.cos_tilt(view), tangent = g.signed_sin_tilt(view) / cosine;
  return {.offset = (g.ray_x(view, 0.5, 0.5 * s.hz) - s.x0) / s.hx - 0.5,
          .offset_per_line = -tangent * s.hz / s.hx,
          .step = 1.0 / (s.hx * cosine),
          .weight = static_cast<float>(s.hz / cosine),
          .spread = s.hz * std::abs(tangent) / s.hx};
}

// Returns the beam of a view on columns of x.
Beam column_beam(const geometry::TiltGeometry& g, const SampleSegment& s, int view) {
  const double sine = g.signed_sin_tilt(view), cotangent = g.cos_tilt(view) / sine;
  return {.offset = g.ray_z(view, 0.5, s.x0 + 0.5 * s.hx) / s.hz - 0.5,
          .offset_per_line = -cotangent * s.hx / s.hz,
          .step = 1.0 / (s.hz * sine),
          .weight = static_cast<float>(s.hx / std::abs(sine)),
          .spread = s.hx * std::abs(cotangent) / s.hz};
}

// A line as a view sees it. The line represents a piece of each ray, which spans some width along
// the line. If that piece straddles a cut face, the line counts only for the part on its side. The
// pieces of a ray on both sides of the face, which differ in length, then add up correctly. Few
// pixels are affected: those of [part_first, part_end) outside the range of `line`.
struct Crossing {
  LineCrossing line;
  double offset = 0, step = 1;  // position(pixel), as in LineCrossing
  int part_first = 0, part_end = 0;
  double low_face = 0, high_face = 0, spread = 0;  // measured in samples

  double position(int pixel) const { return offset + step * pixel; }
  // Returns the share of a pixel's piece that lies within the faces.
  double share(int pixel) const {
    const double p = position(pixel);
    return std::clamp(std::min(p - low_face, high_face - p) / spread + 0.5, 0.0, 1.0);
  }
  // Returns the first pixel whose position is at least `position`; steps are positive.
  int first_pixel_from(double position, int width) const {
    const double pixel = std::ceil((position - offset) / step);
    return static_cast<int>(std::clamp(pixel, 0.0, static_cast<double>(width)));
  }
};

// Returns what a view sees of a line, without pointers to samples or pixels.
Crossing crossing(const Beam& beam, const LineFamily& family, int line, int width) {
  Crossing c{.line = {}, .offset = beam.offset + line * beam.offset_per_line, .step = beam.step};
  c.line.offset = static_cast<float>(c.offset);
  c.line.step = static_cast<float>(c.step);
  c.line.low = -1.0f;
  c.line.high = static_cast<float>(family.num_samples);
  c.line.weight = beam.weight;
  c.line.first_pixel = 0;
  c.line.end_pixel = c.part_end = width;
  if (!family.cut_low && !family.cut_high) return c;

  // On a side where the field ends, the hat of the last sample ends it.
  constexpr double kNowhere = 1e9, kThinnest = 1e-6;
  c.low_face = family.cut_low ? -0.5 : -kNowhere;
  c.high_face = family.cut_high ? family.num_samples - 0.5 : kNowhere;
  c.spread = std::max(beam.spread, kThinnest);
  const double half = c.spread / 2, end = family.num_samples;
  c.part_first = c.first_pixel_from(std::max(c.low_face - half, -1.0), width);
  c.line.first_pixel = c.first_pixel_from(std::max(c.low_face + half, -1.0), width);
  c.line.end_pixel = c.first_pixel_from(std::min(c.high_face - half, end), width);
  c.part_end = c.first_pixel_from(std::min(c.high_face + half, end), width);
  return c;
}

// Appends the pixels that count only in part.
void add_parts(const Crossing& c, int line, std::size_t view, std::vector<PartialPixel>& parts) {
  for (int pixel = c.part_first; pixel < c.part_end; ++pixel) {
    if (pixel == c.line.first_pixel && c.line.first_pixel < c.line.end_pixel) {
      pixel = c.line.end_pixel - 1;
      continue;
    }
    const double lower = std::floor(c.position(pixel)), fraction = c.position(pixel) - lower;
    const double weight = static_cast<double>(c.line.weight) * c.share(pixel);
    parts.push_back({line, view, pixel, static_cast<std::ptrdiff_t>(lower),
                     static_cast<float>(weight * (1 - fraction)),
                     static_cast<float>(weight * fraction)});
  }
}

// A view with its place in the list of views, and what it sees of a family.
struct SeenBy {
  std::size_t index;
  Beam beam;
};

// The kernels count samples from the start of a slab and pixels from the first of the list of
// views. Nothing is read here, so these pointers stand for any slab.
const float* const kStart = nullptr;
const float* at(std::ptrdiff_t floats) {
  return reinterpret_cast<const float*>(static_cast<std::uintptr_t>(floats) * sizeof(float));
}

LineBlock make_block(const LineFamily& family, base::Range lines, const std::vector<SeenBy>& views,
                     int width) {
  LineBlock block{.lines = lines, .views = {}, .views_of_line = {}, .parts = {}};
  const std::ptrdiff_t pixels_apart = std::ptrdiff_t{width} * kLanes;
  for (const SeenBy& view : views) {
    LineBlock::View& seen = block.views.emplace_back();
    seen.index = view.index;
    seen.beam = view.beam;
    std::array<LineCrossing, LineBlock::kMaxLines> crossings;
    for (int l = lines.begin; l < lines.end; ++l) {
      LineCrossing& line = crossings[static_cast<std::size_t>(l - lines.begin)];
      line = crossing(view.beam, family, l, width).line;
      line.samples = at(family.origin + l * family.line_stride);
    }
    kernels::group_lines(std::span(crossings).first(static_cast<std::size_t>(lines.size())), kStart,
                         seen.lines);
    for (const kernels::CrossingGroup& group : seen.lines)
      seen.reached = seen.reached.joined_with(group.reached);
  }
  std::vector<LineCrossing> crossings;
  for (int l = lines.begin; l < lines.end; ++l) {
    crossings.clear();
    for (const SeenBy& view : views) {
      const Crossing c = crossing(view.beam, family, l, width);
      add_parts(c, l, view.index, block.parts);
      crossings.push_back(c.line);
      crossings.back().detector = at(static_cast<std::ptrdiff_t>(view.index) * pixels_apart);
    }
    kernels::group_views(crossings, kStart,
                         block.views_of_line[static_cast<std::size_t>(l - lines.begin)]);
  }
  return block;
}

}  // namespace

LineFamily rows_of(const SampleSegment& s) {
  return {true, s.nz, s.nx, s.origin, s.stride_z(), kLanes, s.cut_low, s.cut_high};
}
LineFamily columns_of(const SampleSegment& s) {
  return {false, s.nx, s.nz, s.origin, kLanes, s.stride_z(), false, false};
}

ViewCrossings::ViewCrossings(const geometry::TiltGeometry& geometry, const SampleGrid& grid,
                             std::span<const int> views)
    : num_views_(views.size()) {
  std::vector<std::vector<SeenBy>> seen_by;
  struct Place {
    std::size_t lines;
    int block;
  };
  std::vector<Place> places;
  for (const SampleSegment& segment : grid.segments()) {
    for (const LineFamily& family : {rows_of(segment), columns_of(segment)}) {
      std::vector<SeenBy>& seen = seen_by.emplace_back();
      for (std::size_t v = 0; v < views.size(); ++v) {
        if (geometry.is_flat(views[v]) != family.flat) continue;
        seen.push_back({v, family.flat ? row_beam(geometry, segment, views[v])
                                       : column_beam(geometry, segment, views[v])});
      }
      const int blocks = (family.num_lines + LineBlock::kMaxLines - 1) / LineBlock::kMaxLines;
      for (int b = 0; b < blocks; ++b) places.push_back({lines_.size(), b});
      lines_.push_back({family, std::vector<LineBlock>(static_cast<std::size_t>(blocks))});
    }
  }
  base::parallel_for("crossings", std::ssize(places), [&](std::int64_t i) {
    const Place& place = places[static_cast<std::size_t>(i)];
    Lines& lines = lines_[place.lines];
    const int first = place.block * LineBlock::kMaxLines;
    lines.blocks[static_cast<std::size_t>(place.block)] = make_block(
        lines.family, {first, std::min(first + LineBlock::kMaxLines, lines.family.num_lines)},
        seen_by[place.lines], static_cast<int>(geometry.width));
  });
}

}  // namespace tomofield::projection
