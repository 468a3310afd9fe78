#include "verdict/warnings.h"

#include <gtest/gtest.h>

#include <string>

#include "expect_parts.h"

namespace tomofield::verdict {
namespace {

// A verdict on a series without faults.
Verdict good_verdict() {
  Verdict verdict;
  verdict.residual = 1.1;
  verdict.sections = {.faces = 0.3, .empty_part = 0.1};
  ViewAgreement views;
  for (int i = 0; i < 16; ++i) {
    views.views.push_back(i);
    views.correlation.push_back(0.6);
    views.displacement_px.push_back({0.1, -0.1});
  }
  views.tilt_order = 0.95;
  views.path = {.correlation = 0.9, .rise = 4.0};
  views.axis = AxisCheck{.direction_deg = 2, .best = 0.9, .vertical = 0.89, .usual = 0.3};
  verdict.views = views;
  return verdict;
}

GivenInput aligned_input() {
  return {.contrast = Contrast::kDark,
          .alignment = std::vector<geometry::RawFromAligned>(16),
          .tilt_deg = std::vector<double>(16, 30.0),
          .thickness = 100,
          .bin_factor = 2};
}

std::string codes(const Verdict& verdict, const GivenInput& input = aligned_input()) {
  std::string all;
  for (const Warning& warning : find_warnings(verdict, input)) all += warning.code + " ";
  return all;
}

TEST(Warnings, AGoodRunHasNone) {
  EXPECT_EQ(codes(good_verdict()), "");
  Verdict raw_views = good_verdict();
  raw_views.views = std::nullopt;
  EXPECT_EQ(codes(raw_views), "");
}

TEST(Warnings, ExtremeSettingsAreNamedBeforeTheAlignment) {
  Verdict verdict = good_verdict();
  GivenInput input = aligned_input();
  input.extreme_settings = {"--vertex-spacing 64", "--tv 1000"};
  EXPECT_EQ(codes(verdict, input), "");
  verdict.residual = 12;
  verdict.views->displacement_px.assign(16, {10, 10});
  EXPECT_EQ(codes(verdict), "unaligned ");
  EXPECT_EQ(codes(verdict, input), "settings ");
  const std::string said = find_warnings(verdict, input).front().message;
  EXPECT_NE(said.find("leave out --vertex-spacing 64, --tv 1000"), std::string::npos) << said;
}

TEST(Warnings, AdviceOnTheAlignmentIsWhatIsLeftToTry) {
  Verdict verdict = good_verdict();
  verdict.residual = 50;
  GivenInput input = aligned_input();
  const auto advice = [&](Alignment before) {
    input.aligned_before = before;
    const auto found = find_warnings(verdict, input);
    EXPECT_EQ(codes(verdict, input), "residual ");
    return found.front().message;
  };
  const auto has = [](const std::string& text, const char* part) {
    return text.find(part) != std::string::npos;
  };
  EXPECT_TRUE(has(advice(Alignment::kOff), "--align refine shows what it would gain"));
  EXPECT_TRUE(has(advice(Alignment::kRefine), "--align full begins with the views as recorded"));
  EXPECT_FALSE(has(advice(Alignment::kFull), "--align refine"));
  EXPECT_TRUE(has(advice(Alignment::kFull), "--tilt-axis gives another one"));
}

TEST(Warnings, ContrastIsWrongIfLongRaysLookThin) {
  Verdict verdict = good_verdict();
  verdict.views->path = {.correlation = -0.9, .rise = -4.0};
  verdict.sections.faces = 5.0;
  EXPECT_EQ(codes(verdict), "contrast ");  // nothing is said of the thickness
  const auto found = find_warnings(verdict, aligned_input());
  EXPECT_NE(found.front().message.find("give --contrast bright"), std::string::npos);
  verdict.sections.faces = 0.3;
  verdict.views->path.rise = -0.3;  // normalised views may fall a little
  EXPECT_EQ(codes(verdict), "");
  verdict.views->path = {.correlation = -0.35, .rise = -1.6};  // a cell that ends in the view
  EXPECT_EQ(codes(verdict), "");
  verdict.residual = 1.4;
  EXPECT_EQ(codes(verdict), "contrast ");
  verdict.defocus = DefocusCheck{};  // which filters brightness
  EXPECT_EQ(codes(verdict), "");
}

TEST(Warnings, AnglesAreShuffledIfNeighboursAreNotAlike) {
  Verdict verdict = good_verdict();
  verdict.views->tilt_order = 0.5;
  for (auto& displacement : verdict.views->displacement_px)
    displacement[0] = 3.0;  // a result of it
  EXPECT_EQ(codes(verdict), "tilt-order ");
  verdict.views->tilt_order = std::nullopt;  // too few views to tell
  EXPECT_EQ(codes(verdict), "unaligned ");
}

TEST(Warnings, DisplacedViewsAreBlamedOnTheAlignment) {
  Verdict verdict = good_verdict();
  GivenInput input = aligned_input();
  for (std::size_t i = 0; i < 16; ++i) {
    const double shift = i % 2 == 0 ? 4.0 : -4.0;
    verdict.views->displacement_px[i] = {0.2, shift};
    // A quarter turn maps (x, y) to (−y, x).
    input.alignment[i] = {.m11 = 0, .m12 = -1, .m21 = 1, .m22 = 0, .shift_x_px = shift};
  }
  EXPECT_EQ(codes(verdict), "unaligned ");
  EXPECT_EQ(codes(verdict, input), "aligned-twice ");
  for (std::size_t i = 0; i < 16; ++i) input.alignment[i].shift_x_px = i < 8 ? 4.0 : -4.0;
  EXPECT_EQ(codes(verdict, input), "misaligned ");
}

TEST(Warnings, ThicknessIsJudgedByTheSections) {
  Verdict verdict = good_verdict();
  verdict.sections.faces = 2.5;
  const auto thin = find_warnings(verdict, aligned_input());
  ASSERT_EQ(codes(verdict), "thin ");
  EXPECT_NE(thin.front().message.find("--thickness 300"), std::string::npos);  // unbinned pixels
  verdict.residual = 1.0;                                                      // nothing is missing
  EXPECT_EQ(codes(verdict), "");
  verdict.residual = 2;
  EXPECT_EQ(codes(verdict), "thin ");
  verdict.views->axis->vertical = 0.8;  // a wrong axis could be the reason
  EXPECT_EQ(codes(verdict), "");
  verdict.residual = 60;  // whatever the model cannot explain
  EXPECT_EQ(codes(verdict), "residual ");
  verdict.sections.faces = 4.0;
  EXPECT_EQ(codes(verdict), "thin ");
  verdict.sections = {.faces = 0.1, .empty_part = 0.5};
  const auto thick = find_warnings(verdict, aligned_input());
  ASSERT_EQ(codes(verdict), "thick ");
  EXPECT_NE(thick.front().message.find("--thickness 120"), std::string::npos);
}

TEST(Warnings, TheHandOfTheDefocusIsDoubtedIfViewsSayTheOther) {
  Verdict verdict = good_verdict();
  verdict.defocus = DefocusCheck{.slope = DefocusCheck::Slope{-0.2, 0.02}};
  EXPECT_EQ(codes(verdict), "");
  verdict.defocus->slope = {-1.8, 0.6};  // unsure
  EXPECT_EQ(codes(verdict), "");
  verdict.defocus->slope = {-2.1, 0.38};  // a small view of a yardstick, with the right hand
  EXPECT_EQ(codes(verdict), "");
  verdict.defocus->slope = {-1.8, 0.2};
  EXPECT_EQ(codes(verdict), "defocus-hand ");
  verdict.defocus->slope = std::nullopt;
  EXPECT_EQ(codes(verdict), "");
}

TEST(Warnings, NoiseIsCorrelatedIfNeighboursAreAlikeOnBothAxes) {
  Verdict verdict = good_verdict();
  verdict.views->residual_correlation = {0.9, 0.5};
  EXPECT_EQ(codes(verdict), "");
  verdict.views->residual_correlation = {0.9, 0.8};
  EXPECT_EQ(codes(verdict), "correlated-noise ");
  EXPECT_NE(find_warnings(verdict, aligned_input()).front().message.find("--bin 4"),
            std::string::npos);
  verdict.residual = 60;  // this is structure
  EXPECT_EQ(codes(verdict), "residual ");
}

TEST(Warnings, ViewsThatShowNothingAreNamedBeforeWhatFollowsFromThem) {
  Verdict verdict = good_verdict();
  verdict.views->tilt_order = 0.5;
  verdict.views->correlation[3] = 0.01;
  EXPECT_EQ(codes(verdict), "tilt-order ");  // a single view
  verdict.views->correlation[8] = -0.02;
  EXPECT_EQ(codes(verdict), "views ");
  const std::string message = find_warnings(verdict, aligned_input()).front().message;
  EXPECT_NE(message.find("2 of 16 views"), std::string::npos) << message;
  for (double& correlation : verdict.views->correlation) correlation *= 0.05;  // noise alone
  EXPECT_EQ(codes(verdict), "tilt-order ");
}

TEST(Warnings, TheAxisIsWrongIfProfilesAgreeAlongAnotherDirection) {
  Verdict verdict = good_verdict();
  verdict.views->axis = AxisCheck{.direction_deg = 30, .best = 0.9, .vertical = 0.6, .usual = 0.3};
  EXPECT_EQ(codes(verdict), "");  // as of a rod along the axis: the fit explains the views
  verdict.residual = 1.9;
  verdict.views->far_correlation = {0.4, 0.3};
  EXPECT_EQ(codes(verdict), "tilt-axis ");
  const std::string message = find_warnings(verdict, aligned_input()).front().message;
  EXPECT_NE(message.find("30°"), std::string::npos) << message;
  verdict.views->axis->vertical = 0.88;
  EXPECT_EQ(codes(verdict), "residual ");
  verdict.residual = 1.1;
  verdict.views->axis = AxisCheck{.direction_deg = 30, .best = 0.3, .vertical = 0.02, .usual = 0};
  EXPECT_EQ(codes(verdict), "tilt-axis ");  // noise hides the residual
}

TEST(Warnings, SpectraTellADefocusThatIsFarOff) {
  Verdict verdict = good_verdict();
  const RingCheck wrong{
      .factor = 1.3, .agreement = 0.7, .given = 0.0, .standard_error = 0.02, .rings = 14};
  verdict.defocus = DefocusCheck{.spectra = wrong};
  EXPECT_EQ(codes(verdict), "defocus ");
  const std::string message = find_warnings(verdict, aligned_input()).front().message;
  EXPECT_NE(message.find("30.0 % larger"), std::string::npos) << message;
  verdict.defocus->spectra->rings = 2.9;
  EXPECT_EQ(codes(verdict), "");
  verdict.defocus->spectra = wrong;
  verdict.defocus->spectra->agreement = 0.2;
  EXPECT_EQ(codes(verdict), "");
  verdict.defocus->spectra = wrong;
  verdict.defocus->spectra->given = 0.6;
  EXPECT_EQ(codes(verdict), "");
  verdict.defocus->spectra = wrong;
  verdict.defocus->spectra->standard_error = 0.2;
  EXPECT_EQ(codes(verdict), "");
}

TEST(Warnings, AResidualIsAFaultIfItIsLargeOrHasStructure) {
  Verdict verdict = good_verdict();
  verdict.residual = 1.6;
  EXPECT_EQ(codes(verdict), "");
  verdict.views->far_correlation = {0.3, 0.2};
  EXPECT_EQ(codes(verdict), "residual ");
  verdict.residual = 1.1;
  EXPECT_EQ(codes(verdict), "");
  verdict.views = std::nullopt;
  verdict.residual = 9.4;
  EXPECT_EQ(codes(verdict), "residual ");
}

TEST(Warnings, SpeckleIsNoiseIfTheViewsAreNotExplained) {
  Verdict verdict = good_verdict();
  verdict.artefacts.speckle = 0.02;
  EXPECT_EQ(codes(verdict), "");
  verdict.residual = 1.55;
  EXPECT_EQ(codes(verdict), "speckle ");
  const GivenInput input{.tilt_deg = {-30, 0, 30, 60}, .residual = {0.9, 0.8, 22, 1.1}};
  testing::expect_parts(find_warnings(verdict, input).front().message,
                        {"the view at 30.0° leaves 22 times", "--exclude", "--denoise"});
  verdict.artefacts.speckle = 0.0005;
  EXPECT_EQ(codes(verdict), "");
}

TEST(Warnings, HeldOutViewsTellOfAFitToNoise) {
  Verdict verdict = good_verdict();
  verdict.held_out = HeldOutSummary{.median = 1.3, .worst = 2.0};
  EXPECT_EQ(codes(verdict), "");
  verdict.residual = 0.7;
  EXPECT_EQ(codes(verdict), "overfit ");
}

TEST(Warnings, RingsThatExplainNextToNothingTellNoDefocus) {
  Verdict verdict = good_verdict();
  verdict.defocus = DefocusCheck{0.3, 0.02, 0.003, {}};
  EXPECT_EQ(codes(verdict), "");
  verdict.defocus->rings = 0.01;
  EXPECT_EQ(codes(verdict), "defocus ");
  verdict.defocus->error = 1.8;  // too far for what was measured
  EXPECT_EQ(codes(verdict), "");
}

}  // namespace
}  // namespace tomofield::verdict
