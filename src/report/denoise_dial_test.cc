#include "report/denoise_dial.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "png_picture.h"
#include "scratch_directory.h"

namespace tomofield::report {
namespace {

tune::FitTrial trial_of(Penalty penalty, double weight, bool fits_view_scale = true) {
  tune::FitTrial trial;
  trial.settings = {.penalty = penalty,
                    .variation = weight,
                    .rank = 24,
                    .epochs = 2,
                    .fits_view_scale = fits_view_scale};
  trial.section = {4, std::vector<float>(8, static_cast<float>(weight))};
  return trial;
}

tune::TunedFit tuned_to(Penalty penalty, double weight) {
  tune::TunedFit tuned;
  for (const double tried : {5.0, 9.0, 2.8, 1.5})
    tuned.trials.push_back(trial_of(Penalty::kSmooth, tried));
  tuned.trials.push_back(trial_of(Penalty::kConcave, 14.0));
  tuned.trials.push_back(trial_of(Penalty::kSmooth, 5.0, false));
  tuned.settings = trial_of(penalty, weight).settings;
  tuned.settings.epochs = 10;  // of the whole fit
  return tuned;
}

TEST(DialTrials, HaveTheWeightsNearestToThoseOfThePlaces) {
  const tune::TunedFit tuned = tuned_to(Penalty::kSmooth, 4.7);
  const std::vector<DialTrial> shown = dial_trials(tuned);
  ASSERT_EQ(shown.size(), 3U);
  EXPECT_EQ(shown[0].place, "light");
  EXPECT_EQ(shown[0].trial, &tuned.trials[2]);
  EXPECT_EQ(shown[1].trial, &tuned.trials[0]);
  EXPECT_EQ(shown[2].trial, &tuned.trials[1]);
}

TEST(DialTrials, SayWhichFactorTheyShow) {
  const tune::FitTrial trial = trial_of(Penalty::kSmooth, 5);
  EXPECT_EQ(caption_of({"light", &trial, 0.5}), "Factor 0.5: light");
  EXPECT_EQ(caption_of({"light", &trial, 0.333}), "Factor 0.33: lighter than light (0.5)");
  EXPECT_EQ(caption_of({"medium", &trial, 1.064}), "Factor 1.1: stronger than medium (1)");
  EXPECT_EQ(caption_of({"strong", &trial, 1.004 * 2}), "Factor 2: strong");
  const std::vector<DialTrial> shown = dial_trials(tuned_to(Penalty::kSmooth, 4.5));
  ASSERT_EQ(shown.size(), 3U);
  EXPECT_DOUBLE_EQ(shown[0].factor, 2.8 / 4.5);
}

TEST(DialTrials, AreNoneIfTheyAreNotThree) {
  EXPECT_TRUE(dial_trials(tuned_to(Penalty::kConcave, 14)).empty());
  EXPECT_TRUE(dial_trials(tuned_to(Penalty::kSmooth, 9)).empty());  // nothing stronger was tried
}

TEST(DialPicture, ShowsTheSectionsUnderEachOtherInTheContrastOfTheMediumOne) {
  const testing::ScratchDirectory directory;
  const std::filesystem::path path = directory / "dial.png";
  tune::TunedFit tuned = tuned_to(Penalty::kSmooth, 4.7);
  tuned.trials[0].section.values = {0, 10, 0, 10, 0, 10, 0, 10};
  write_dial_picture(tuned, 1.0, path);
  const testing::PngPicture picture = testing::read_png(path, PNG_FORMAT_GRAY);
  ASSERT_EQ(picture.width % 4, 0);
  const std::int64_t zoom = picture.width / 4, height = picture.height / 3;
  const auto grey_near_bottom_of = [&](int place, int x) {  // 0 is the uppermost section
    return picture.at(x * zoom + zoom / 2, (place + 1) * height - zoom / 2);
  };
  EXPECT_EQ(grey_near_bottom_of(1, 0), 0);
  EXPECT_EQ(grey_near_bottom_of(1, 1), 255);
  const int light = grey_near_bottom_of(0, 0), strong = grey_near_bottom_of(2, 0);
  EXPECT_NEAR(light, 255 * 0.28, 12);
  EXPECT_NEAR(strong, 255 * 0.9, 12);
}

TEST(DialPicture, IsRemovedIfTheTrialsHaveNone) {
  const testing::ScratchDirectory directory;
  const std::filesystem::path path = directory / "dial.png";
  tune::TunedFit tuned = tuned_to(Penalty::kSmooth, 4.7);
  write_dial_picture(tuned, 1.0, path);
  EXPECT_TRUE(std::filesystem::exists(path));
  tuned.trials[0].section = {};
  write_dial_picture(tuned, 1.0, path);
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace tomofield::report
