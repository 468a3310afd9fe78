#include "projection/slab_projector.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "kernels/lanes.h"
#include "kernels/line_projection.h"

namespace tomofield::projection {
namespace {

using kernels::kLanes;
using kernels::LineCrossing;

// Lines that are projected together, so that a detector pixel is read and
// written once for all of them; eight rows also stay in L2 for every view.
constexpr int kLinesAtOnce = 8;

// A line as a view sees it. Its row stands for a piece of ray hz high and
// hz tan θ wide; where that piece straddles a cut face, the row counts for the
// part on its side, so that a ray's pieces on both sides, which differ in
// height, add up to its length. Such pixels [part_first, part_end) around those
// of `line` are few and dealt with here.
struct Crossing {
  LineCrossing line;
  double offset = 0, step = 1;  // position(pixel), as in LineCrossing
  int part_first = 0, part_end = 0;
  double low_face = 0, high_face = 0, width = 0;  // of the piece, in samples

  double position(int pixel) const { return offset + step * pixel; }
  // Share of a pixel's piece within the faces.
  double share(int pixel) const {
    const double p = position(pixel);
    return std::clamp(std::min(p - low_face, high_face - p) / width + 0.5, 0.0, 1.0);
  }
};

// First pixel whose position is at least `position`; steps are positive.
int first_pixel_from(const Crossing& c, double position, std::int64_t width) {
  const double pixel = std::ceil((position - c.offset) / c.step);
  return static_cast<int>(std::clamp(pixel, 0.0, static_cast<double>(width)));
}

void set_positions(Crossing& c, double offset, double step) {
  c.offset = offset;
  c.step = step;
  c.line.offset = static_cast<float>(offset);
  c.line.step = static_cast<float>(step);
}

// Row k of a segment as a flat view sees it.
Crossing row_crossing(const geometry::TiltGeometry& g, const SampleSegment& s, int view, int k) {
  const double z = (k + 0.5) * s.hz;
  const double cosine = g.cos_tilt(view);
  Crossing c;
  set_positions(c, (g.ray_x(view, 0.5, z) - s.x0) / s.hx - 0.5, 1.0 / (s.hx * cosine));
  c.line.low = -1.0f;
  c.line.high = static_cast<float>(s.nx);
  c.line.weight = static_cast<float>(s.hz / cosine);
  // Where the field ends instead, the hat of the last sample does: beyond it.
  constexpr double kNowhere = 1e9, kThinnest = 1e-6;
  c.low_face = s.cut_low ? -0.5 : -kNowhere;
  c.high_face = s.cut_high ? s.nx - 0.5 : kNowhere;
  c.width = std::max(s.hz * std::abs(g.signed_sin_tilt(view)) / cosine, kThinnest) / s.hx;
  const double half = c.width / 2;
  c.part_first = first_pixel_from(c, std::max(c.low_face - half, -1.0), g.width);
  c.line.first_pixel = first_pixel_from(c, std::max(c.low_face + half, -1.0), g.width);
  const double end = static_cast<double>(s.nx);
  c.line.end_pixel = first_pixel_from(c, std::min(c.high_face - half, end), g.width);
  c.part_end = first_pixel_from(c, std::min(c.high_face + half, end), g.width);
  return c;
}

// Column i of a segment as a steep view sees it: faces do not cut it.
Crossing column_crossing(const geometry::TiltGeometry& g, const SampleSegment& s, int view, int i) {
  const double x = s.x0 + (i + 0.5) * s.hx;
  const double sine = g.signed_sin_tilt(view);
  Crossing c;
  set_positions(c, g.ray_z(view, 0.5, x) / s.hz - 0.5, 1.0 / (s.hz * sine));
  c.line.low = -1.0f;
  c.line.high = static_cast<float>(s.nz);
  c.line.weight = static_cast<float>(s.hx / std::abs(sine));
  // The pixels that can lie in [low, high); the kernel tests which do.
  const double a = (-1.0 - c.offset) / c.step, b = (s.nz - c.offset) / c.step;
  const double limit = static_cast<double>(g.width);
  c.line.first_pixel = static_cast<int>(std::clamp(std::floor(std::min(a, b)), 0.0, limit));
  c.line.end_pixel = static_cast<int>(std::clamp(std::ceil(std::max(a, b)) + 1.0, 0.0, limit));
  c.part_first = c.line.first_pixel;
  c.part_end = c.line.end_pixel;
  return c;
}

// The two families of lines of a segment: rows for flat views, columns for steep ones.
struct Family {
  bool flat;
  int num_lines;
  std::ptrdiff_t line_stride, sample_stride;
  Crossing crossing(const geometry::TiltGeometry& g, const SampleSegment& s, int view,
                    int line) const {
    return flat ? row_crossing(g, s, view, line) : column_crossing(g, s, view, line);
  }
};

Family rows_of(const SampleSegment& s) { return {true, s.nz, s.stride_z(), kLanes}; }
Family columns_of(const SampleSegment& s) { return {false, s.nx, kLanes, s.stride_z()}; }

// A cut side repeats its last sample, so that the field is constant up to the face.
void fill_padding(const SampleSegment& s, float* samples) {
  for (int k = 0; k < s.nz; ++k) {
    float* row = samples + s.origin + k * s.stride_z();
    float* end = row + static_cast<std::ptrdiff_t>(s.nx) * kLanes;
    if (s.cut_low) std::copy_n(row, kLanes, row - kLanes);
    if (s.cut_high) std::copy_n(end - kLanes, kLanes, end);
  }
}

void fold_padding(const SampleSegment& s, float* samples) {
  const auto fold = [](float* padding, float* sample) {
    for (int l = 0; l < kLanes; ++l) {
      sample[l] += padding[l];
      padding[l] = 0.0f;
    }
  };
  for (int k = 0; k < s.nz; ++k) {
    float* row = samples + s.origin + k * s.stride_z();
    float* end = row + static_cast<std::ptrdiff_t>(s.nx) * kLanes;
    if (s.cut_low) fold(row - kLanes, row);
    if (s.cut_high) fold(end, end - kLanes);
  }
}

// Calls visit(pixel, lower sample, its weight, weight of the next) for the
// pixels of which only a part counts.
template <typename Visit>
void for_each_part(const Crossing& c, Visit&& visit) {
  for (int pixel = c.part_first; pixel < c.part_end; ++pixel) {
    if (pixel == c.line.first_pixel && c.line.first_pixel < c.line.end_pixel) {
      pixel = c.line.end_pixel - 1;
      continue;
    }
    const double lower = std::floor(c.position(pixel)), fraction = c.position(pixel) - lower;
    const double weight = static_cast<double>(c.line.weight) * c.share(pixel);
    visit(pixel, static_cast<std::ptrdiff_t>(lower), static_cast<float>(weight * (1 - fraction)),
          static_cast<float>(weight * fraction));
  }
}

void project_parts(const Crossing& c, std::ptrdiff_t stride, float* detector) {
  for_each_part(c, [&](int pixel, std::ptrdiff_t lower, float low_weight, float high_weight) {
    const float* sample = c.line.samples + lower * stride;
    float* out = detector + static_cast<std::ptrdiff_t>(pixel) * kLanes;
    for (int l = 0; l < kLanes; ++l)
      out[l] += low_weight * sample[l] + high_weight * sample[stride + l];
  });
}

void backproject_parts(const Crossing& c, std::ptrdiff_t stride, float* samples) {
  for_each_part(c, [&](int pixel, std::ptrdiff_t lower, float low_weight, float high_weight) {
    float* sample = samples + lower * stride;
    const float* in = c.line.detector + static_cast<std::ptrdiff_t>(pixel) * kLanes;
    for (int l = 0; l < kLanes; ++l) {
      sample[l] += low_weight * in[l];
      sample[stride + l] += high_weight * in[l];
    }
  });
}

void project_family(const geometry::TiltGeometry& g, const SampleSegment& s, const Family& family,
                    const float* samples, std::span<const int> views, float* detector) {
  LineCrossing lines[kLinesAtOnce];
  for (int first = 0; first < family.num_lines; first += kLinesAtOnce) {
    const int count = std::min(kLinesAtOnce, family.num_lines - first);
    for (std::size_t v = 0; v < views.size(); ++v) {
      if (g.is_flat(views[v]) != family.flat) continue;
      float* const rays = detector + static_cast<std::ptrdiff_t>(v) * g.width * kLanes;
      int first_pixel = static_cast<int>(g.width), end_pixel = 0;
      for (int l = 0; l < count; ++l) {
        Crossing c = family.crossing(g, s, views[v], first + l);
        c.line.samples = samples + s.origin + (first + l) * family.line_stride;
        project_parts(c, family.sample_stride, rays);
        lines[l] = c.line;
        first_pixel = std::min(first_pixel, lines[l].first_pixel);
        end_pixel = std::max(end_pixel, lines[l].end_pixel);
      }
      kernels::project_lines(lines, count, family.sample_stride, first_pixel, end_pixel, rays);
    }
  }
}

void backproject_family(const geometry::TiltGeometry& g, const SampleSegment& s,
                        const Family& family, const float* detector, std::span<const int> views,
                        float* samples) {
  std::vector<LineCrossing> crossings;
  const int first = family.flat && s.cut_low ? -1 : 0;
  const int end = family.flat ? s.nx + (s.cut_high ? 1 : 0) : s.nz;
  for (int l = 0; l < family.num_lines; ++l) {
    crossings.clear();
    for (std::size_t v = 0; v < views.size(); ++v) {
      if (g.is_flat(views[v]) != family.flat) continue;
      Crossing c = family.crossing(g, s, views[v], l);
      c.line.detector = detector + static_cast<std::ptrdiff_t>(v) * g.width * kLanes;
      backproject_parts(c, family.sample_stride, samples + s.origin + l * family.line_stride);
      if (c.line.first_pixel < c.line.end_pixel) crossings.push_back(c.line);
    }
    if (crossings.empty()) continue;
    kernels::backproject_lines(crossings.data(), static_cast<int>(crossings.size()),
                               family.sample_stride, first, end,
                               samples + s.origin + l * family.line_stride);
  }
}

}  // namespace

std::size_t SlabProjector::detector_size(std::size_t num_views) const {
  return num_views * static_cast<std::size_t>(geometry_.width) * kLanes;
}

void SlabProjector::forward(float* samples, std::span<const int> views, float* detector) const {
  for (const SampleSegment& s : grid_.segments()) {
    fill_padding(s, samples);
    project_family(geometry_, s, rows_of(s), samples, views, detector);
    project_family(geometry_, s, columns_of(s), samples, views, detector);
  }
}

void SlabProjector::backward(const float* detector, std::span<const int> views,
                             float* samples) const {
  for (const SampleSegment& s : grid_.segments()) {
    backproject_family(geometry_, s, rows_of(s), detector, views, samples);
    backproject_family(geometry_, s, columns_of(s), detector, views, samples);
    fold_padding(s, samples);
  }
}

}  // namespace tomofield::projection
