#include "kernels/line_projection.h"

#include <algorithm>
#include <cmath>

#include "kernels/lanes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/line_projection.cc"
#include <hwy/foreach_target.h>
// Highway's own order of includes: foreach_target first.
#include "kernels/cpu/slab_vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
// Destinations are treated in tiles; the weights of a tile are worked out
// first, a vector of destinations at a time, then used as broadcasts.
constexpr int kTile = 16;

struct TapTable {
  HWY_ALIGN int index[kTile];
  HWY_ALIGN float weight[kTile];
};

HWY_INLINE void add_tap(const float* source, float weight, Vec (&acc)[kVecs]) {
  const Tag d;
  const Vec w = hn::Set(d, weight);
  for (int v = 0; v < kVecs; ++v)
    acc[v] = hn::MulAdd(w, hn::LoadU(d, source + v * kVecLanes), acc[v]);
}

HWY_INLINE void load_sample(const float* p, Vec (&acc)[kVecs]) {
  for (int v = 0; v < kVecs; ++v) acc[v] = hn::LoadU(Tag(), p + v * kVecLanes);
}

HWY_INLINE void store_sample(const Vec (&acc)[kVecs], float* p) {
  for (int v = 0; v < kVecs; ++v) hn::StoreU(acc[v], Tag(), p + v * kVecLanes);
}

HWY_INLINE Vec iota_from(int first) { return hn::ConvertTo(Tag(), hn::Iota(IntTag(), first)); }

// Lower sample and the two weights of pixels first … first + kTile − 1.
HWY_INLINE void forward_taps(const LineCrossing& line, int first, TapTable& lower,
                             float* upper_weight) {
  const Tag d;
  const Vec weight = hn::Set(d, line.weight);
  for (int t = 0; t < kTile; t += kVecLanes) {
    const Vec pixel = iota_from(first + t);
    const Vec position = hn::MulAdd(pixel, hn::Set(d, line.step), hn::Set(d, line.offset));
    const auto inside = hn::And(
        hn::And(hn::Ge(position, hn::Set(d, line.low)), hn::Lt(position, hn::Set(d, line.high))),
        hn::And(hn::Ge(pixel, hn::Set(d, static_cast<float>(line.first_pixel))),
                hn::Lt(pixel, hn::Set(d, static_cast<float>(line.end_pixel)))));
    const Vec base = hn::Floor(position);
    const Vec fraction = hn::Sub(position, base);
    const Vec upper = hn::IfThenElseZero(inside, hn::Mul(weight, fraction));
    const Vec low = hn::IfThenElseZero(inside, hn::NegMulAdd(weight, fraction, weight));
    hn::Store(hn::ConvertTo(IntTag(), hn::IfThenElseZero(inside, base)), IntTag(), lower.index + t);
    hn::Store(low, d, lower.weight + t);
    hn::Store(upper, d, upper_weight + t);
  }
}

void project_lines(const LineCrossing* lines, int num_lines, std::ptrdiff_t stride, int first,
                   int end, float* detector) {
  constexpr int kMaxLines = 8;
  TapTable lower[kMaxLines];
  HWY_ALIGN float upper[kMaxLines][kTile];
  for (int group = 0; group < num_lines; group += kMaxLines) {
    const int count = std::min(kMaxLines, num_lines - group);
    const LineCrossing* const g = lines + group;
    for (int tile = first; tile < end; tile += kTile) {
      for (int l = 0; l < count; ++l) forward_taps(g[l], tile, lower[l], upper[l]);
      const int in_tile = std::min(kTile, end - tile);
      for (int t = 0; t < in_tile; ++t) {
        float* const out = detector + static_cast<std::ptrdiff_t>(tile + t) * kLanes;
        Vec acc[kVecs];
        load_sample(out, acc);
        for (int l = 0; l < count; ++l) {
          const float* const sample = g[l].samples + lower[l].index[t] * stride;
          add_tap(sample, lower[l].weight[t], acc);
          add_tap(sample + stride, upper[l][t], acc);
        }
        store_sample(acc, out);
      }
    }
  }
}

// Tap `tap` of samples first …: pixel index and weight; taps outside weigh 0
// and point at a pixel that exists.
HWY_INLINE void adjoint_taps(const LineCrossing& view, int first, int tap, TapTable& table) {
  const Tag d;
  const Vec step = hn::Set(d, view.step);
  const Vec offset = hn::Set(d, view.offset);
  const Vec inverse = hn::Set(d, 1.0f / view.step);
  const Vec reach = hn::Set(d, std::abs(1.0f / view.step));
  const Vec one = hn::Set(d, 1.0f);
  const Vec first_pixel = hn::Set(d, static_cast<float>(view.first_pixel));
  const Vec last_pixel = hn::Set(d, static_cast<float>(view.end_pixel - 1));
  for (int t = 0; t < kTile; t += kVecLanes) {
    const Vec sample = iota_from(first + t);
    const Vec centre = hn::Mul(hn::Sub(sample, offset), inverse);
    const Vec pixel =
        hn::Add(hn::Floor(hn::Sub(centre, reach)), hn::Set(d, 1.0f + static_cast<float>(tap)));
    const Vec position = hn::MulAdd(pixel, step, offset);
    const Vec hat = hn::Max(hn::Zero(d), hn::Sub(one, hn::Abs(hn::Sub(position, sample))));
    const auto inside = hn::And(
        hn::And(hn::Ge(position, hn::Set(d, view.low)), hn::Lt(position, hn::Set(d, view.high))),
        hn::And(hn::Ge(pixel, first_pixel), hn::Le(pixel, last_pixel)));
    hn::Store(hn::IfThenElseZero(inside, hn::Mul(hn::Set(d, view.weight), hat)), d,
              table.weight + t);
    const Vec clamped = hn::Min(hn::Max(pixel, first_pixel), last_pixel);
    hn::Store(hn::ConvertTo(IntTag(), clamped), IntTag(), table.index + t);
  }
}

// Whether any pixel of the view can reach samples [first, end): most tiles of
// a margin are seen by few views.
HWY_INLINE bool reaches(const LineCrossing& view, int first, int end) {
  const float p0 = view.offset + view.step * static_cast<float>(view.first_pixel);
  const float p1 = view.offset + view.step * static_cast<float>(view.end_pixel - 1);
  return view.first_pixel < view.end_pixel && std::max(p0, p1) > static_cast<float>(first) - 1.5f &&
         std::min(p0, p1) < static_cast<float>(end) + 0.5f;
}

// Pixels that can reach a sample: two for |step| >= 1, more when samples are
// coarser than pixels. Rounding of the first one can only lose a weight that
// is itself of the size of the rounding.
HWY_INLINE int num_taps(float step) {
  return static_cast<int>(std::ceil((2.0f - 1e-6f) / std::abs(step)));
}

void backproject_lines(const LineCrossing* views, int num_views, std::ptrdiff_t stride, int first,
                       int end, float* samples) {
  constexpr int kMaxTables = 24;
  TapTable tables[kMaxTables];
  const float* sources[kMaxTables];
  for (int tile = first; tile < end; tile += kTile) {
    const int in_tile = std::min(kTile, end - tile);
    int view = 0, tap = 0;
    while (view < num_views) {
      int count = 0;
      while (view < num_views && count < kMaxTables) {
        if (tap >= num_taps(views[view].step) || !reaches(views[view], tile, tile + in_tile)) {
          ++view;
          tap = 0;
          continue;
        }
        adjoint_taps(views[view], tile, tap++, tables[count]);
        sources[count++] = views[view].detector;
      }
      if (count == 0) continue;
      for (int t = 0; t < in_tile; ++t) {
        float* const out = samples + (tile + t) * stride;
        Vec acc[kVecs];
        load_sample(out, acc);
        for (int k = 0; k < count; ++k) {
          add_tap(sources[k] + static_cast<std::ptrdiff_t>(tables[k].index[t]) * kLanes,
                  tables[k].weight[t], acc);
        }
        store_sample(acc, out);
      }
    }
  }
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(project_lines);
HWY_EXPORT(backproject_lines);
void project_lines(const LineCrossing* lines, int num_lines, std::ptrdiff_t stride, int first,
                   int end, float* detector) {
  HWY_DYNAMIC_DISPATCH(project_lines)(lines, num_lines, stride, first, end, detector);
}
void backproject_lines(const LineCrossing* views, int num_views, std::ptrdiff_t stride, int first,
                       int end, float* samples) {
  HWY_DYNAMIC_DISPATCH(backproject_lines)(views, num_views, stride, first, end, samples);
}
}  // namespace tomofield::kernels
#endif
