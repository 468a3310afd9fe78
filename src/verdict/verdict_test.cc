#include "verdict/verdict.h"

#include <gtest/gtest.h>

namespace tomofield::verdict {
namespace {

TEST(Verdict, LineNamesWhatThereIs) {
  Verdict verdict;
  verdict.residual = 1.019;
  verdict.seconds = 83.4;
  verdict.peak_GiB = 0.93;
  EXPECT_EQ(verdict_line(verdict),
            "verdict: residual 1.02 of the noise's variance; 83.4 s, 0.93 GiB");
  verdict.held_out = HeldOutSummary{.median = 1.05, .worst = 1.31, .worst_tilt_deg = 54};
  verdict.artefacts.speckle = 0.0001;
  verdict.views = ViewAgreement{};
  verdict.views->residual_correlation = {0.35, -0.02};
  verdict.artefacts.faces = evaluate::FaceJump{.both = 1.03, .x = {}, .y = {}};
  EXPECT_EQ(verdict_line(verdict),
            "verdict: residual 1.02 of the noise's variance; correlation of neighbours 0.35, "
            "-0.02; held out: median 1.05, worst 1.31 (at 54.0°); speckle 0.010 %; faces 1.03; "
            "83.4 s, 0.93 GiB");
}

TEST(Verdict, SectionsAreComparedWithTheMiddle) {
  std::vector<double> deviation(40, 2.0);
  EXPECT_EQ(section_profile(deviation).faces, 1.0);
  EXPECT_EQ(section_profile(deviation).empty_part, 0.0);
  deviation[0] = deviation[1] = 8.0;
  EXPECT_EQ(section_profile(deviation).faces, 1.0);  // of the face that varies less
  deviation[38] = deviation[39] = 6.0;
  EXPECT_EQ(section_profile(deviation).faces, 3.0);
  for (std::size_t z = 20; z < 36; ++z) deviation[z] = 0.1;
  EXPECT_EQ(section_profile(deviation).empty_part, 16.0 / 40);
  EXPECT_EQ(section_profile({1.0}).faces, 1.0);
}

TEST(Verdict, NineOfTenViewsStayBelowTheUsualDisplacement) {
  ViewAgreement views;
  EXPECT_EQ(views.usual_displacement_px(), 0.0);
  for (int i = 0; i <= 10; ++i) views.displacement_px.push_back({3.0 * i, -4.0 * i});
  EXPECT_NEAR(views.usual_displacement_px(), 45, 1e-4);
  EXPECT_NEAR(views.usual_displacement_y_px(), 36, 1e-4);
}

}  // namespace
}  // namespace tomofield::verdict
