#include "kernels/line_projection.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "kernels/lanes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/cpu/line_projection.cc"
#include <hwy/foreach_target.h>
// Highway requires foreach_target to come before its other headers.
#include "kernels/cpu/slab_vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tomofield::kernels::HWY_NAMESPACE {
// Destinations (pixels forward, samples back) are processed in tiles. For each tile, a table first
// receives the indices and weights of the two taps of every item of a group; an item is a line, or
// a pair of pixels of a view. Then the sums are gathered. The two taps of an item thus share an
// index, and the weights of four items are loaded together and broadcast in registers.
//
// The bound with AVX-512, for one item and the 32 rows of two slabs: four loads of samples inside
// four FMAs, a load of the index, half a load of weights, and two broadcasts, which use one of the
// two ports of the FMAs. That is 2.75 cycles of the two load ports and 3 cycles of the two others;
// loading the samples alone would take 2. With two address additions and a share of the work for
// the destination, there are some eleven instructions. They are the limit if another hardware
// thread is busy on the same core, which is why loops are unrolled and constants are known at
// compile time. Making the tables takes another sixth of the time (docs/results/speed.md).
constexpr int kTile = 32;
constexpr int kItems = CrossingGroup::kMax;
constexpr int kMaxTables = 2;
using IntVec = hn::Vec<IntTag>;
template <typename T>
using Numbers = CrossingGroup::Numbers<T>;

// A vector holds numbers of kItemsAVector items for kDestinations destinations.
constexpr int kItemsAVector = std::min(kItems, kVecLanes);
constexpr int kDestinations = kVecLanes / kItemsAVector;
static_assert(kItemsAVector == 4 || kItemsAVector == 1);

// The two taps of a vector of items: the source at `index` floats and the next source.
struct Taps {
  IntVec index;
  Vec weight0, weight1;
};

struct TapTable {
  HWY_ALIGN int index[kTile][kItems];
  HWY_ALIGN float weight0[kTile][kItems], weight1[kTile][kItems];

  HWY_INLINE void store(int t, int k, const Taps& taps) {
    hn::StoreU(taps.index, IntTag(), &index[t][k]);
    hn::StoreU(taps.weight0, Tag(), &weight0[t][k]);
    hn::StoreU(taps.weight1, Tag(), &weight1[t][k]);
  }
};

// Computes the taps of a group's items for destinations [first, end), or for a few more.
template <typename Items, bool kWhole>
HWY_INLINE void fill(const CrossingGroup& group, std::ptrdiff_t next, int first, int end,
                     TapTable& table) {
  const Tag d;
  constexpr int kLog2Items = kItemsAVector == 4 ? 2 : 0;
  const Vec lane = hn::ConvertTo(d, hn::ShiftRight<kLog2Items>(hn::Iota(IntTag(), 0)));
  const Vec step = hn::Set(d, static_cast<float>(kDestinations));
  for (int k = 0; k < kItems; k += kItemsAVector) {
    const Items items(group, k, next);
    Vec at = hn::Add(lane, hn::Set(d, static_cast<float>(first)));
    for (int t = 0; t < end - first; t += kDestinations, at = hn::Add(at, step))
      table.store(t, k, items.template taps<kWhole>(at));
  }
}

// The sums of a destination. The two taps of an item go to different sums, so that half as many
// additions depend on each other.
struct Sums {
  Vec of_tap0[kVecs], of_tap1[kVecs];
};

// The distance from the first of two slabs to the second, in floats.
struct Apart {
  std::ptrdiff_t source, out;
};

// The distance of consecutive sources in floats. A compile-time constant saves address arithmetic.
using Adjacent = std::integral_constant<std::ptrdiff_t, kLanes>;

template <int kItem>
HWY_INLINE Vec weight_of_item([[maybe_unused]] const float* weights,
                              [[maybe_unused]] Vec duplicated) {
#if HWY_TARGET == HWY_SCALAR
  return hn::Set(Tag(), weights[kItem]);
#else
  return hn::Broadcast<kItem>(duplicated);
#endif
}

template <int kItem, int kSlabs, typename Next>
HWY_INLINE void add_item(const float* source, Next next, Apart apart, const TapTable& table, int t,
                         Vec weights0, Vec weights1, Sums* sums) {
  const Tag d;
  const float* tap0 = source + table.index[t][kItem];
  weights0 = weight_of_item<kItem>(table.weight0[t], weights0);
  weights1 = weight_of_item<kItem>(table.weight1[t], weights1);
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

// Adds the tables' contributions to destinations [0, count), which are `stride` floats apart.
template <int kSlabs, int kTables, typename Next>
HWY_INLINE void gather(const TapTable* tables, const float* source, Next next, Apart apart,
                       int count, std::ptrdiff_t stride, float* out) {
  const Tag d;
  for (int t = 0; t < count; ++t, out += stride) {
    Sums sums[kSlabs];
    for (int s = 0; s < kSlabs; ++s) {
      for (int v = 0; v < kVecs; ++v) {
        sums[s].of_tap0[v] = hn::LoadU(d, out + s * apart.out + v * kVecLanes);
        sums[s].of_tap1[v] = hn::Zero(d);
      }
    }
    for (int i = 0; i < kTables; ++i) {
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

template <typename Items, int kSlabs, typename Next>
void take_from_groups(const CrossingGroup* groups, int num_groups, const float* source, Next next,
                      int first, int end, const Apart& apart, float* out, std::ptrdiff_t stride) {
  TapTable tables[kMaxTables];
  for (int tile = first; tile < end; tile += kTile) {
    const int tile_end = std::min(end, tile + kTile);
    int num_tables = 0;
    const auto use_tables = [&]() HWY_ATTR {
      static_assert(kMaxTables == 2);
      const auto gather_tables =
          num_tables == 2 ? gather<kSlabs, 2, Next> : gather<kSlabs, 1, Next>;
      gather_tables(tables, source, next, apart, tile_end - tile, stride, out + tile * stride);
      num_tables = 0;
    };
    for (int g = 0; g < num_groups; ++g) {
      if (!groups[g].reached.overlaps({tile, tile_end})) continue;
      if (groups[g].whole.contains({tile, tile_end})) {
        fill<Items, true>(groups[g], next, tile, tile_end, tables[num_tables++]);
      } else {
        fill<Items, false>(groups[g], next, tile, tile_end, tables[num_tables++]);
      }
      if (num_tables == kMaxTables) use_tables();
    }
    if (num_tables > 0) use_tables();
  }
}

HWY_INLINE Vec of_items(const Numbers<float>& numbers, int k) {
  return hn::LoadDup128(Tag(), &numbers[k]);
}

// These two functions compute origin + stride · n for integers n below 2^22 in magnitude that are
// held as floats. Adding 1.5 · 2^23 leaves n in the low bits. The constant bits above n are
// subtracted together with `origin`, modulo 2^32.
constexpr float kIntegerShift = 12582912.0f;
constexpr std::ptrdiff_t kShiftBits = 0x4b400000;
HWY_INLINE IntVec index_origin(const Numbers<int>& origin, int k, std::ptrdiff_t stride) {
  const auto shift = static_cast<std::uint32_t>(stride * kShiftBits);
  return hn::Sub(hn::LoadDup128(IntTag(), &origin[k]), hn::Set(IntTag(), static_cast<int>(shift)));
}
HWY_INLINE IntVec integer_bits(Vec integral) {
  return hn::BitCast(IntTag(), hn::Add(integral, hn::Set(Tag(), kIntegerShift)));
}

// A vector of a group's crossings, from item k on.
struct Lines {
  Vec step, offset, weight, first_pixel, last_pixel, low, high;
  HWY_INLINE Lines(const CrossingGroup& group, int k)
      : step(of_items(group.step, k)),
        offset(of_items(group.offset, k)),
        weight(of_items(group.weight, k)),
        first_pixel(of_items(group.first_pixel, k)),
        last_pixel(of_items(group.last_pixel, k)),
        low(of_items(group.low, k)),
        high(of_items(group.high, k)) {}

  HWY_INLINE Vec position(Vec pixel) const { return hn::MulAdd(pixel, step, offset); }
  // Returns a mask of the pixels that have weight: those in the window and within [low, high).
  HWY_INLINE auto sees(Vec pixel, Vec at) const {
    return hn::And(hn::And(hn::Ge(pixel, first_pixel), hn::Le(pixel, last_pixel)),
                   hn::And(hn::Ge(at, low), hn::Lt(at, high)));
  }
};

// Computes what pixels take from lines: a sample and the one after it.
struct ForwardItems {
  Lines lines;
  IntVec origin, stride;
  HWY_INLINE ForwardItems(const CrossingGroup& group, int k, std::ptrdiff_t next)
      : lines(group, k),
        origin(index_origin(group.origin, k, next)),
        stride(hn::Set(IntTag(), static_cast<int>(next))) {}

  template <bool kAllSee>
  HWY_INLINE Taps taps(Vec pixel) const {
    const Vec position = lines.position(pixel);
    Vec base = hn::Floor(position);
    const Vec fraction = hn::Sub(position, base);
    Vec weight = lines.weight;
    if (!kAllSee) {
      const auto seen = lines.sees(pixel, position);
      weight = hn::IfThenElseZero(seen, weight);
      base = hn::IfThenElseZero(seen, base);  // sample 0 exists; other bases may be out of bounds
    }
    return {hn::Add(hn::Mul(stride, integer_bits(base)), origin),
            hn::NegMulAdd(weight, fraction, weight), hn::Mul(weight, fraction)};
  }
};

// Computes what samples take from pairs of pixels. A pair is moved into the window if it lies
// outside. The pixel past the window's end may be read, with weight 0.
struct AdjointItems {
  Lines lines;
  Vec inverse, bias, skipped;
  IntVec origin;
  HWY_INLINE AdjointItems(const CrossingGroup& group, int k, std::ptrdiff_t next)
      : lines(group, k),
        inverse(of_items(group.inverse, k)),
        bias(of_items(group.bias, k)),
        skipped(of_items(group.skipped, k)),
        origin(index_origin(group.origin, k, next)) {}

  HWY_INLINE Vec hat(Vec pixel, Vec sample) const {
    const Vec distance = hn::Abs(hn::Sub(lines.position(pixel), sample));
    return hn::Max(hn::Zero(Tag()), hn::NegMulAdd(lines.weight, distance, lines.weight));
  }

  HWY_INLINE Taps pair_of(Vec pixel, Vec sample) const {
    static_assert(kLanes == 16);
    return {hn::Add(hn::ShiftLeft<4>(integer_bits(pixel)), origin), hat(pixel, sample),
            hat(hn::Add(pixel, hn::Set(Tag(), 1.0f)), sample)};
  }

  template <bool kIsOnly>
  HWY_INLINE Taps taps(Vec sample) const {
    const Vec one = hn::Set(Tag(), 1.0f);
    if (kIsOnly) return pair_of(hn::Floor(hn::MulAdd(sample, inverse, hn::Add(bias, one))), sample);
    const Vec pair = hn::Add(hn::Floor(hn::MulAdd(sample, inverse, bias)), skipped);
    const Vec pixel = hn::Min(hn::Max(pair, lines.first_pixel), lines.last_pixel);
    const Vec next = hn::Add(pixel, one);
    Taps taps = pair_of(pixel, sample);
    const auto counts = [&](Vec at) HWY_ATTR {
      const Vec from_pair = hn::Sub(at, pair);
      const auto is_ours = hn::And(hn::Ge(from_pair, hn::Zero(Tag())), hn::Le(from_pair, one));
      return hn::And(is_ours, lines.sees(at, lines.position(at)));
    };
    taps.weight0 = hn::IfThenElseZero(counts(pixel), taps.weight0);
    taps.weight1 = hn::IfThenElseZero(counts(next), taps.weight1);
    return taps;
  }
};

template <int kSlabs>
void project_slabs(const CrossingGroup* groups, int num_groups, const float* samples,
                   std::ptrdiff_t stride, int first, int end, const Apart& apart, float* detector) {
  if (stride == kLanes) {
    take_from_groups<ForwardItems, kSlabs>(groups, num_groups, samples, Adjacent(), first, end,
                                           apart, detector, kLanes);
  } else {
    take_from_groups<ForwardItems, kSlabs>(groups, num_groups, samples, stride, first, end, apart,
                                           detector, kLanes);
  }
}

void project_lines(const CrossingGroup* groups, int num_groups, const float* samples,
                   std::ptrdiff_t stride, int first, int end, float* detector,
                   const SlabGroup& slabs) {
  const Apart apart{slabs.samples_apart, slabs.detectors_apart};
  (slabs.count == 2 ? project_slabs<2> : project_slabs<1>)(groups, num_groups, samples, stride,
                                                           first, end, apart, detector);
}

void backproject_lines(const CrossingGroup* groups, int num_groups, const float* detector,
                       std::ptrdiff_t stride, int first, int end, float* samples,
                       const SlabGroup& slabs) {
  const Apart apart{slabs.detectors_apart, slabs.samples_apart};
  const auto backproject = slabs.count == 2 ? take_from_groups<AdjointItems, 2, Adjacent>
                                            : take_from_groups<AdjointItems, 1, Adjacent>;
  backproject(groups, num_groups, detector, Adjacent(), first, end, apart, samples, stride);
}

}  // namespace tomofield::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tomofield::kernels {
HWY_EXPORT(project_lines);
HWY_EXPORT(backproject_lines);
void project_lines(const CrossingGroup* groups, int num_groups, const float* samples,
                   std::ptrdiff_t stride, int first, int end, float* detector,
                   const SlabGroup& slabs) {
  HWY_DYNAMIC_DISPATCH(project_lines)
  (groups, num_groups, samples, stride, first, end, detector, slabs);
}
void backproject_lines(const CrossingGroup* groups, int num_groups, const float* detector,
                       std::ptrdiff_t stride, int first, int end, float* samples,
                       const SlabGroup& slabs) {
  HWY_DYNAMIC_DISPATCH(backproject_lines)
  (groups, num_groups, detector, stride, first, end, samples, slabs);
}
}  // namespace tomofield::kernels
#endif
