#include "report/alignment_plot.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "png_picture.h"
#include "scratch_directory.h"

namespace tomofield::report {
namespace {

// Returns views in the order in which a dose-symmetric series records them.
AlignmentCurves some_alignment() {
  AlignmentCurves alignment;
  for (int k = 0; k < 41; ++k) {
    const double tilt = 3.0 * (k % 2 == 0 ? -k / 2 : (k + 1) / 2);
    alignment.tilt_deg.push_back(tilt);
    alignment.shift_x_px.push_back(4 * std::sin(tilt / 20) + 0.5 * std::sin(3.0 * k));
    alignment.shift_y_px.push_back(0.05 * tilt + 0.6 * std::cos(5.0 * k));
    alignment.rotation_deg.push_back(0.2 + 0.05 * std::sin(2.0 * k));
    alignment.magnification_percent.push_back(0.1 * std::cos(tilt / 15));
    alignment.tilt_change_deg.push_back(0.0);
    alignment.correlation.push_back(0.8 - 0.3 * std::pow(tilt / 60, 2));
    alignment.error_x_px.push_back(0.02 + 0.03 * std::pow(tilt / 60, 2));
    alignment.error_y_px.push_back(0.015 + 0.01 * std::pow(tilt / 60, 2));
  }
  return alignment;
}

std::vector<std::string> titles_of(const std::vector<CurvePlot>& plots) {
  std::vector<std::string> titles;
  for (const CurvePlot& plot : plots)
    titles.push_back(plot.axes.y_title.substr(0, plot.axes.y_title.find(',')));
  return titles;
}

TEST(AlignmentPlot, HasTheViewsInOrderOfTilt) {
  const AlignmentCurves alignment = some_alignment();
  const auto plots = alignment_plots(alignment);
  ASSERT_EQ(plots.size(), 5u);
  for (const CurvePlot& plot : plots) {
    for (const Curve& curve : plot.curves) {
      ASSERT_EQ(curve.points.size(), 41u);
      for (std::size_t i = 0; i < 41; ++i) {
        EXPECT_EQ(curve.points[i].first, 3.0 * static_cast<double>(i) - 60) << curve.name;
        EXPECT_GT(curve.points[i].second, plot.axes.y_range.first) << curve.name;
        EXPECT_LT(curve.points[i].second, plot.axes.y_range.second) << curve.name;
      }
    }
  }
  // View 3 has the tilt 6°, which is the 23rd in order.
  EXPECT_EQ(plots[0].curves[0].points[22].second, alignment.shift_x_px[3]);
  EXPECT_EQ(plots[0].curves[1].points[22].second, alignment.shift_y_px[3]);
  EXPECT_EQ(plots[1].curves[0].points[22].second, alignment.rotation_deg[3]);
  EXPECT_EQ(plots[2].curves[0].points[22].second, alignment.magnification_percent[3]);
  EXPECT_EQ(plots[3].curves[0].points[22].second, alignment.correlation[3]);
  EXPECT_EQ(plots[4].curves[0].points[22].second, alignment.error_x_px[3]);
  EXPECT_EQ(plots[4].curves[1].points[22].second, alignment.error_y_px[3]);
  EXPECT_EQ(plots[4].axes.y_range.first, 0.0);
}

TEST(AlignmentPlot, LeavesOutWhatNoViewHas) {
  AlignmentCurves alignment = some_alignment();
  alignment.magnification_percent.assign(41, 0.0);
  EXPECT_EQ(titles_of(alignment_plots(alignment)),
            (std::vector<std::string>{"change of the shift", "change of the rotation",
                                      "correlation of the view with its projection",
                                      "standard error of the shift"}));
  alignment.rotation_deg.assign(41, 0.0);
  EXPECT_EQ(alignment_plots(alignment).size(), 3u);
  alignment.rotation_deg[7] = 1e-3;
  EXPECT_EQ(alignment_plots(alignment).size(), 4u);
}

TEST(AlignmentPlot, HasLocalMotionIfAnyViewHas) {
  AlignmentCurves alignment = some_alignment();
  alignment.local_px.assign(41, 0.0);
  EXPECT_EQ(alignment_plots(alignment).size(), 5u);
  alignment.local_px[3] = 1.5;
  const auto plots = alignment_plots(alignment);
  ASSERT_EQ(plots.size(), 6u);
  EXPECT_EQ(plots[3].axes.y_title, "local motion, pixels before binning");
  EXPECT_EQ(plots[3].curves[0].points[22].second, 1.5);
}

TEST(AlignmentPlot, HasTiltAnglesIfAnyChanges) {
  AlignmentCurves alignment = some_alignment();
  alignment.tilt_change_deg[3] = -0.25;
  const auto plots = alignment_plots(alignment);
  ASSERT_EQ(plots.size(), 6u);
  EXPECT_EQ(plots[3].axes.y_title, "change of the tilt angle, degrees");
  EXPECT_EQ(plots[3].curves[0].points[22].second, -0.25);
}

TEST(AlignmentPlot, HasRoundTilts) {
  AlignmentCurves alignment = some_alignment();
  const auto ticks = alignment_plots(alignment)[0].axes.x_ticks;
  ASSERT_EQ(ticks.size(), 7u);
  EXPECT_EQ(ticks[0].at, -60.0);
  EXPECT_EQ(ticks[0].label, "-60");
  EXPECT_EQ(ticks[6].at, 60.0);
  for (double& tilt_deg : alignment.tilt_deg) tilt_deg /= 4;
  EXPECT_TRUE(alignment_plots(alignment)[0].axes.x_ticks.empty()) << "the plot finds its own";
}

TEST(AlignmentPlot, RefusesViewsWithoutAValue) {
  AlignmentCurves alignment = some_alignment();
  alignment.error_y_px.pop_back();
  EXPECT_THROW(alignment_plots(alignment), std::logic_error);
}

TEST(AlignmentPlot, IsDrawnPanelBelowPanel) {
  const testing::ScratchDirectory directory;
  AlignmentCurves alignment = some_alignment();
  alignment.magnification_percent.assign(41, 0.0);
  // Nothing is known of the correlation.
  alignment.correlation.assign(41, std::numeric_limits<double>::quiet_NaN());
  write_alignment_picture(alignment, directory / "a.png");
  const auto picture = testing::read_png(directory / "a.png", PNG_FORMAT_RGB);
  ASSERT_EQ(picture.width, 900);
  constexpr std::int64_t kPanel = 270, kGap = 20;
  ASSERT_EQ(picture.height, 4 * kPanel + 3 * kGap);
  for (std::int64_t panel = 0; panel < 4; ++panel) {
    int drawn = 0;
    const std::int64_t top = (kPanel + kGap) * panel;
    for (std::int64_t y = top; y < top + kPanel; ++y) {
      for (std::int64_t x = 70; x < 660; ++x)
        drawn += picture.at(x, y, 0) == 0x00 && picture.at(x, y, 1) == 0x72;
    }
    EXPECT_EQ(drawn > 500, panel != 2) << panel << ": " << drawn;
  }
}

}  // namespace
}  // namespace tomofield::report
