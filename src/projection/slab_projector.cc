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

// Narrows a crossing to the pixels whose position can lie in [low, high); the
// kernel tests the exact condition.
void set_pixel_range(double offset, double step, std::int64_t width, LineCrossing& line) {
  const double a = (static_cast<double>(line.low) - offset) / step;
  const double b = (static_cast<double>(line.high) - offset) / step;
  const double limit = static_cast<double>(width);
  line.first_pixel = static_cast<int>(std::clamp(std::floor(std::min(a, b)), 0.0, limit));
  line.end_pixel = static_cast<int>(std::clamp(std::ceil(std::max(a, b)) + 1.0, 0.0, limit));
  line.offset = static_cast<float>(offset);
  line.step = static_cast<float>(step);
}

// Narrowest fade at a cut, in pixels: only so wide that rounding of a position
// cannot drop or double a ray that runs along the face.
constexpr double kNarrowestFade = 1.0 / 64;

// Row k of a segment as a flat view sees it. The row stands for a piece of ray
// that is hz high and hz tan θ wide; at a cut face the row counts for as much of
// it as lies on its side, so that a ray's pieces on both sides, which differ in
// height, add up to its length.
LineCrossing row_crossing(const geometry::TiltGeometry& g, const SampleSegment& s, int view,
                          int k) {
  const double z = (k + 0.5) * s.hz;
  const double cosine = g.cos_tilt(view);
  LineCrossing line;
  line.low = -1.0f;
  line.high = static_cast<float>(s.nx);
  line.weight = static_cast<float>(s.hz / cosine);
  const double tangent = std::abs(g.signed_sin_tilt(view)) / cosine;
  const double fade = std::min(1.0, std::max(s.hz * tangent, kNarrowestFade) / s.hx);
  if (s.cut_low) {
    line.low = static_cast<float>(-0.5 - fade / 2);
    line.fade_low = static_cast<float>(s.hz / cosine / fade);
  }
  if (s.cut_high) {
    line.high = static_cast<float>(s.nx - 0.5 + fade / 2);
    line.fade_high = static_cast<float>(s.hz / cosine / fade);
  }
  set_pixel_range((g.ray_x(view, 0.5, z) - s.x0) / s.hx - 0.5, 1.0 / (s.hx * cosine), g.width,
                  line);
  return line;
}

// Column i of a segment as a steep view sees it.
LineCrossing column_crossing(const geometry::TiltGeometry& g, const SampleSegment& s, int view,
                             int i) {
  const double x = s.x0 + (i + 0.5) * s.hx;
  const double sine = g.signed_sin_tilt(view);
  LineCrossing line;
  line.low = -1.0f;
  line.high = static_cast<float>(s.nz);
  line.weight = static_cast<float>(s.hx / std::abs(sine));
  set_pixel_range(g.ray_z(view, 0.5, x) / s.hz - 0.5, 1.0 / (s.hz * sine), g.width, line);
  return line;
}

// The two families of lines of a segment: rows for flat views, columns for steep ones.
struct Family {
  bool flat;
  int num_lines;
  std::ptrdiff_t line_stride, sample_stride;
  LineCrossing crossing(const geometry::TiltGeometry& g, const SampleSegment& s, int view,
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

void project_family(const geometry::TiltGeometry& g, const SampleSegment& s, const Family& family,
                    const float* samples, std::span<const int> views, float* detector) {
  LineCrossing lines[kLinesAtOnce];
  for (int first = 0; first < family.num_lines; first += kLinesAtOnce) {
    const int count = std::min(kLinesAtOnce, family.num_lines - first);
    for (std::size_t v = 0; v < views.size(); ++v) {
      if (g.is_flat(views[v]) != family.flat) continue;
      int first_pixel = static_cast<int>(g.width), end_pixel = 0;
      for (int l = 0; l < count; ++l) {
        lines[l] = family.crossing(g, s, views[v], first + l);
        lines[l].samples = samples + s.origin + (first + l) * family.line_stride;
        first_pixel = std::min(first_pixel, lines[l].first_pixel);
        end_pixel = std::max(end_pixel, lines[l].end_pixel);
      }
      kernels::project_lines(lines, count, family.sample_stride, first_pixel, end_pixel,
                             detector + static_cast<std::ptrdiff_t>(v) * g.width * kLanes);
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
      LineCrossing line = family.crossing(g, s, views[v], l);
      if (line.first_pixel >= line.end_pixel) continue;
      line.detector = detector + static_cast<std::ptrdiff_t>(v) * g.width * kLanes;
      crossings.push_back(line);
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
