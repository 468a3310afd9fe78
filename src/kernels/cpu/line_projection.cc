#include "kernels/line_projection.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "kernels/lanes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/line_projection.cc"
#include <hwy/foreach_target.h>
// Highway's own order of includes: foreach_target first.
#include "kernels/cpu/slab_vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
// Destinations are treated in tiles. What they take from four items (lines, or
// pairs of pixels of a view) is worked out first, a vector of destinations at a
// time, and then used. So the two taps of an item share an index, and the
// weights of four items are loaded together and broadcast in registers.
//
// Bound with AVX-512: an item of one slab is two loads of samples in two FMAs, one load of its
// index, half a load of weights and two broadcasts, which take one of the two ports of the FMAs:
// 1.75 cycles of two load ports and 2 of the two others for 16 rows. Of two slabs together index,
// weights and broadcasts are shared: 2.75 and 3 cycles for 32 rows, of which loading samples alone
// would be 2. Making the tables is another fifth (docs/results/speed.md).
constexpr int kTile = 32;
constexpr int kItems = 4;
constexpr int kMaxTables = 4;
using IntVec = hn::Vec<IntTag>;

// Two taps of one item for a vector of destinations: the source at `index`
// floats and the one after it.
struct Taps {
  IntVec index;
  Vec weight0, weight1;
};

struct TapTable {
  HWY_ALIGN int index[kTile][kItems];
  HWY_ALIGN float weight0[kTile][kItems], weight1[kTile][kItems];

  // `taps_of(item, t)` gives the taps of destinations t, t + 1, … for items [0, count); as many
  // destinations are filled as there are, or a few more.
  template <typename TapsOf>
  HWY_INLINE void fill(int count, int num_destinations, const TapsOf& taps_of) {
    const Taps none{hn::Zero(IntTag()), hn::Zero(Tag()), hn::Zero(Tag())};
    for (int t = 0; t < num_destinations; t += kVecLanes) {
      const Taps a = taps_of(0, t), b = count > 1 ? taps_of(1, t) : none;
      const Taps c = count > 2 ? taps_of(2, t) : none, d = count > 3 ? taps_of(3, t) : none;
      hn::StoreInterleaved4(a.index, b.index, c.index, d.index, IntTag(), index[t]);
      hn::StoreInterleaved4(a.weight0, b.weight0, c.weight0, d.weight0, Tag(), weight0[t]);
      hn::StoreInterleaved4(a.weight1, b.weight1, c.weight1, d.weight1, Tag(), weight1[t]);
    }
  }
};

// Sums of a destination; the taps of an item go to different ones, so that an
// addition waits for half as many others.
struct Sums {
  Vec of_tap0[kVecs], of_tap1[kVecs];
};

// Where the second of two slabs lies, in floats after the first.
struct Apart {
  std::ptrdiff_t source, out;
};

template <int kItem, int kSlabs>
HWY_INLINE void add_item(const float* source, std::ptrdiff_t next, const Apart& apart,
                         const TapTable& table, int t, Vec weights0, Vec weights1, Sums* sums) {
  const Tag d;
  const float* tap0 = source + table.index[t][kItem];
#if HWY_TARGET == HWY_SCALAR
  weights0 = hn::Set(d, table.weight0[t][kItem]);
  weights1 = hn::Set(d, table.weight1[t][kItem]);
#else
  weights0 = hn::Broadcast<kItem>(weights0);
  weights1 = hn::Broadcast<kItem>(weights1);
#endif
  for (int s = 0; s < kSlabs; ++s, tap0 += apart.source) {
    const float* const tap1 = tap0 + next;
    for (int v = 0; v < kVecs; ++v) {
      sums[s].of_tap0[v] =
          hn::MulAdd(weights0, hn::LoadU(d, tap0 + v * kVecLanes), sums[s].of_tap0[v]);
      sums[s].of_tap1[v] =
          hn::MulAdd(weights1, hn::LoadU(d, tap1 + v * kVecLanes), sums[s].of_tap1[v]);
    }
  }
}

// Adds what `num_tables` tables take to destinations [0, count), `stride`
// floats apart. Sources that follow each other are `next` floats apart.
template <int kSlabs>
HWY_INLINE void gather(const TapTable* tables, int num_tables, const float* source,
                       std::ptrdiff_t next, const Apart& apart, int count, std::ptrdiff_t stride,
                       float* out) {
  const Tag d;
  for (int t = 0; t < count; ++t, out += stride) {
    Sums sums[kSlabs];
    for (int s = 0; s < kSlabs; ++s) {
      for (int v = 0; v < kVecs; ++v) {
        sums[s].of_tap0[v] = hn::LoadU(d, out + s * apart.out + v * kVecLanes);
        sums[s].of_tap1[v] = hn::Zero(d);
      }
    }
    for (int i = 0; i < num_tables; ++i) {
      const Vec weights0 = hn::LoadDup128(d, tables[i].weight0[t]);
      const Vec weights1 = hn::LoadDup128(d, tables[i].weight1[t]);
      add_item<0, kSlabs>(source, next, apart, tables[i], t, weights0, weights1, sums);
      add_item<1, kSlabs>(source, next, apart, tables[i], t, weights0, weights1, sums);
      add_item<2, kSlabs>(source, next, apart, tables[i], t, weights0, weights1, sums);
      add_item<3, kSlabs>(source, next, apart, tables[i], t, weights0, weights1, sums);
    }
    for (int s = 0; s < kSlabs; ++s) {
      for (int v = 0; v < kVecs; ++v)
        hn::StoreU(hn::Add(sums[s].of_tap0[v], sums[s].of_tap1[v]), d,
                   out + s * apart.out + v * kVecLanes);
    }
  }
}

// first, first + 1, …; Highway's own Iota goes through memory.
HWY_INLINE Vec iota_from(int first) {
  return hn::Add(hn::Iota(Tag(), 0.0f), hn::Set(Tag(), static_cast<float>(first)));
}

// origin + stride · integer for integers below 2^22 in magnitude, held as floats:
// adding 1.5 · 2^23 leaves them in the low bits. The constant above them is
// taken off together with `origin`, modulo 2^32.
constexpr float kIntegerShift = 12582912.0f;
HWY_INLINE IntVec index_origin(std::ptrdiff_t origin, std::ptrdiff_t stride) {
  const auto wrapped = static_cast<std::uint32_t>(origin - stride * 0x4b400000);
  return hn::Set(IntTag(), static_cast<int>(wrapped));
}
HWY_INLINE IntVec integer_bits(Vec integral) {
  return hn::BitCast(IntTag(), hn::Add(integral, hn::Set(Tag(), kIntegerShift)));
}

// A line's numbers in vectors, so that they are made once a tile.
struct LineVectors {
  Vec step, offset, weight, first_pixel, last_pixel, low, high;
  HWY_INLINE explicit LineVectors(const LineCrossing& line)
      : step(hn::Set(Tag(), line.step)),
        offset(hn::Set(Tag(), line.offset)),
        weight(hn::Set(Tag(), line.weight)),
        first_pixel(hn::Set(Tag(), static_cast<float>(line.first_pixel))),
        last_pixel(hn::Set(Tag(), static_cast<float>(line.end_pixel - 1))),
        low(hn::Set(Tag(), line.low)),
        high(hn::Set(Tag(), line.high)) {}

  HWY_INLINE Vec position(Vec pixel) const { return hn::MulAdd(pixel, step, offset); }
  // Whether pixels weigh anything: those of the window, and within [low, high).
  HWY_INLINE auto sees(Vec pixel, Vec at) const {
    return hn::And(hn::And(hn::Ge(pixel, first_pixel), hn::Le(pixel, last_pixel)),
                   hn::And(hn::Ge(at, low), hn::Lt(at, high)));
  }
};

// Whether all of pixels [first, end) see the line.
HWY_INLINE bool all_see(const LineCrossing& line, int first, int end) {
  const float at_first = line.offset + line.step * static_cast<float>(first);
  const float at_last = line.offset + line.step * static_cast<float>(end - 1);
  // Wider than positions can differ by rounding.
  constexpr float kRounding = 0.01f;
  return first >= line.first_pixel && end <= line.end_pixel &&
         std::min(at_first, at_last) - kRounding >= line.low &&
         std::max(at_first, at_last) + kRounding < line.high;
}

// What pixels take of a line: a sample and the one after it.
struct ForwardItem {
  LineVectors line;
  IntVec origin, stride;
  HWY_INLINE ForwardItem(const LineCrossing& crossing, const float* source, std::ptrdiff_t step)
      : line(crossing),
        origin(index_origin(crossing.samples - source, step)),
        stride(hn::Set(IntTag(), static_cast<int>(step))) {}

  template <bool kAllSee>
  HWY_INLINE Taps taps(Vec pixel) const {
    const Vec position = line.position(pixel);
    Vec base = hn::Floor(position);
    const Vec fraction = hn::Sub(position, base);
    Vec weight = line.weight;
    if (!kAllSee) {
      const auto seen = line.sees(pixel, position);
      weight = hn::IfThenElseZero(seen, weight);
      base = hn::IfThenElseZero(seen, base);  // others may lie anywhere, but sample 0 exists
    }
    return {hn::Add(hn::Mul(stride, integer_bits(base)), origin),
            hn::NegMulAdd(weight, fraction, weight), hn::Mul(weight, fraction)};
  }
};

HWY_INLINE void fill_forward(const LineCrossing* lines, int count, const float* source,
                             std::ptrdiff_t stride, int tile, int end, TapTable& table) {
  bool seen = true;
  for (int k = 0; k < count; ++k) seen = seen && all_see(lines[k], tile, end);
  const int last = count - 1;
  const ForwardItem items[kItems] = {{lines[0], source, stride},
                                     {lines[std::min(1, last)], source, stride},
                                     {lines[std::min(2, last)], source, stride},
                                     {lines[last], source, stride}};
  if (seen) {
    table.fill(count, end - tile, [&](int k, int t) HWY_ATTR {
      return items[k].template taps<true>(iota_from(tile + t));
    });
  } else {
    table.fill(count, end - tile, [&](int k, int t) HWY_ATTR {
      return items[k].template taps<false>(iota_from(tile + t));
    });
  }
}

template <int kSlabs>
HWY_INLINE void project_slabs(const LineCrossing* lines, int num_lines, std::ptrdiff_t stride,
                              int first, int end, const Apart& apart, float* detector) {
  TapTable tables[kMaxTables];
  for (int group = 0; group < num_lines; group += kMaxTables * kItems) {
    const float* const source = lines[group].samples;
    for (int tile = first; tile < end; tile += kTile) {
      const int tile_end = std::min(end, tile + kTile);
      int num_tables = 0;
      for (int l = group; l < num_lines && num_tables < kMaxTables; l += kItems) {
        fill_forward(lines + l, std::min(kItems, num_lines - l), source, stride, tile, tile_end,
                     tables[num_tables++]);
      }
      gather<kSlabs>(tables, num_tables, source, stride, apart, tile_end - tile, kLanes,
                     detector + static_cast<std::ptrdiff_t>(tile) * kLanes);
    }
  }
}

void project_lines(const LineCrossing* lines, int num_lines, std::ptrdiff_t stride, int first,
                   int end, float* detector, const Slabs& slabs) {
  const Apart apart{slabs.samples_apart, slabs.detectors_apart};
  if (slabs.count == 2) {
    project_slabs<2>(lines, num_lines, stride, first, end, apart, detector);
  } else {
    project_slabs<1>(lines, num_lines, stride, first, end, apart, detector);
  }
}

// A pair of pixels of a view that samples take from.
struct PixelPair {
  const LineCrossing* view;
  int pair;      // of those that reach a sample
  bool is_only;  // there are no other pairs, and pixels that do not see the line do not reach
};

// How many pairs of pixels reach samples [first, end): one for |step| >= 1, more
// when samples are coarser than pixels, none for most tiles of a margin.
HWY_INLINE int num_pairs(const LineCrossing& view, int first, int end) {
  const float at_first = view.offset + view.step * static_cast<float>(view.first_pixel);
  const float at_last = view.offset + view.step * static_cast<float>(view.end_pixel - 1);
  if (view.first_pixel >= view.end_pixel ||
      std::max(at_first, at_last) < static_cast<float>(first) - 1.5f ||
      std::min(at_first, at_last) > static_cast<float>(end) + 0.5f) {
    return 0;
  }
  // Rounding of the first pixel can only lose a weight that is itself of the size of the rounding.
  return static_cast<int>(std::ceil((1.0f - 1e-6f) / std::abs(view.step)));
}

// Whether no pixel that does not see the line could reach samples [first, end).
HWY_INLINE bool none_is_cut_off(const LineCrossing& view, int first, int end) {
  const float low = static_cast<float>(first - 1), high = static_cast<float>(end);
  const auto is_clear = [&](int pixel) HWY_ATTR {
    const float position = view.offset + view.step * static_cast<float>(pixel);
    return position < low - 0.01f || position > high + 0.01f;
  };
  return view.low <= low && view.high >= high && is_clear(view.first_pixel - 1) &&
         is_clear(view.end_pixel);
}

// What samples take of a pair of pixels, which is shifted into the window if
// need be; the pixel past the window's end may be read, with weight 0.
struct AdjointItem {
  LineVectors line;
  // The pair starts at floor(inverse · sample + bias) + skipped: the same floor for all pairs.
  Vec inverse, bias, skipped;
  IntVec origin;
  HWY_INLINE AdjointItem(const PixelPair& item, const float* source)
      : line(*item.view), origin(index_origin(item.view->detector - source, kLanes)) {
    const float per_step = 1.0f / item.view->step;
    inverse = hn::Set(Tag(), per_step);
    bias = hn::Set(Tag(), -item.view->offset * per_step - std::abs(per_step));
    skipped = hn::Set(Tag(), static_cast<float>(2 * item.pair + 1));
  }

  HWY_INLINE Vec hat(Vec pixel, Vec sample) const {
    const Vec distance = hn::Abs(hn::Sub(line.position(pixel), sample));
    return hn::Max(hn::Zero(Tag()), hn::NegMulAdd(line.weight, distance, line.weight));
  }

  template <bool kIsOnly>
  HWY_INLINE Taps taps(Vec sample) const {
    static_assert(kLanes == 16);
    const Vec one = hn::Set(Tag(), 1.0f);
    const Vec pair = hn::Add(hn::Floor(hn::MulAdd(sample, inverse, bias)), skipped);
    const Vec pixel = hn::Min(hn::Max(pair, line.first_pixel), line.last_pixel);
    const Vec next = hn::Add(pixel, one);
    Taps taps{hn::Add(hn::ShiftLeft<4>(integer_bits(pixel)), origin), hat(pixel, sample),
              hat(next, sample)};
    if (kIsOnly) return taps;
    const auto counts = [&](Vec at) HWY_ATTR {
      const Vec from_pair = hn::Sub(at, pair);
      const auto is_ours = hn::And(hn::Ge(from_pair, hn::Zero(Tag())), hn::Le(from_pair, one));
      return hn::And(is_ours, line.sees(at, line.position(at)));
    };
    taps.weight0 = hn::IfThenElseZero(counts(pixel), taps.weight0);
    taps.weight1 = hn::IfThenElseZero(counts(next), taps.weight1);
    return taps;
  }
};

HWY_INLINE void fill_adjoint(const PixelPair* pairs, int count, const float* source, int tile,
                             int end, TapTable& table) {
  bool only = true;
  for (int k = 0; k < count; ++k) only = only && pairs[k].is_only;
  const int last = count - 1;
  const AdjointItem items[kItems] = {{pairs[0], source},
                                     {pairs[std::min(1, last)], source},
                                     {pairs[std::min(2, last)], source},
                                     {pairs[last], source}};
  if (only) {
    table.fill(count, end - tile, [&](int k, int t) HWY_ATTR {
      return items[k].template taps<true>(iota_from(tile + t));
    });
  } else {
    table.fill(count, end - tile, [&](int k, int t) HWY_ATTR {
      return items[k].template taps<false>(iota_from(tile + t));
    });
  }
}

template <int kSlabs>
HWY_INLINE void backproject_slabs(const LineCrossing* views, int num_views, std::ptrdiff_t stride,
                                  int first, int end, const Apart& apart, float* samples) {
  TapTable tables[kMaxTables];
  PixelPair items[kItems];
  for (int tile = first; tile < end; tile += kTile) {
    const int tile_end = std::min(end, tile + kTile);
    int num_tables = 0, count = 0;
    const auto use_tables = [&]() HWY_ATTR {
      gather<kSlabs>(tables, num_tables, views->detector, kLanes, apart, tile_end - tile, stride,
                     samples + tile * stride);
      num_tables = 0;
    };
    const auto fill_table = [&]() HWY_ATTR {
      fill_adjoint(items, count, views->detector, tile, tile_end, tables[num_tables++]);
      count = 0;
      if (num_tables == kMaxTables) use_tables();
    };
    for (int v = 0; v < num_views; ++v) {
      const int pairs = num_pairs(views[v], tile, tile_end);
      const bool is_only = pairs == 1 && none_is_cut_off(views[v], tile, tile_end);
      for (int pair = 0; pair < pairs; ++pair) {
        items[count++] = {&views[v], pair, is_only};
        if (count == kItems) fill_table();
      }
    }
    if (count > 0) fill_table();
    if (num_tables > 0) use_tables();
  }
}

void backproject_lines(const LineCrossing* views, int num_views, std::ptrdiff_t stride, int first,
                       int end, float* samples, const Slabs& slabs) {
  const Apart apart{slabs.detectors_apart, slabs.samples_apart};
  if (slabs.count == 2) {
    backproject_slabs<2>(views, num_views, stride, first, end, apart, samples);
  } else {
    backproject_slabs<1>(views, num_views, stride, first, end, apart, samples);
  }
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(project_lines);
HWY_EXPORT(backproject_lines);
void project_lines(const LineCrossing* lines, int num_lines, std::ptrdiff_t stride, int first,
                   int end, float* detector, const Slabs& slabs) {
  HWY_DYNAMIC_DISPATCH(project_lines)(lines, num_lines, stride, first, end, detector, slabs);
}
void backproject_lines(const LineCrossing* views, int num_views, std::ptrdiff_t stride, int first,
                       int end, float* samples, const Slabs& slabs) {
  HWY_DYNAMIC_DISPATCH(backproject_lines)(views, num_views, stride, first, end, samples, slabs);
}
}  // namespace tomofield::kernels
#endif
