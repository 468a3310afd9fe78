#include "compare/comparison_record.h"

#include <gtest/gtest.h>

#include "io/json.h"
#include "scratch_directory.h"

namespace tomofield::compare {
namespace {

TEST(ComparisonRecord, HasNullWhereThereIsNoFigure) {
  const testing::ScratchDirectory directory;
  ComparisonRecord record{.series = "a.mrc",
                          .truth = {},
                          .commands = {{"reconstruct", "a.mrc"}, {"baseline", "wbp"}},
                          .volumes = {"out/main.mrc", "out/fast.mrc"},
                          .table = {}};
  record.table.methods = {{"main", "Main", {}}, {"fast", "Fast", {}}};
  record.table.add({"psnr", "PSNR", Column::Better::kHigher, 1}, {24.0, std::nullopt});
  write_comparison(directory / "comparison.json", record);
  const nlohmann::json written = io::read_json(directory / "comparison.json");
  EXPECT_TRUE(written.at("truth").is_null());
  const nlohmann::json& methods = written.at("methods");
  EXPECT_EQ(methods.at(0).at("psnr"), 24.0);
  EXPECT_TRUE(methods.at(1).at("psnr").is_null());
  EXPECT_EQ(methods.at(1).at("command"), (std::vector<std::string>{"baseline", "wbp"}));
  EXPECT_EQ(methods.at(1).at("volume"), "out/fast.mrc");
}

}  // namespace
}  // namespace tomofield::compare
