#include "report/reported_options.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "options/run_options.h"

namespace tomofield::report {
namespace {

SeriesFiles series_files() {
  SeriesFiles files;
  files.stack = "series.mrc";
  return files;
}

// Returns the options of a run that was asked for.
std::vector<ReportedOption> reported(const Options& requested) {
  return reported_options(series_files(), options::run_options(series_files(), requested));
}

ReportedOption option_of(const std::vector<ReportedOption>& options, const std::string& flag) {
  const auto found = std::ranges::find(options, flag, &ReportedOption::flag);
  EXPECT_NE(found, options.end()) << flag;
  return found == options.end() ? ReportedOption{} : *found;
}

TEST(ReportedOptions, SayWhereEachValueComesFrom) {
  Options requested;
  requested.specimen.thickness = 150;
  requested.fit.penalty = {Penalty::kSmooth, Origin::kTrial};
  const auto options = reported(requested);
  EXPECT_EQ(option_of(options, "stack").value, "series.mrc");
  EXPECT_EQ(option_of(options, "stack").origin, "given");
  const ReportedOption thickness = option_of(options, "--thickness");
  EXPECT_EQ(thickness.value, "150 unbinned pixels");
  EXPECT_EQ(thickness.origin, "given");
  EXPECT_FALSE(thickness.meaning.empty());
  EXPECT_FALSE(thickness.is_default);
  EXPECT_EQ(option_of(options, "--tv-penalty").origin, "chosen by trials");
  EXPECT_EQ(option_of(options, "--epochs").origin, "chosen automatically");
  EXPECT_EQ(option_of(options, "--seed").origin, "default");
  EXPECT_TRUE(option_of(options, "--seed").is_default);
  requested.fit.epochs = 30;  // the usual value
  EXPECT_EQ(option_of(reported(requested), "--epochs").origin, "given");
}

TEST(ReportedOptions, ShowSwitchesAsTheyAreTyped) {
  Options requested;
  requested.field.with_margin = false;
  requested.specimen.axis_x = 100.5;
  requested.specimen.axis_z = 20.0;
  const auto options = reported(requested);
  EXPECT_EQ(option_of(options, "--no-margin").value, "on");
  EXPECT_EQ(option_of(options, "--no-noise-fit").value, "off");
  EXPECT_TRUE(option_of(options, "--no-noise-fit").is_default);
  EXPECT_EQ(option_of(options, "--center").value, "100.5, 20 unbinned pixels");
  EXPECT_EQ(std::ranges::count(options, "--center", &ReportedOption::flag), 1);
  EXPECT_EQ(option_of(reported({}), "--center").value, "–");
}

TEST(ReportedOptions, NameTheFileAndItsEntry) {
  Options requested;
  requested.specimen.thickness = 150;
  requested.settings = {{"--thickness", "150", "tilt.com", "THICKNESS"},
                        {"--contrast", "dark", "series.mdoc", ""},
                        {"--other", "1.5", "tilt.com", "OFFSET"}};
  const auto options = reported(requested);
  EXPECT_EQ(option_of(options, "--thickness").origin, "tilt.com: THICKNESS");
  EXPECT_EQ(option_of(options, "--contrast").origin, "series.mdoc");
  EXPECT_FALSE(option_of(options, "--contrast").is_default);
  requested.specimen.thickness = 200;
  requested.settings[1].instead = "--other 2";
  const auto replaced = reported(requested);
  EXPECT_EQ(option_of(replaced, "--thickness").value, "200 unbinned pixels");
  EXPECT_EQ(option_of(replaced, "--thickness").origin,
            "given, in place of 150 (tilt.com: THICKNESS)");
  EXPECT_EQ(option_of(replaced, "--contrast").origin, "--other 2, in place of dark (series.mdoc)");
  EXPECT_EQ(options.back().flag, "--other");
  EXPECT_EQ(options.back().value, "1.5");
}

}  // namespace
}  // namespace tomofield::report
