#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "shared_data.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::tilt_series {
namespace {

const std::filesystem::path kSharedData = testing::shared_data();

struct RealSeries {
  const char* name;
  const char* stack;
  const char* tlt;
  Contrast contrast;
  std::size_t num_views;
  std::int64_t width, height;
  double first_deg, last_deg, pixel_size_A;
};

class TiltSeriesReal : public ::testing::TestWithParam<RealSeries> {};

TEST_P(TiltSeriesReal, Opens) {
  const RealSeries& real = GetParam();
  TiltSeriesOptions options;
  options.stack = kSharedData / real.stack;
  options.tlt = kSharedData / real.tlt;
  options.contrast = real.contrast;
  if (!std::filesystem::exists(options.stack)) GTEST_SKIP() << "no " << options.stack;
  const TiltSeries series(options);
  EXPECT_EQ(series.views().size(), real.num_views);
  EXPECT_EQ(series.width(), real.width);
  EXPECT_EQ(series.height(), real.height);
  EXPECT_NEAR(series.views().front().tilt_deg, real.first_deg, 1e-6);
  EXPECT_NEAR(series.views().back().tilt_deg, real.last_deg, 1e-6);
  EXPECT_NEAR(series.pixel_size_A(), real.pixel_size_A, 1e-4 * real.pixel_size_A);
}

INSTANTIATE_TEST_SUITE_P(
    Files, TiltSeriesReal,
    ::testing::Values(RealSeries{"exosome", "exosome_cryo/exosome_341x480.ali",
                                 "exosome_cryo/exosome.tlt", Contrast::kDark, 31, 341, 480, -59.7,
                                 60.7, 16.56},
                      RealSeries{"idp_raw", "idp_haadf/haadf_tilt_raw.st",
                                 "idp_haadf/haadf_tilt_raw.rawtlt", Contrast::kBright, 16, 256, 256,
                                 -40, 35, 130.81445},
                      RealSeries{"ta_film", "ta_film/area24.ali", "ta_film/ta_film.tlt",
                                 Contrast::kBright, 46, 151, 77, -63.000469, 55.898777, 1.0}),
    [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace tomofield::tilt_series
