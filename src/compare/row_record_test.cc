#include "compare/row_record.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

using testing::message_of;

class RowFile : public ::testing::Test {
 protected:
  RunOrigin origin(const std::vector<std::string>& command = {"baseline", "wbp"}) const {
    return origin_of(command, {series_, angles_});
  }
  std::string refusal(const RunOrigin& now) const {
    return message_of<Error>([&] { read_row(row_, now); });
  }
  testing::ScratchDirectory directory_;
  std::filesystem::path series_ = directory_.write("series.mrc", "views");
  std::filesystem::path angles_ = directory_.write("series.tlt", "-60\n60\n");
  std::filesystem::path row_ = directory_ / "wbp.row.json";
};

TEST_F(RowFile, KeepsWhatWasWritten) {
  EXPECT_EQ(read_row(row_, origin()).progress, Progress::kNone);
  write_row(row_, origin(), {Progress::kStopped, {1.5, 2.5, 4096}});
  const RowState state = read_row(row_, origin());
  EXPECT_EQ(state.progress, Progress::kStopped);
  EXPECT_EQ(state.costs.core_seconds, 1.5);
  EXPECT_EQ(state.costs.wall_seconds, 2.5);
  EXPECT_EQ(state.costs.peak_bytes, 4096);
}

TEST_F(RowFile, NamesEverythingThatHasChanged) {
  write_row(row_, origin(), {Progress::kFinished, {}});
  directory_.write("series.tlt", "-60\n60\n\n");
  const std::string message = refusal(origin({"baseline", "sirt"}));
  for (const char* fact : {"series.tlt' has changed", "tomofield baseline wbp", "baseline sirt",
                           "wbp.row.json", "--overwrite"})
    EXPECT_NE(message.find(fact), std::string::npos) << fact << ": " << message;
  EXPECT_EQ(message.find("series.mrc'"), std::string::npos) << message;
  EXPECT_NE(refusal(origin_of({"baseline", "wbp"}, {series_})).find("it read '"),
            std::string::npos);
}

TEST_F(RowFile, OfAnotherVersionIsRefused) {
  RunOrigin earlier = origin();
  earlier.version = "0.0.1";
  write_row(row_, earlier, {Progress::kFinished, {}});
  EXPECT_NE(refusal(origin()).find("tomofield 0.0.1"), std::string::npos);
}

TEST_F(RowFile, ThatIsDamagedIsNamed) {
  for (const char* text : {"", "{", "[]", "{}", "{\"origin\": {}}"}) {
    directory_.write("wbp.row.json", text);
    EXPECT_NE(refusal(origin()).find("wbp.row.json"), std::string::npos) << text;
  }
}

}  // namespace
}  // namespace tomofield::compare
