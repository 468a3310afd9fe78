#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "expect_parts.h"
#include "io/images/image_stack.h"
#include "pixel_stack.h"
#include "scratch_directory.h"
#include "tilt_series/tilt_series.h"
#include "tomofield/error.h"
#include "warning_catcher.h"

namespace tomofield::tilt_series {
namespace {

using testing::message_of;
using testing::ScratchDirectory;
using testing::some_value;
using testing::write_stack;

constexpr std::int64_t kWidth = 16, kHeight = 12, kViews = 3;

std::vector<float> all_values() {
  std::vector<float> values;
  for (std::int64_t z = 0; z < kViews; ++z)
    for (std::int64_t y = 0; y < kHeight; ++y)
      for (std::int64_t x = 0; x < kWidth; ++x)
        values.push_back(static_cast<float>(some_value(x, y, z)));
  return values;
}

TEST(ImagesInMemory, GiveTheViewsOfAFile) {
  const ScratchDirectory scratch;
  TiltSeriesOptions of_file;
  of_file.stack = write_stack(scratch / "a.st", kWidth, kHeight, kViews, some_value, 2.5);
  of_file.tlt = scratch.write("a.tlt", "-20\n3\n40\n");
  of_file.exclude = "2";
  TiltSeriesOptions of_memory;
  of_memory.images =
      io::image_stack_in_memory(all_values(), kWidth, kHeight, {-20.0, 3.0, 40.0}, 2.5);
  of_memory.exclude = "2";

  const TiltSeries file(of_file), memory(of_memory);
  ASSERT_EQ(memory.views().size(), 2u);
  EXPECT_EQ(memory.pixel_size_A(), 2.5);
  EXPECT_EQ(memory.empty_beam(), file.empty_beam());
  EXPECT_EQ(memory.noise_sigma(), file.noise_sigma());
  for (std::size_t view = 0; view < 2; ++view) {
    EXPECT_EQ(memory.views()[view].tilt_deg, file.views()[view].tilt_deg);
    std::vector<float> a(kWidth * kHeight), b(a.size());
    std::vector<std::uint8_t> valid_a(a.size()), valid_b(a.size());
    file.read_view(view, a, valid_a);
    memory.read_view(view, b, valid_b);
    EXPECT_EQ(a, b);
    EXPECT_EQ(valid_a, valid_b);
  }
}

TEST(ImagesInMemory, RefuseTiltsThatAreNoUsableAngles) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double tilt_deg : {std::nan(""), kInfinity, -kInfinity, 91.0}) {
    TiltSeriesOptions options;
    options.images =
        io::image_stack_in_memory(all_values(), kWidth, kHeight, {-20.0, tilt_deg, 40.0}, 2.5);
    EXPECT_THROW(TiltSeries{options}, Error) << tilt_deg;
  }
}

TEST(ImagesInMemory, AnOffsetThatMakesATiltTooSteepIsNamed) {
  TiltSeriesOptions options;
  options.images = io::image_stack_in_memory(all_values(), kWidth, kHeight, {-20, 0, 60}, 2.5);
  options.tilt_offset_deg = 25;
  testing::expect_parts(message_of<Error>([&] { const TiltSeries series(options); }),
                        {"85°", "25° of --tilt-offset"});
}

TEST(ImagesInMemory, OneViewAloneIsWarnedOf) {
  TiltSeriesOptions options;
  options.images = io::image_stack_in_memory(all_values(), kWidth, kHeight, {-20, 0, 60}, 2.5);
  options.exclude = "1-2";
  const testing::WarningCatcher caught;
  const TiltSeries series(options);
  testing::expect_parts(caught.text(), {"section 3 alone"});
}

TEST(ImagesInMemory, AreNotToldOfOptionsForFiles) {
  TiltSeriesOptions options;
  options.images = io::image_stack_in_memory(all_values(), kWidth, kHeight, {0.0, 0.0, 0.0}, 2.5);
  const std::string said = message_of<Error>([&] { const TiltSeries series(options); });
  EXPECT_NE(said.find("give the tilt angles"), std::string::npos) << said;
  EXPECT_EQ(said.find("--tlt"), std::string::npos) << said;
}

TEST(ImagesInMemory, RefuseCountsThatDoNotAgree) {
  EXPECT_THROW(io::image_stack_in_memory(std::vector<float>(7), 2, 2, {0.0}, 1.0), Error);
  EXPECT_THROW(io::image_stack_in_memory(std::vector<float>(4), 2, 2, {0.0, 1.0}, 1.0), Error);
  EXPECT_THROW(io::image_stack_in_memory({}, 2, 2, {}, 1.0), Error);
  EXPECT_THROW(io::image_stack_in_memory(std::vector<float>(4), 0, 4, {0.0}, 1.0), Error);
  const std::string message = message_of<Error>([] {
    TiltSeriesOptions options;
    options.images = io::image_stack_in_memory(all_values(), kWidth, kHeight, {0, 1, 90}, 1.0);
    const TiltSeries series(options);
  });
  EXPECT_NE(message.find("views in memory"), std::string::npos) << message;
}

}  // namespace
}  // namespace tomofield::tilt_series
