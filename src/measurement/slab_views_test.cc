#include "measurement/slab_views.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <set>
#include <span>

#include "base/random.h"
#include "base/threads/parallel.h"

namespace tomofield::measurement {
namespace {

constexpr SlabViews::Shape kShape{
    .num_views = 3, .width = 21, .height = 60, .first_row = 5, .num_rows = 39};
constexpr double kUnit = 4.0;

float pixel_of(std::size_t view, std::int64_t x, std::int64_t y) {
  return static_cast<float>(
      std::sin(static_cast<double>(x * 7 + y * 3) + static_cast<double>(view)));
}

// Three quarters of the pixels at random.
bool is_valid(std::size_t view, std::int64_t x, std::int64_t y) {
  return base::Random(11 + view, static_cast<std::uint64_t>(y * kShape.width + x)).below(4) > 0;
}

std::unique_ptr<SlabViews> make_views(
    const SlabViews::Holding& holding = {SlabViews::all_slabs(kShape)},
    std::size_t in_memory_bytes = std::size_t{1} << 30) {
  const auto read = [](std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) {
    for (std::int64_t y = 0; y < kShape.height; ++y) {
      for (std::int64_t x = 0; x < kShape.width; ++x) {
        const auto at = static_cast<std::size_t>(y * kShape.width + x);
        image[at] = pixel_of(view, x, y);
        valid[at] = is_valid(view, x, y);
      }
    }
  };
  return std::make_unique<SlabViews>(kShape, holding, kUnit, read_on_all_threads(read), "/tmp",
                                     in_memory_bytes);
}

TEST(SlabViews, SomeSlabsAreThoseOfTheWhole) {
  const auto all = make_views();
  std::int64_t num_valid = 0;
  for (const SlabViews::Holding& holding : {SlabViews::Holding{{0, 2}, 1}, {{2, 3}, 0}}) {
    const SlabViews::Slabs own = holding.own, held = holding.all();
    const auto some = make_views(holding);
    EXPECT_EQ(some->own(), own);
    EXPECT_EQ(some->num_slabs(), all->num_slabs());
    num_valid += some->num_valid(1);
    for (std::int64_t y = held.begin * 16; y < std::min<std::int64_t>(held.end * 16, 39); ++y) {
      for (std::int64_t x = 0; x < kShape.width; ++x) {
        ASSERT_EQ(some->counts(1, x, y), all->counts(1, x, y));
        ASSERT_EQ(some->ray(1, x, y), all->ray(1, x, y));
      }
    }
    const auto coarse = some->binned(2), all_coarse = all->binned(2);
    EXPECT_EQ(coarse->own(), (SlabViews::Slabs{own.begin / 2, (own.end + 1) / 2}));
    for (std::int64_t y = own.begin * 8; y < std::min<std::int64_t>(own.end * 8, 20); ++y)
      ASSERT_EQ(coarse->ray(2, 7, y), all_coarse->ray(2, 7, y));
  }
  EXPECT_EQ(num_valid, all->num_valid(1));
}

TEST(SlabViews, RowsAreCopied) {
  const auto all = make_views();
  const std::vector<int> every = {0, 1, 2}, some = {2, 0};
  const auto middle = all->rows({9, 29}, some);
  ASSERT_EQ(middle->shape().num_rows, 20);
  ASSERT_EQ(middle->shape().num_views, 2u);
  for (int v = 0; v < 2; ++v) {
    const int from = some[static_cast<std::size_t>(v)];
    for (std::int64_t y = 0; y < 20; ++y) {
      for (std::int64_t x = 0; x < kShape.width; ++x) {
        ASSERT_EQ(middle->counts(v, x, y), all->counts(from, x, y + 9));
        ASSERT_EQ(middle->ray(v, x, y), all->ray(from, x, y + 9));
      }
    }
  }
  EXPECT_EQ(all->rows({0, static_cast<int>(kShape.num_rows)}, every)->checksum(), all->checksum());
}

// A disc in the middle of two slabs, one that reaches over an edge, and one far outside.
std::vector<std::vector<tilt_series::MaskDisc>> some_discs() {
  return {{{10.2, 16.4, 3.7}, {0.3, 38.5, 2.0}}, {}, {{-40, 3, 4}, {15.5, 31.5, 4.0}}};
}

bool is_in_disc(std::size_t view, std::int64_t x, std::int64_t y) {
  const double px = static_cast<double>(x) + 0.5, py = static_cast<double>(y) + 0.5;
  return std::ranges::any_of(some_discs()[view], [&](const tilt_series::MaskDisc& disc) {
    return std::hypot(px - disc.x_px, py - disc.y_px) <= disc.radius_px;
  });
}

TEST(SlabViews, DiscsHideTheRaysInThem) {
  const auto whole = make_views(), before = make_views();
  whole->hide(some_discs());
  std::vector<double> masked(3, 0.0);
  for (std::size_t v = 0; v < 3; ++v) {
    const int view = static_cast<int>(v);
    for (std::int64_t y = 0; y < kShape.num_rows; ++y) {
      for (std::int64_t x = 0; x < kShape.width; ++x) {
        const bool counts = before->counts(view, x, y) && !is_in_disc(v, x, y);
        ASSERT_EQ(whole->counts(view, x, y), counts);
        ASSERT_EQ(whole->ray(view, x, y), counts ? before->ray(view, x, y) : 0.0f);
        masked[v] += counts ? 0 : 1;
      }
    }
    EXPECT_NEAR(whole->masked_parts()[v], masked[v] / (21 * 39), 1e-12);
  }
  EXPECT_GT(whole->masked_parts()[0], before->masked_parts()[0]);
}

TEST(SlabViews, DiscsHideTheSameRaysInAShareAndInAScratchFile) {
  const auto whole = make_views();
  whole->hide(some_discs());
  for (const SlabViews::Holding& holding : {SlabViews::Holding{{0, 2}, 1}, {{2, 3}, 0}}) {
    const auto share = make_views(holding);
    share->hide(some_discs());
    const SlabViews::Slabs held = holding.all();
    for (std::int64_t y = held.begin * 16; y < std::min<std::int64_t>(held.end * 16, 39); ++y)
      for (std::int64_t x = 0; x < kShape.width; ++x)
        ASSERT_EQ(share->counts(2, x, y), whole->counts(2, x, y));
  }
  const auto in_file = make_views({SlabViews::all_slabs(kShape)}, /*in_memory_bytes=*/0);
  in_file->hide(some_discs());
  EXPECT_EQ(in_file->checksum(), whole->checksum());
}

TEST(SlabViews, AreTheSameOnAnyNumberOfThreads) {
  const std::vector<int> some = {2, 0};
  const auto checksums = [&](int threads) {
    base::set_thread_count(threads);
    const auto all = make_views();
    const std::array<std::uint64_t, 4> found = {all->checksum(), all->binned(2)->checksum(),
                                                all->binned(4)->checksum(),
                                                all->rows({9, 29}, some)->checksum()};
    base::set_thread_count(0);
    return found;
  };
  const auto on_one = checksums(1);
  EXPECT_EQ(std::set(on_one.begin(), on_one.end()).size(), on_one.size());
  EXPECT_EQ(checksums(3), on_one);
  EXPECT_EQ(checksums(5), on_one);
}

TEST(SlabViews, ChecksumSeesEveryPixelAndMask) {
  constexpr SlabViews::Shape kSmall{.num_views = 2, .width = 3, .height = 33, .num_rows = 33};
  const auto checksum = [&](std::size_t view, std::size_t pixel, float value, bool is_valid) {
    return SlabViews(
               kSmall, 1.0,
               [&](std::size_t v, std::span<float> image, std::span<std::uint8_t> valid) {
                 std::ranges::fill(valid, std::uint8_t{1});
                 if (v != view) return;
                 image[pixel] = value;
                 valid[pixel] = is_valid;
               },
               "/tmp")
        .checksum();
  };
  std::set<std::uint64_t> all = {checksum(0, 0, 0.0f, true)};
  std::size_t count = 1;
  for (const std::size_t view : {0u, 1u}) {
    for (const std::size_t pixel : {0u, 2u, 47u, 48u, 98u}) {
      all.insert(checksum(view, pixel, 1.0f, true));
      all.insert(checksum(view, pixel, 0.0f, false));
      count += 2;
    }
  }
  EXPECT_EQ(all.size(), count);
}

TEST(SlabViews, MoreViewsThanAreReadAtATime) {
  constexpr SlabViews::Shape kMany{.num_views = 150, .width = 2, .height = 17, .num_rows = 17};
  const SlabViews views(
      kMany, 1.0,
      [](std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) {
        for (std::size_t i = 0; i < image.size(); ++i) {
          EXPECT_EQ(image[i], 0.0f) << "a used buffer";
          image[i] = static_cast<float>(view * 100 + i);
          valid[i] = i != view % image.size();
        }
      },
      "/tmp");
  for (int view = 0; view < 150; ++view) {
    for (std::int64_t i = 0; i < 34; ++i) {
      ASSERT_EQ(views.counts(view, i % 2, i / 2), i != view % 34) << view;
      ASSERT_EQ(views.ray(view, i % 2, i / 2),
                i != view % 34 ? static_cast<float>(view * 100 + i) : 0.0f);
    }
  }
}

// Pages of files that the process holds, in bytes.
std::size_t mapped_bytes() {
  std::ifstream statm("/proc/self/statm");
  std::size_t size = 0, resident = 0, shared = 0;
  statm >> size >> resident >> shared;
  return shared * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

TEST(SlabViews, RaysOfALargeSeriesAreReleasedAndComeBack) {
  constexpr SlabViews::Shape kWide{.num_views = 4, .width = 4000, .height = 48, .num_rows = 48};
  const auto read = [](std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) {
    for (std::size_t i = 0; i < image.size(); ++i) {
      image[i] = static_cast<float>(view + i % 977);
      valid[i] = i % 5 > 0;
    }
  };
  const SlabViews in_memory(kWide, kUnit, read, "/tmp");
  const SlabViews in_file(kWide, kUnit, read, "/tmp", 1000);
  // The code that runs here is mapped from a file as well, so it runs once before it is measured.
  EXPECT_EQ(in_file.checksum(), in_memory.checksum());
  EXPECT_EQ(in_file.num_valid(3), in_memory.num_valid(3));
  for (int slab = 0; slab < 3; ++slab) in_file.release(slab);
  const std::size_t before = mapped_bytes();
  float sum = 0;
  for (int v = 0; v < 4; ++v)
    for (std::int64_t i = 0; i < kWide.width * 16; ++i) sum += in_file.rays(1, v)[i];
  EXPECT_GT(sum, 0);
  constexpr std::size_t kSlab = 4 * 4000 * 64;
  EXPECT_GT(mapped_bytes(), before + kSlab * 9 / 10);
  for (int slab = 0; slab < 3; ++slab) in_file.release(slab);
  EXPECT_LT(mapped_bytes(), before + kSlab / 4);
  EXPECT_EQ(in_file.checksum(), in_memory.checksum());
  EXPECT_LT(mapped_bytes(), before + kSlab / 4);
}

TEST(SlabViews, BinnedAreMeansOfWhatCountsFromTheFirstRowOn) {
  const auto fine = make_views();
  for (const int bin : {2, 4}) {
    const auto coarse = fine->binned(bin);
    const SlabViews::Shape& shape = coarse->shape();
    EXPECT_EQ(shape.width, (21 + bin - 1) / bin);
    EXPECT_EQ(shape.num_rows, (39 + bin - 1) / bin);
    std::int64_t counting = 0, not_counting = 0;
    for (std::size_t v = 0; v < kShape.num_views; ++v) {
      for (std::int64_t cy = 0; cy < shape.num_rows; ++cy) {
        for (std::int64_t cx = 0; cx < shape.width; ++cx) {
          double sum = 0;
          int count = 0;
          for (std::int64_t y = cy * bin; y < (cy + 1) * bin && y < kShape.num_rows; ++y) {
            for (std::int64_t x = cx * bin; x < (cx + 1) * bin && x < kShape.width; ++x) {
              if (!is_valid(v, x, y + kShape.first_row)) continue;
              sum += static_cast<double>(pixel_of(v, x, y + kShape.first_row));
              ++count;
            }
          }
          const bool expected = count * 2 >= bin * bin;
          ASSERT_EQ(coarse->counts(static_cast<int>(v), cx, cy), expected) << cx << " " << cy;
          ++(expected ? counting : not_counting);
          if (!expected) continue;
          // Data units a density unit, and a ray is a bin-th as many pixels long.
          ASSERT_NEAR(coarse->ray(static_cast<int>(v), cx, cy), sum / count / kUnit / bin, 1e-6);
        }
      }
    }
    EXPECT_GT(counting, 0);
    EXPECT_GT(not_counting, 0);
  }
}

}  // namespace
}  // namespace tomofield::measurement
