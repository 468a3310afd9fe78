#include "report/reported_options.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "options/run_options.h"

namespace tomofield::report {
namespace {

using nlohmann::json;

SeriesFiles series_files() {
  SeriesFiles files;
  files.stack = "series.mrc";
  return files;
}

// Returns the record of a run whose options are those of a request.
json record_of(const Options& requested) {
  return {{"options", options::options_json(options::run_options(series_files(), requested))},
          {"metrics", {{"tuning", nullptr}}}};
}

ReportedOption option_of(const std::vector<ReportedOption>& options, const std::string& flag) {
  const auto found = std::ranges::find(options, flag, &ReportedOption::flag);
  EXPECT_NE(found, options.end()) << flag;
  return found == options.end() ? ReportedOption{} : *found;
}

TEST(ReportedOptions, SayWhereEachValueComesFrom) {
  Options requested;
  requested.thickness = 150;
  json record = record_of(requested);
  record["metrics"]["tuning"] = {{"chosen", {}}};
  const auto options = reported_options(record, series_files(), requested);
  EXPECT_EQ(option_of(options, "stack").value, "series.mrc");
  EXPECT_EQ(option_of(options, "stack").origin, "given");
  const ReportedOption thickness = option_of(options, "--thickness");
  EXPECT_EQ(thickness.value, "150 unbinned pixels");
  EXPECT_EQ(thickness.origin, "given");
  EXPECT_FALSE(thickness.meaning.empty());
  EXPECT_FALSE(thickness.is_default);
  EXPECT_EQ(option_of(options, "--tv").origin, "chosen by trials");
  EXPECT_EQ(option_of(options, "--epochs").origin, "chosen automatically");
  EXPECT_EQ(option_of(options, "--seed").origin, "default");
  EXPECT_TRUE(option_of(options, "--seed").is_default);
  record["options"]["tune"] = true;
  EXPECT_EQ(option_of(reported_options(record, series_files(), requested), "--epochs").origin,
            "chosen by trials");
}

TEST(ReportedOptions, ShowSwitchesAsTheyAreTyped) {
  Options requested;
  requested.with_margin = false;
  requested.axis_x = 100.5;
  requested.axis_z = 20.0;
  const auto options = reported_options(record_of(requested), series_files(), requested);
  EXPECT_EQ(option_of(options, "--no-margin").value, "on");
  EXPECT_EQ(option_of(options, "--no-noise-fit").value, "off");
  EXPECT_TRUE(option_of(options, "--no-noise-fit").is_default);
  EXPECT_EQ(option_of(options, "--center").value, "100.5, 20 unbinned pixels");
  EXPECT_EQ(std::ranges::count(options, "--center", &ReportedOption::flag), 1);
  EXPECT_EQ(option_of(reported_options(record_of({}), series_files(), {}), "--center").value, "–");
}

TEST(ReportedOptions, NameTheFileAndItsEntry) {
  Options requested;
  requested.thickness = 150;
  json record = record_of(requested);
  record["origins"] = json::array(
      {{{"option", "--thickness"}, {"value", "150"}, {"file", "tilt.com"}, {"entry", "THICKNESS"}},
       {{"option", "contrast"}, {"value", "dark"}, {"file", "series.mdoc"}},
       {{"option", "OFFSET"}, {"value", 1.5}, {"file", "tilt.com"}, {"entry", "OFFSET"}}});
  for (const bool is_metric : {false, true}) {
    if (is_metric) {
      record["metrics"]["origins"] = record["origins"];
      record.erase("origins");
    }
    const auto options = reported_options(record, series_files(), requested);
    EXPECT_EQ(option_of(options, "--thickness").origin, "tilt.com: THICKNESS");
    EXPECT_EQ(option_of(options, "--contrast").origin, "series.mdoc");
    EXPECT_FALSE(option_of(options, "--contrast").is_default);
    EXPECT_EQ(options.back().flag, "OFFSET");
    EXPECT_EQ(options.back().value, "1.5");
  }
}

}  // namespace
}  // namespace tomofield::report
