#include "projection/slab_projector.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "base/threads/parallel.h"
#include "kernels/lanes.h"

namespace tomofield::projection {
namespace {

using base::Range;
using kernels::CrossingGroup;
using kernels::kLanes;
using kernels::SlabGroup;

// Lines and views are processed in blocks over tiles of samples that fit in L1. Each sample or
// pixel is then loaded from a farther cache once for several uses.
constexpr int kGroupsAtOnce = 2;  // groups of views
constexpr int kSamplesAtOnce = 32;

// Pixels or samples of a task along x. The rays of the pixels of some views, or the samples of a
// block of lines, then fit in L2.
constexpr int kTaskWidth = 64;

// Repeats the last sample of cut sides in the padding, so that the field is constant up to the
// face.
void fill_padding_of(const SampleSegment& s, float* samples) {
  for (int k = 0; k < s.nz; ++k) {
    float* row = samples + s.origin + k * s.stride_z();
    float* end = row + static_cast<std::ptrdiff_t>(s.nx) * kLanes;
    if (s.cut_low) std::copy_n(row, kLanes, row - kLanes);
    if (s.cut_high) std::copy_n(end - kLanes, kLanes, end);
  }
}

// Adds the padding of cut sides to the sample beside it, if that is in `x`.
void fold_padding(const SampleSegment& s, Range x, float* samples) {
  const auto fold = [](float* padding, float* sample) {
    for (int l = 0; l < kLanes; ++l) {
      sample[l] += padding[l];
      padding[l] = 0.0f;
    }
  };
  for (int k = 0; k < s.nz; ++k) {
    float* row = samples + s.origin + k * s.stride_z();
    float* end = row + static_cast<std::ptrdiff_t>(s.nx) * kLanes;
    if (s.cut_low && x.begin <= 0) fold(row - kLanes, row);
    if (s.cut_high && x.end >= s.nx) fold(end, end - kLanes);
  }
}

void project_part(const PartialPixel& part, const LineFamily& family, const SlabGroup& slabs,
                  const float* samples, float* rays) {
  const float* sample =
      samples + family.origin + part.line * family.line_stride + part.lower * family.sample_stride;
  float* out = rays + static_cast<std::ptrdiff_t>(part.pixel) * kLanes;
  for (int s = 0; s < slabs.count; ++s) {
    for (int l = 0; l < kLanes; ++l)
      out[l] += part.low_weight * sample[l] + part.high_weight * sample[family.sample_stride + l];
    sample += slabs.samples_apart;
    out += slabs.detectors_apart;
  }
}

// Adds to those of the part's two samples that are in `x`.
void backproject_part(const PartialPixel& part, const LineFamily& family, Range x,
                      const SlabGroup& slabs, const float* rays, float* samples) {
  float* sample =
      samples + family.origin + part.line * family.line_stride + part.lower * family.sample_stride;
  const float* in = rays + static_cast<std::ptrdiff_t>(part.pixel) * kLanes;
  const int lower = static_cast<int>(part.lower);
  for (int s = 0; s < slabs.count; ++s) {
    for (int l = 0; l < kLanes && x.contains(lower); ++l) sample[l] += part.low_weight * in[l];
    for (int l = 0; l < kLanes && x.contains(lower + 1); ++l)
      sample[family.sample_stride + l] += part.high_weight * in[l];
    sample += slabs.samples_apart;
    in += slabs.detectors_apart;
  }
}

// How a view crosses the middle line of a block: pixel u at sample offset + u step.
struct MiddleLine {
  double offset, step;

  MiddleLine(const LineBlock::View& view, Range lines)
      : offset(view.beam.offset +
               (lines.begin + 0.5 * (lines.size() - 1)) * view.beam.offset_per_line),
        step(view.beam.step) {}

  // Returns the tile in which a pixel lies.
  int tile_of(int pixel, int num_tiles) const {
    const double tile = std::floor((offset + step * pixel) / kSamplesAtOnce);
    return static_cast<int>(std::clamp<double>(tile, 0, num_tiles - 1));
  }
  // Returns the tiles in which the pixels lie, and one more on either side for rounding.
  Range tiles_of(Range pixels, int num_tiles) const {
    const auto [low, high] =
        std::minmax({tile_of(pixels.begin, num_tiles), tile_of(pixels.end - 1, num_tiles)});
    return Range{low - 1, high + 2}.common_with({0, num_tiles});
  }
  // Returns the pixels, among those `reached` at all, that lie in a tile of samples. The first and
  // the last tile take all pixels beyond them.
  Range pixels_of(int tile, int num_tiles, Range reached) const {
    const double inverse = 1.0 / step;
    const bool falls = step < 0;
    const auto pixel_at = [&](int sample) {
      const double pixel = (sample - offset) * inverse + 1.0;
      return static_cast<int>(std::clamp<double>(pixel, reached.begin, reached.end));
    };
    const int first = tile * kSamplesAtOnce, end = first + kSamplesAtOnce;
    const int low = tile > 0 ? pixel_at(first) : falls ? reached.end : reached.begin;
    const int high = tile + 1 < num_tiles ? pixel_at(end) : falls ? reached.begin : reached.end;
    return {std::min(low, high), std::max(low, high)};
  }
};

// Projects a block of lines to some pixels, tile by tile, for all views in turn.
void project_block(const LineFamily& family, const LineBlock& block, Range pixels, int width,
                   const SlabGroup& slabs, const float* samples, float* detector) {
  const auto rays_of = [&](std::size_t view) {
    return detector + static_cast<std::ptrdiff_t>(view) * width * kLanes;
  };
  for (const PartialPixel& part : block.parts) {
    if (pixels.contains(part.pixel)) project_part(part, family, slabs, samples, rays_of(part.view));
  }
  const int num_tiles = (family.num_samples + kSamplesAtOnce - 1) / kSamplesAtOnce;
  Range tiles;
  for (const LineBlock::View& view : block.views) {
    const Range reached = view.reached.common_with(pixels);
    if (!reached.is_empty())
      tiles = tiles.joined_with(MiddleLine(view, block.lines).tiles_of(reached, num_tiles));
  }
  for (int tile = tiles.begin; tile < tiles.end; ++tile) {
    for (const LineBlock::View& view : block.views) {
      const Range reached = view.reached.common_with(pixels);
      if (reached.is_empty()) continue;
      const Range seen = MiddleLine(view, block.lines).pixels_of(tile, num_tiles, reached);
      if (seen.is_empty()) continue;
      kernels::project_lines(view.lines.data(), static_cast<int>(view.lines.size()), samples,
                             family.sample_stride, seen.begin, seen.end, rays_of(view.index),
                             slabs);
    }
  }
}

// Clears samples `x` of rows `lines`, and what lies beside them: padding at both ends of a row, and
// the rows of padding before the first and after the last row. This happens right before they are
// added to, so that they are then in a cache.
void clear_rows(const LineFamily& rows, Range lines, Range x, const SlabGroup& slabs,
                float* samples) {
  const int from = lines.begin == 0 ? -1 : lines.begin;
  const int end = lines.end == rows.num_lines ? lines.end + 1 : lines.end;
  const std::ptrdiff_t first = x.begin <= 0 ? -1 : x.begin;
  const std::ptrdiff_t past =
      x.end >= rows.num_samples ? rows.line_stride / kLanes - 1 : std::ptrdiff_t{x.end};
  for (int s = 0; s < slabs.count; ++s, samples += slabs.samples_apart) {
    for (int row = from; row < end; ++row)
      std::fill_n(samples + rows.origin + row * rows.line_stride + first * kLanes,
                  (past - first) * kLanes, 0.0f);
  }
}

// Backprojects to samples `x` of lines `lines`, which are of one block.
void backproject_block(const LineFamily& family, const LineBlock& block, Range lines, Range x,
                       int width, const SlabGroup& slabs, const float* detector, float* samples) {
  for (const PartialPixel& part : block.parts) {
    if (lines.contains(part.line))
      backproject_part(part, family, x, slabs,
                       detector + static_cast<std::ptrdiff_t>(part.view) * width * kLanes, samples);
  }
  const auto groups_of = [&](int line) -> std::span<const CrossingGroup> {
    return block.views_of_line[static_cast<std::size_t>(line - block.lines.begin)];
  };
  std::size_t most = 0;
  for (int line = lines.begin; line < lines.end; ++line)
    most = std::max(most, groups_of(line).size());
  for (int tile = x.begin; tile < x.end; tile += kSamplesAtOnce) {
    const int tile_end = std::min(x.end, tile + kSamplesAtOnce);
    for (std::size_t g = 0; g < most; g += kGroupsAtOnce) {
      for (int line = lines.begin; line < lines.end; ++line) {
        const std::span<const CrossingGroup> all = groups_of(line);
        if (g >= all.size()) continue;
        const auto some = all.subspan(g, std::min<std::size_t>(kGroupsAtOnce, all.size() - g));
        kernels::backproject_lines(some.data(), static_cast<int>(some.size()), detector,
                                   family.sample_stride, tile, tile_end,
                                   samples + family.origin + line * family.line_stride, slabs);
      }
    }
  }
}

}  // namespace

SlabProjector::SlabProjector(const geometry::TiltGeometry& geometry, const SampleGrid& grid)
    : geometry_(geometry),
      grid_(grid),
      pixel_ranges_(base::parts_of(static_cast<int>(geometry.width), kTaskWidth)) {
  for (std::size_t i = 0; i < grid_.segments().size(); ++i)
    for (const Range x : base::parts_of(grid_.segments()[i].nx, kTaskWidth))
      sample_ranges_.push_back({i, x});
}

std::size_t SlabProjector::detector_size(std::size_t num_views) const {
  return (num_views * static_cast<std::size_t>(geometry_.width) + 1) * kLanes;
}

void SlabProjector::fill_padding(float* samples, int num_slabs) const {
  for (int slab = 0; slab < num_slabs; ++slab, samples += grid_.size())
    for (const SampleSegment& s : grid_.segments()) fill_padding_of(s, samples);
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

void SlabProjector::forward(float* samples, const ViewCrossings& crossings, float* detector,
                            int num_slabs) const {
  fill_padding(samples, num_slabs);
  base::parallel_for("project", std::ssize(pixel_ranges_), [&](std::int64_t i) {
    forward_pixels(samples, crossings, pixel_ranges_[static_cast<std::size_t>(i)], detector,
                   num_slabs);
  });
}

void SlabProjector::forward_pixels(const float* samples, const ViewCrossings& crossings,
                                   Range pixels, float* detector, int num_slabs) const {
  const int width = static_cast<int>(geometry_.width);
  const auto samples_apart = static_cast<std::ptrdiff_t>(grid_.size());
  const auto detectors_apart = static_cast<std::ptrdiff_t>(detector_size(crossings.num_views()));
  for_each_pair(
      num_slabs, samples_apart, detectors_apart, [&](const SlabGroup& slabs, auto at, auto rays) {
        for (std::size_t i = 0; i < grid_.segments().size(); ++i) {
          for (const ViewCrossings::Lines* lines : {&crossings.rows(i), &crossings.columns(i)}) {
            for (const LineBlock& block : lines->blocks)
              project_block(lines->family, block, pixels, width, slabs, samples + at,
                            detector + rays);
          }
        }
      });
}

void SlabProjector::backward(const float* detector, const ViewCrossings& crossings, float* samples,
                             int num_slabs) const {
  const std::int64_t num_pairs = (num_slabs + kSlabsTogether - 1) / kSlabsTogether;
  const std::size_t rays = detector_size(crossings.num_views());
  base::parallel_for("backproject", num_pairs * std::ssize(sample_ranges_), [&](std::int64_t i) {
    const auto first = static_cast<int>(i / std::ssize(sample_ranges_)) * kSlabsTogether;
    const auto range = static_cast<std::size_t>(i % std::ssize(sample_ranges_));
    backward_samples(detector + static_cast<std::size_t>(first) * rays, crossings,
                     sample_ranges_[range],
                     samples + static_cast<std::size_t>(first) * grid_.size(),
                     std::min(kSlabsTogether, num_slabs - first));
  });
}

void SlabProjector::backward_samples(const float* detector, const ViewCrossings& crossings,
                                     const SamplesOfSegment& part, float* samples,
                                     int num_slabs) const {
  const int width = static_cast<int>(geometry_.width);
  const auto samples_apart = static_cast<std::ptrdiff_t>(grid_.size());
  const auto detectors_apart = static_cast<std::ptrdiff_t>(detector_size(crossings.num_views()));
  const ViewCrossings::Lines &rows = crossings.rows(part.segment),
                             &columns = crossings.columns(part.segment);
  const Range padded = rows.family.padded_samples();
  const Range x{part.x.begin == 0 ? padded.begin : part.x.begin,
                part.x.end == rows.family.num_samples ? padded.end : part.x.end};
  for_each_pair(num_slabs, samples_apart, detectors_apart,
                [&](const SlabGroup& slabs, auto at, auto rays) {
                  // Rows come first, because they clear what columns add to.
                  for (const LineBlock& block : rows.blocks) {
                    clear_rows(rows.family, block.lines, part.x, slabs, samples + at);
                    backproject_block(rows.family, block, block.lines, x, width, slabs,
                                      detector + rays, samples + at);
                  }
                  for (const LineBlock& block : columns.blocks) {
                    const Range lines = block.lines.common_with(part.x);
                    if (lines.is_empty()) continue;
                    backproject_block(columns.family, block, lines, columns.family.padded_samples(),
                                      width, slabs, detector + rays, samples + at);
                  }
                });
  for (int slab = 0; slab < num_slabs; ++slab)
    fold_padding(grid_.segments()[part.segment], part.x, samples + slab * samples_apart);
}

}  // namespace tomofield::projection
