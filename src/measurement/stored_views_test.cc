#include "measurement/prepare.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bead_series.h"
#include "io/images/image_stack.h"
#include "scratch_directory.h"

namespace tomofield::measurement {
namespace {

using testing::BeadScene;
using tilt_series::TiltSeries;
using tilt_series::TiltSeriesOptions;

// Counts how often each section is read.
class CountingStack : public io::ImageStack {
 public:
  explicit CountingStack(std::shared_ptr<const io::ImageStack> images)
      : images_(std::move(images)), reads_(static_cast<std::size_t>(images_->header().nz)) {}
  const io::MrcHeader& header() const override { return images_->header(); }
  std::string name() const override { return images_->name(); }
  void read_section(std::int64_t section, std::span<float> out) const override {
    ++reads_[static_cast<std::size_t>(section)];
    images_->read_section(section, out);
  }
  std::vector<int> reads() const { return {reads_.begin(), reads_.end()}; }

 private:
  std::shared_ptr<const io::ImageStack> images_;
  mutable std::vector<std::atomic<int>> reads_;
};

std::shared_ptr<CountingStack> stack_of(const BeadScene& scene, Contrast contrast) {
  return std::make_shared<CountingStack>(scene.stack(contrast));
}

struct Case {
  const char* name;
  Contrast contrast;
  bool take_log;
  bool resample;
  bool has_beads;
};

class EachViewOnce : public ::testing::TestWithParam<Case> {};

TEST_P(EachViewOnce, IsDecoded) {
  const Case& c = GetParam();
  BeadScene scene;
  if (c.has_beads) scene.scatter_beads(12, 5);
  const auto stack = stack_of(scene, c.contrast);
  const std::size_t num_views = scene.tilt_deg.size();
  TiltSeriesOptions input;
  input.images = stack;
  input.contrast = c.contrast;
  input.take_log = c.take_log;
  input.resample = c.resample;
  if (std::string(c.name) == "bright_with_beads") input.bead_diameter_nm = 10.0;
  const TiltSeries series(input);
  EXPECT_EQ(series.mask_metrics().num_beads > 0, c.has_beads);
  const testing::ScratchDirectory scratch;
  SpecimenOptions specimen;
  specimen.thickness = 40;
  const Measurement measured = prepare_measurement(series, specimen, scratch.path());
  EXPECT_EQ(measured.rays->shape().num_views, num_views);
  EXPECT_EQ(stack->reads(), std::vector<int>(num_views, 1));
}

INSTANTIATE_TEST_SUITE_P(
    Series, EachViewOnce,
    ::testing::Values(Case{"bright", Contrast::kBright, false, true, false},
                      Case{"bright_with_beads", Contrast::kBright, false, true, true},
                      Case{"dark", Contrast::kDark, false, true, false},
                      Case{"dark_with_beads", Contrast::kDark, false, true, true},
                      Case{"logarithm", Contrast::kDark, true, true, true},
                      Case{"as_recorded", Contrast::kDark, false, false, true},
                      Case{"as_recorded_bright", Contrast::kBright, false, false, false},
                      Case{"undecided", Contrast::kBright, false, true, true},
                      Case{"undecided_as_recorded", Contrast::kBright, false, false, true}),
    [](const auto& series) { return std::string(series.param.name); });

TEST(StoredViews, GivesTheRaysThatAViewDecodedAnewWouldGive) {
  BeadScene scene;
  scene.scatter_beads(12, 5);
  TiltSeriesOptions input;
  input.images = stack_of(scene, Contrast::kDark);
  const TiltSeries series(input);
  SpecimenOptions specimen;
  specimen.thickness = 40;
  specimen.roi = Rectangle{0, 30, scene.width, 110};
  const Measurement measured = prepare_measurement(series, specimen, "/tmp");
  // Its views were forgotten, so that the series decodes this one again.
  constexpr std::size_t kView = 11;
  const auto size = static_cast<std::size_t>(scene.width * scene.height);
  std::vector<float> image(size);
  std::vector<std::uint8_t> valid(size);
  series.read_view(kView, image, valid);
  EXPECT_GT(std::ranges::count(valid, 0), 100) << "beads are masked";
  const float per_unit = static_cast<float>(1.0 / measured.unit);
  for (std::int64_t y = 0; y < measured.roi.height(); ++y) {
    for (std::int64_t x = 0; x < scene.width; ++x) {
      const auto at = static_cast<std::size_t>((y + 30) * scene.width + x);
      ASSERT_EQ(measured.rays->counts(kView, x, y), valid[at] != 0);
      if (valid[at]) {
        ASSERT_EQ(measured.rays->ray(kView, x, y), image[at] * per_unit);
      }
    }
  }
}

TEST(StoredViews, SeriesThatIsOnlyMeasuredIsReadOnce) {
  BeadScene scene;
  const auto stack = stack_of(scene, Contrast::kBright);
  TiltSeriesOptions input;
  input.images = stack;
  input.contrast = Contrast::kBright;
  const tilt_series::MeasuredSeries measured(input);
  EXPECT_EQ(stack->reads(), std::vector<int>(scene.tilt_deg.size(), 1));
  const TiltSeries series(input);
  EXPECT_EQ(measured.noise_sigma(), series.noise_sigma());
  EXPECT_EQ(measured.mask_metrics().num_beads, series.mask_metrics().num_beads);
}

}  // namespace
}  // namespace tomofield::measurement
