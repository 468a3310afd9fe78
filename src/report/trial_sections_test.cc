#include "report/pictures.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <utility>
#include <vector>

#include "png_picture.h"
#include "scratch_directory.h"

namespace tomofield::report {
namespace {

tune::FitTrial trial_with(Prior prior, std::vector<float> values) {
  tune::FitTrial trial;
  trial.settings.prior = prior;
  trial.section = {4, std::move(values)};
  return trial;
}

TEST(PriorPicture, ShowsADifferenceAroundTheMiddleGrey) {
  const testing::ScratchDirectory directory;
  const std::filesystem::path path = directory / "prior.png";
  tune::TunedFit tuned;
  tuned.last_trials = {trial_with(Prior::kTv, {0, 10, 0, 10, 0, 10, 0, 10}),
                       trial_with(Prior::kLearned, {5, 10, 0, 5, 5, 10, 0, 5})};
  write_prior_picture(tuned, 1.0, path);
  const testing::PngPicture picture = testing::read_png(path, PNG_FORMAT_GRAY);
  ASSERT_EQ(picture.width % 4, 0);
  const std::int64_t zoom = picture.width / 4;
  const auto grey_of_difference = [&](int x) {
    return picture.at(x * zoom + zoom / 2, picture.height - zoom / 2);
  };
  EXPECT_NEAR(grey_of_difference(0), 255, 12);  // the prior adds half of the contrast
  EXPECT_NEAR(grey_of_difference(1), 128, 12);  // and nothing
  EXPECT_NEAR(grey_of_difference(3), 0, 12);    // and takes half of it away
}

TEST(PriorPicture, IsRemovedIfNoTrialsComparedThePrior) {
  const testing::ScratchDirectory directory;
  const std::filesystem::path path = directory.write("prior.png", "of an earlier run");
  write_prior_picture(tune::TunedFit(), 1.0, path);
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace tomofield::report
