#include "tilt_series/half_stacks.h"

#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "base/random.h"
#include "expect_parts.h"
#include "pixel_stack.h"
#include "scratch_directory.h"
#include "tomofield/error.h"
#include "warning_catcher.h"

namespace tomofield::tilt_series {
namespace {

using testing::message_of;
using testing::ScratchDirectory;
using testing::write_stack;

constexpr std::int64_t kWidth = 24, kHeight = 20, kSections = 3;
const std::vector<std::int64_t> kAllSections{0, 1, 2};

// The signal of a frame, without noise.
float signal(std::int64_t x, std::int64_t y, std::int64_t section) {
  return static_cast<float>(10 + (x * 3 + y * 5 + section) % 7);
}

float noise(std::int64_t x, std::int64_t y, std::int64_t section, std::uint64_t seed) {
  base::Random random(seed, static_cast<std::uint64_t>((section * kHeight + y) * kWidth + x));
  return static_cast<float>(random.normal());
}

// Writes the sums of some frames, and all of them times `scale` plus `offset`.
struct Stacks {
  ScratchDirectory scratch;
  HalfPaths halves;
  std::shared_ptr<const io::ImageStack> all;

  Stacks(float even_frames, float odd_frames, float scale, float background = 0) {
    const auto even = [=](std::int64_t x, std::int64_t y, std::int64_t s) {
      return even_frames * (signal(x, y, s) - background) + noise(x, y, s, 1);
    };
    const auto odd = [=](std::int64_t x, std::int64_t y, std::int64_t s) {
      return odd_frames * (signal(x, y, s) - background) + noise(x, y, s, 2);
    };
    halves = {write_stack(scratch / "even.mrc", kWidth, kHeight, kSections, even),
              write_stack(scratch / "odd.mrc", kWidth, kHeight, kSections, odd)};
    all = io::open_image_stack(write_stack(scratch / "all.mrc", kWidth, kHeight, kSections,
                                           [=](std::int64_t x, std::int64_t y, std::int64_t s) {
                                             return scale * (even(x, y, s) + odd(x, y, s));
                                           }));
  }

  HalfStacks matched() const {
    HalfStacks stacks(halves, *all);
    std::vector<HalfMoments> moments;
    for (const std::int64_t section : kAllSections) {
      MaskedImage image(kWidth, kHeight);
      all->read_section(section, image.values);
      moments.push_back(stacks.measure(section, image));
    }
    stacks.match(kAllSections, moments, *all);
    return stacks;
  }
};

std::vector<float> section_of(const HalfStacks& stacks, Half half, std::int64_t section) {
  std::vector<float> values(kWidth * kHeight);
  stacks.read_section(half, section, values);
  return values;
}

// Expects a half to be `gain` times what its file has, plus an offset.
void expect_gain(const Stacks& stacks, Half half, double gain, double offset = 0) {
  const auto file =
      io::open_image_stack(half == Half::kEven ? stacks.halves.even : stacks.halves.odd);
  std::vector<float> stored(kWidth * kHeight);
  file->read_section(1, stored);
  const std::vector<float> read = section_of(stacks.matched(), half, 1);
  for (std::size_t i = 0; i < read.size(); i += 37)
    EXPECT_NEAR(read[i], gain * static_cast<double>(stored[i]) + offset, 0.01 * gain * 13);
}

TEST(HalfStacks, HalvesOfASumAreDoubled) {
  const Stacks stacks(4, 4, 1);
  expect_gain(stacks, Half::kEven, 2);
  expect_gain(stacks, Half::kOdd, 2);
}

TEST(HalfStacks, HalvesOfAMeanStayAsTheyAre) { expect_gain({4, 4, 0.5f}, Half::kOdd, 1); }

TEST(HalfStacks, HalvesOfCountsMayHaveDifferentNumbersOfFrames) {
  const Stacks stacks(4, 3, 1);
  expect_gain(stacks, Half::kEven, 7.0 / 4);
  expect_gain(stacks, Half::kOdd, 7.0 / 3);
}

TEST(HalfStacks, ValuesAroundZeroAreMatchedByTheirSlope) {
  const Stacks stacks(4, 4, 1, 13.5f);
  const std::vector<float> even = section_of(stacks.matched(), Half::kEven, 2);
  std::vector<float> all(even.size());
  stacks.all->read_section(2, all);
  double sum = 0, difference = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    sum += static_cast<double>(all[i]);
    difference += static_cast<double>(even[i] - all[i]);
  }
  EXPECT_LT(sum, 0);  // no counts
  EXPECT_NEAR(difference / static_cast<double>(all.size()), 0, 1e-3);
  expect_gain(stacks, Half::kOdd, 2);
}

TEST(HalfStacks, CopiesAreRefused) {
  const auto refusal = [](const auto& change) {
    Stacks changed(4, 4, 1);
    change(changed);
    return message_of<Error>([&] { changed.matched(); });
  };
  const auto copy = [](const std::filesystem::path& from, const std::filesystem::path& to) {
    std::filesystem::copy_file(from, to, std::filesystem::copy_options::overwrite_existing);
  };
  testing::expect_parts(refusal([&](Stacks& s) { copy(s.halves.even, s.halves.odd); }),
                        {"even.mrc", "odd.mrc", "are equal"});
  testing::expect_parts(refusal([&](Stacks& s) { copy(s.scratch / "all.mrc", s.halves.even); }),
                        {"even.mrc", "all.mrc", "are equal"});
  testing::expect_parts(refusal([&](Stacks& s) { copy(s.scratch / "all.mrc", s.halves.odd); }),
                        {"odd.mrc", "all.mrc", "are equal"});
}

TEST(HalfStacks, CorrectionsOfOneAloneAreSaid) {
  const Stacks stacks(4, 4, 1);
  std::string bytes = testing::read_whole_file(stacks.halves.even);
  const std::int32_t stamp = 1146047817, flags = 4 | 32;
  std::memcpy(bytes.data() + 152, &stamp, 4);
  std::memcpy(bytes.data() + 156, &flags, 4);
  std::ofstream(stacks.halves.even, std::ios::binary) << bytes;
  const testing::WarningCatcher warnings;
  stacks.matched();
  testing::expect_parts(warnings.text(), {"even.mrc", "phase-flipped", "all.mrc"});
  EXPECT_EQ(warnings.text().find("odd.mrc"), std::string::npos);
}

TEST(HalfStacks, SectionsOfAnotherViewAreNamed) {
  const auto warnings_of = [](const Stacks& stacks) {
    const testing::WarningCatcher warnings;
    stacks.matched();
    return warnings.text();
  };
  Stacks stacks(4, 4, 1);
  EXPECT_EQ(warnings_of(stacks), "");
  const auto in_order = io::open_image_stack(stacks.halves.even);
  std::vector<float> last(kWidth * kHeight), own(kWidth * kHeight);
  in_order->read_section(kSections - 1, last);
  stacks.halves.even =
      write_stack(stacks.scratch / "shuffled.mrc", kWidth, kHeight, kSections,
                  [&](std::int64_t x, std::int64_t y, std::int64_t s) {
                    in_order->read_section(s, own);
                    return (s == 0 ? last : own)[static_cast<std::size_t>(y * kWidth + x)];
                  });
  testing::expect_parts(warnings_of(stacks), {"in section 1 the sum", "shuffled.mrc", "all.mrc"});
}

TEST(HalfStacks, HalvesInOtherScalesAreNamed) {
  // Values around zero tell nothing of the numbers of frames.
  for (const auto& [even, odd, is_named] : {std::tuple{4.0f, 4.0f, false},
                                            {5.0f, 4.0f, false},
                                            {40.0f, 4.0f, true},
                                            {4.0f, 12.0f, true}}) {
    const Stacks stacks(even, odd, 1, 40);
    const testing::WarningCatcher warnings;
    stacks.matched();
    EXPECT_EQ(warnings.text().find("count in one scale") != std::string::npos, is_named)
        << even << " " << odd << ": " << warnings.text();
  }
}

TEST(HalfStacks, StacksThatAreNoHalvesAreRefused) {
  const Stacks stacks(4, 4, 1), other(4, 4, 1, 26);
  const auto write = [&](const char* name, std::int64_t sections, const auto& value) {
    return write_stack(stacks.scratch / name, kWidth, kHeight, sections, value);
  };
  const auto refusal = [&](const std::filesystem::path& odd) {
    Stacks changed(4, 4, 1);
    changed.halves.odd = odd;
    return message_of<Error>([&] { changed.matched(); });
  };
  EXPECT_NE(refusal(write("few.mrc", 2, signal)).find("has 2 sections of 24 × 20 pixels and"),
            std::string::npos);
  const auto unrelated = [](std::int64_t x, std::int64_t y, std::int64_t s) {
    return 100 * noise(x, y, s, 3);
  };
  EXPECT_NE(refusal(write("unrelated.mrc", kSections, unrelated)).find("are no halves of"),
            std::string::npos);
  const auto with_hole = [](std::int64_t x, std::int64_t y, std::int64_t s) {
    return s == 1 && x == y ? std::numeric_limits<float>::quiet_NaN() : 4 * signal(x, y, s);
  };
  EXPECT_NE(refusal(write("hole.mrc", kSections, with_hole)).find("section 2 of"),
            std::string::npos);
}

}  // namespace
}  // namespace tomofield::tilt_series
