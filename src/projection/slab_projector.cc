#include "projection/slab_projector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/range.h"
#include "kernels/lanes.h"
#include "kernels/line_projection.h"

namespace tomofield::projection {
namespace {

using kernels::CrossingGroup;
using kernels::kLanes;
using kernels::LineCrossing;
using kernels::SlabGroup;

using Beam = SlabProjector::Beam;

// Lines and views are processed in blocks over tiles of samples that fit in L1. Each sample or
// pixel is then loaded from a farther cache once for several uses.
constexpr int kLinesAtOnce = 8;
constexpr int kGroupsAtOnce = 2;  // groups of views
constexpr int kSamplesAtOnce = 32;

Beam row_beam(const geometry::TiltGeometry& g, const SampleSegment& s, int view) {
  const double cosine = g.cos_tilt(view), tangent = g.signed_sin_tilt(view) / cosine;
  return {.flat = true,
          .offset = (g.ray_x(view, 0.5, 0.5 * s.hz) - s.x0) / s.hx - 0.5,
          .offset_per_line = -tangent * s.hz / s.hx,
          .step = 1.0 / (s.hx * cosine),
          .weight = static_cast<float>(s.hz / cosine),
          .spread = s.hz * std::abs(tangent) / s.hx};
}

Beam column_beam(const geometry::TiltGeometry& g, const SampleSegment& s, int view) {
  const double sine = g.signed_sin_tilt(view), cotangent = g.cos_tilt(view) / sine;
  return {.flat = false,
          .offset = g.ray_z(view, 0.5, s.x0 + 0.5 * s.hx) / s.hz - 0.5,
          .offset_per_line = -cotangent * s.hx / s.hz,
          .step = 1.0 / (s.hz * sine),
          .weight = static_cast<float>(s.hx / std::abs(sine)),
          .spread = s.hx * std::abs(cotangent) / s.hz};
}

// The lines of a segment that one kind of view (flat or steep) crosses.
struct LineFamily {
  bool flat;
  int num_lines, num_samples;
  std::ptrdiff_t origin, line_stride, sample_stride;
  bool cut_low, cut_high;  // true if the lines end at a face where another segment continues
};

LineFamily rows_of(const SampleSegment& s) {
  return {true, s.nz, s.nx, s.origin, s.stride_z(), kLanes, s.cut_low, s.cut_high};
}
LineFamily columns_of(const SampleSegment& s) {
  return {false, s.nx, s.nz, s.origin, kLanes, s.stride_z(), false, false};
}

// A line as a view sees it. The line represents a piece of each ray, which spans some width along
// the line. If that piece straddles a cut face, the line counts only for the part on its side. The
// pieces of a ray on both sides of the face, which differ in length, then add up correctly. Few
// pixels are affected: those of [part_first, part_end) outside the range of `line`. They are
// processed here.
struct Crossing {
  LineCrossing& line;
  double offset = 0, step = 1;  // position(pixel), as in LineCrossing
  int part_first = 0, part_end = 0;
  double low_face = 0, high_face = 0, spread = 0;  // measured in samples

  double position(int pixel) const { return offset + step * pixel; }
  // Returns the share of a pixel's piece that lies within the faces.
  double share(int pixel) const {
    const double p = position(pixel);
    return std::clamp(std::min(p - low_face, high_face - p) / spread + 0.5, 0.0, 1.0);
  }
};

// Returns the first pixel whose position is at least `position`; steps are positive.
int first_pixel_from(const Crossing& c, double position, int width) {
  const double pixel = std::ceil((position - c.offset) / c.step);
  return static_cast<int>(std::clamp(pixel, 0.0, static_cast<double>(width)));
}

// Writes what the view sees of a line to `seen`, except for the pointers to samples or pixels.
Crossing crossing(const Beam& beam, const LineFamily& family, int line, int width,
                  LineCrossing& seen) {
  Crossing c{seen, beam.offset + line * beam.offset_per_line, beam.step};
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
  c.part_first = first_pixel_from(c, std::max(c.low_face - half, -1.0), width);
  c.line.first_pixel = first_pixel_from(c, std::max(c.low_face + half, -1.0), width);
  c.line.end_pixel = first_pixel_from(c, std::min(c.high_face - half, end), width);
  c.part_end = first_pixel_from(c, std::min(c.high_face + half, end), width);
  return c;
}

// Repeats the last sample of cut sides in the padding, so that the field is constant up to the
// face.
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

// Calls visit(pixel, lower sample, its weight, weight of the next) for the pixels that count only
// in part.
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

void project_parts(const Crossing& c, std::ptrdiff_t stride, const SlabGroup& slabs,
                   float* detector) {
  for_each_part(c, [&](int pixel, std::ptrdiff_t lower, float low_weight, float high_weight) {
    const float* sample = c.line.samples + lower * stride;
    float* out = detector + static_cast<std::ptrdiff_t>(pixel) * kLanes;
    for (int s = 0; s < slabs.count; ++s) {
      for (int l = 0; l < kLanes; ++l)
        out[l] += low_weight * sample[l] + high_weight * sample[stride + l];
      sample += slabs.samples_apart;
      out += slabs.detectors_apart;
    }
  });
}

void backproject_parts(const Crossing& c, std::ptrdiff_t stride, const SlabGroup& slabs,
                       float* samples) {
  for_each_part(c, [&](int pixel, std::ptrdiff_t lower, float low_weight, float high_weight) {
    float* sample = samples + lower * stride;
    const float* in = c.line.detector + static_cast<std::ptrdiff_t>(pixel) * kLanes;
    for (int s = 0; s < slabs.count; ++s) {
      for (int l = 0; l < kLanes; ++l) {
        sample[l] += low_weight * in[l];
        sample[stride + l] += high_weight * in[l];
      }
      sample += slabs.samples_apart;
      in += slabs.detectors_apart;
    }
  });
}

// Returns the pixels, among those `reached` at all, that cross the middle of a block of lines
// within a tile of samples. The first and the last tile take all pixels beyond them.
base::Range pixels_of_tile(const Beam& beam, const LineFamily& family, double middle_line, int tile,
                           base::Range reached) {
  const double inverse = 1.0 / beam.step;
  const bool falls = beam.step < 0;
  const auto pixel_at = [&](int sample) {
    const double pixel =
        (sample - beam.offset - middle_line * beam.offset_per_line) * inverse + 1.0;
    return static_cast<int>(std::clamp<double>(pixel, reached.begin, reached.end));
  };
  const int end = tile + kSamplesAtOnce;
  const int low = tile > 0 ? pixel_at(tile) : falls ? reached.end : reached.begin;
  const int high = end < family.num_samples ? pixel_at(end) : falls ? reached.begin : reached.end;
  return {std::min(low, high), std::max(low, high)};
}

base::Range reached_by_any(std::span<const CrossingGroup> groups) {
  base::Range all;
  for (const CrossingGroup& group : groups) all = all.joined_with(group.reached);
  return all;
}

void project_family(const LineFamily& family, const std::vector<Beam>& beams, int width,
                    const SlabGroup& slabs, const float* samples, std::span<const int> views,
                    float* detector) {
  std::vector<std::vector<CrossingGroup>> groups(views.size());
  std::array<LineCrossing, kLinesAtOnce> lines;
  const auto beam_of = [&](std::size_t v) -> const Beam& {
    return beams[static_cast<std::size_t>(views[v])];
  };
  const auto rays_of = [&](std::size_t v) {
    return detector + static_cast<std::ptrdiff_t>(v) * width * kLanes;
  };
  for (int first = 0; first < family.num_lines; first += kLinesAtOnce) {
    const int count = std::min(kLinesAtOnce, family.num_lines - first);
    for (std::size_t v = 0; v < views.size(); ++v) {
      if (beam_of(v).flat != family.flat) continue;
      for (int l = 0; l < count; ++l) {
        LineCrossing& line = lines[static_cast<std::size_t>(l)];
        line.samples = samples + family.origin + (first + l) * family.line_stride;
        project_parts(crossing(beam_of(v), family, first + l, width, line), family.sample_stride,
                      slabs, rays_of(v));
      }
      groups[v].clear();
      kernels::group_lines(std::span(lines).first(static_cast<std::size_t>(count)), samples,
                           groups[v]);
    }
    for (int tile = 0; tile < family.num_samples; tile += kSamplesAtOnce) {
      for (std::size_t v = 0; v < views.size(); ++v) {
        if (beam_of(v).flat != family.flat) continue;
        const base::Range pixels = pixels_of_tile(beam_of(v), family, first + 0.5 * (count - 1),
                                                  tile, reached_by_any(groups[v]));
        kernels::project_lines(groups[v].data(), static_cast<int>(groups[v].size()), samples,
                               family.sample_stride, pixels.begin, pixels.end, rays_of(v), slabs);
      }
    }
  }
}

// Clears rows [first, first + count) with their padding, and the padding rows before the first and
// after the last row. This happens right before they are added to, so that they are then in a
// cache.
void clear_rows(const LineFamily& rows, int first, int count, const SlabGroup& slabs,
                float* samples) {
  const int from = first == 0 ? -1 : first;
  const int end = first + count == rows.num_lines ? first + count + 1 : first + count;
  for (int s = 0; s < slabs.count; ++s, samples += slabs.samples_apart)
    std::fill_n(samples + rows.origin - kLanes + from * rows.line_stride,
                (end - from) * rows.line_stride, 0.0f);
}

void backproject_family(const LineFamily& family, const std::vector<Beam>& beams, int width,
                        const SlabGroup& slabs, const float* detector, std::span<const int> views,
                        float* samples) {
  std::array<std::vector<CrossingGroup>, kLinesAtOnce> groups;
  std::vector<LineCrossing> crossings;
  const int first_sample = family.cut_low ? -1 : 0;
  const int end_sample = family.num_samples + (family.cut_high ? 1 : 0);
  const auto line_at = [&](int line) {
    return samples + family.origin + line * family.line_stride;
  };
  for (int first = 0; first < family.num_lines; first += kLinesAtOnce) {
    const int count = std::min(kLinesAtOnce, family.num_lines - first);
    if (family.flat) clear_rows(family, first, count, slabs, samples);
    for (int l = 0; l < count; ++l) {
      crossings.clear();
      for (std::size_t v = 0; v < views.size(); ++v) {
        const Beam& beam = beams[static_cast<std::size_t>(views[v])];
        if (beam.flat != family.flat) continue;
        LineCrossing& view = crossings.emplace_back();
        view.detector = detector + static_cast<std::ptrdiff_t>(v) * width * kLanes;
        backproject_parts(crossing(beam, family, first + l, width, view), family.sample_stride,
                          slabs, line_at(first + l));
      }
      groups[static_cast<std::size_t>(l)].clear();
      kernels::group_views(crossings, detector, groups[static_cast<std::size_t>(l)]);
    }
    const auto is_shorter = [](const auto& a, const auto& b) { return a.size() < b.size(); };
    const std::size_t most =
        std::max_element(groups.begin(), groups.begin() + count, is_shorter)->size();
    for (int tile = first_sample; tile < end_sample; tile += kSamplesAtOnce) {
      const int tile_end = std::min(end_sample, tile + kSamplesAtOnce);
      for (std::size_t g = 0; g < most; g += kGroupsAtOnce) {
        for (int l = 0; l < count; ++l) {
          const std::span<const CrossingGroup> all = groups[static_cast<std::size_t>(l)];
          if (g >= all.size()) continue;
          const auto some = all.subspan(g, std::min<std::size_t>(kGroupsAtOnce, all.size() - g));
          kernels::backproject_lines(some.data(), static_cast<int>(some.size()), detector,
                                     family.sample_stride, tile, tile_end, line_at(first + l),
                                     slabs);
        }
      }
    }
  }
}

}  // namespace

SlabProjector::SlabProjector(const geometry::TiltGeometry& geometry, const SampleGrid& grid)
    : geometry_(geometry), grid_(grid) {
  for (const SampleSegment& s : grid_.segments()) {
    std::vector<Beam>& beams = beams_.emplace_back();
    for (int v = 0; v < geometry_.num_views(); ++v) {
      beams.push_back(geometry_.is_flat(v) ? row_beam(geometry_, s, v)
                                           : column_beam(geometry_, s, v));
    }
  }
}

std::size_t SlabProjector::detector_size(std::size_t num_views) const {
  return (num_views * static_cast<std::size_t>(geometry_.width) + 1) * kLanes;
}

// Calls project for pairs of slabs. The last of an odd number is projected alone.
template <typename ProjectSlabs>
void for_each_pair(int num_slabs, std::ptrdiff_t samples, std::ptrdiff_t detector,
                   const ProjectSlabs& project) {
  constexpr int kTogether = SlabProjector::kSlabsTogether;
  for (int slab = 0; slab < num_slabs; slab += kTogether)
    project(SlabGroup{std::min(kTogether, num_slabs - slab), samples, detector}, slab * samples,
            slab * detector);
}

void SlabProjector::forward(float* samples, std::span<const int> views, float* detector,
                            int num_slabs) const {
  const int width = static_cast<int>(geometry_.width);
  const auto samples_apart = static_cast<std::ptrdiff_t>(grid_.size());
  const auto detectors_apart = static_cast<std::ptrdiff_t>(detector_size(views.size()));
  for (std::size_t i = 0; i < beams_.size(); ++i) {
    const SampleSegment& s = grid_.segments()[i];
    for (int slab = 0; slab < num_slabs; ++slab) fill_padding(s, samples + slab * samples_apart);
    for_each_pair(
        num_slabs, samples_apart, detectors_apart, [&](const SlabGroup& slabs, auto at, auto rays) {
          project_family(rows_of(s), beams_[i], width, slabs, samples + at, views, detector + rays);
          project_family(columns_of(s), beams_[i], width, slabs, samples + at, views,
                         detector + rays);
        });
  }
}

void SlabProjector::backward(const float* detector, std::span<const int> views, float* samples,
                             int num_slabs) const {
  const int width = static_cast<int>(geometry_.width);
  const auto samples_apart = static_cast<std::ptrdiff_t>(grid_.size());
  const auto detectors_apart = static_cast<std::ptrdiff_t>(detector_size(views.size()));
  for (std::size_t i = 0; i < beams_.size(); ++i) {
    const SampleSegment& s = grid_.segments()[i];
    for_each_pair(num_slabs, samples_apart, detectors_apart,
                  [&](const SlabGroup& slabs, auto at, auto rays) {
                    // Rows come first, because they clear what columns add to.
                    backproject_family(rows_of(s), beams_[i], width, slabs, detector + rays, views,
                                       samples + at);
                    backproject_family(columns_of(s), beams_[i], width, slabs, detector + rays,
                                       views, samples + at);
                  });
    for (int slab = 0; slab < num_slabs; ++slab) fold_padding(s, samples + slab * samples_apart);
  }
}

}  // namespace tomofield::projection
