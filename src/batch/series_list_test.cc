#include "batch/series_list.h"

#include <gtest/gtest.h>

#include <fstream>

#include "base/log.h"
#include "batch/planning.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

using option_table::GivenOption;
using testing::message_of;

ColumnKind kind_of(const std::string& flag) {
  if (flag == "--thickness" || flag == "--center") return ColumnKind::kWithValue;
  if (flag == "--invert") return ColumnKind::kFlag;
  return flag == "--threads" ? ColumnKind::kNotHere : ColumnKind::kUnknown;
}

class SeriesList : public ::testing::Test {
 protected:
  SeriesList() {
    for (const char* name : {"a.mrc", "b.mrc"}) directory_.write(name, "");
    base::set_log_sink(
        [this](base::LogLevel, std::string_view line) { logged_ += std::string(line) + "\n"; });
  }
  ~SeriesList() override { base::set_log_sink({}); }

  std::string path(const std::string& name) const { return (directory_ / name).string(); }
  std::vector<Series> read(const std::string& text) {
    return read_table(directory_.write("list.csv", text), kind_of);
  }
  // Returns all that is said of a table that is refused.
  std::string refusal(const std::string& text) {
    logged_.clear();
    const std::string message = message_of<Error>([&] { read(text); });
    return logged_ + message;
  }

  testing::ScratchDirectory directory_;
  std::string logged_;
};

TEST_F(SeriesList, RowsHaveTheirOwnOptions) {
  const auto all = read("stack,thickness,invert,name,output,center\n" + path("a.mrc") +
                        ",150,true,first,out/x.mrc,\"3,4\"\n" + path("b.mrc") + ",,no\n");
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].name, "first");
  EXPECT_EQ(all[0].input, path("a.mrc"));
  EXPECT_EQ(all[0].output, "out/x.mrc");
  const std::vector<GivenOption> wanted{
      {"--thickness", "150"}, {"--invert", std::nullopt}, {"--center", "3,4"}};
  EXPECT_EQ(all[0].options, wanted);
  EXPECT_EQ(all[1].name, "b");
  EXPECT_TRUE(all[1].options.empty() && all[1].output.empty());
}

TEST_F(SeriesList, EveryMistakeIsNamedWithItsLine) {
  const std::string said = refusal("path,invert\n" + path("a.mrc") + ",maybe\n\nnowhere,\n,\n" +
                                   path("b.mrc") + ",,3\n");
  for (const char* part : {"line 2", "'maybe'", "line 4", "'nowhere'", "line 5", "no stack",
                           "line 6", "3 fields", "4 mistakes"})
    EXPECT_NE(said.find(part), std::string::npos) << part << " in " << said;
}

TEST_F(SeriesList, ColumnsMustBeKnown) {
  const std::string said = refusal("stack,thicknes,threads,,name,name\nx\n");
  for (const char* part : {"'thicknes'", "'threads'", "no name", "two columns 'name'"})
    EXPECT_NE(said.find(part), std::string::npos) << part << " in " << said;
  EXPECT_NE(refusal("stack,path\nx,y\n").find("'stack'"), std::string::npos);
  EXPECT_NE(refusal("stack\n").find("no series"), std::string::npos);
}

TEST_F(SeriesList, PatternsGiveNamesThatDiffer) {
  for (const char* folder : {"one", "two"}) {
    std::filesystem::create_directory(directory_ / folder);
    directory_.write(std::string(folder) + "/series.mrc", "");
  }
  const auto same = expand_pattern(path("*/series.mrc"));
  ASSERT_EQ(same.size(), 2u);
  EXPECT_EQ(same[0].name, "one_series");
  EXPECT_EQ(same[1].name, "two_series");
  const auto folders = expand_pattern(path("*/"));
  ASSERT_EQ(folders.size(), 2u);
  EXPECT_EQ(folders[1].name, "two");
  EXPECT_THROW(expand_pattern(path("*.none")), Error);
}

TEST_F(SeriesList, NamesAndOutputsMustDiffer) {
  const auto series = [](const char* name, const char* output) {
    return Series{.name = name, .source = "x", .input = {}, .output = output, .options = {}};
  };
  EXPECT_NO_THROW(require_own_names({series("a", "a.mrc"), series("b", "b.mrc")}));
  EXPECT_THROW(require_own_names({series("a", "a.mrc"), series("a", "b.mrc")}), Error);
  EXPECT_THROW(require_own_names({series("a", "a.mrc"), series("b", "x/../a.mrc")}), Error);
  for (const char* name : {"", "a/b", ".hidden", "a\nb"})
    EXPECT_THROW(require_own_names({series(name, "a.mrc")}), Error) << name;
}

TEST_F(SeriesList, OptionsOfASeriesReplaceThoseOfAll) {
  const Series series{.name = "n",
                      .source = {},
                      .input = "data/a.mrc",
                      .output = "out/n.mrc",
                      .options = {{"--thickness", "150"}}};
  const std::vector<GivenOption> common{{"--tlt", "{folder}/{name}.tlt"},
                                        {"--thickness", "100"},
                                        {"--center", "-3,4"},
                                        {"--invert", std::nullopt}};
  const std::vector<std::string> wanted{"reconstruct",       "data/a.mrc", "--tlt=data/a.tlt",
                                        "--center=-3,4",     "--invert",   "--thickness=150",
                                        "--output=out/n.mrc"};
  EXPECT_EQ(command_of(series, common), wanted);
}

}  // namespace
}  // namespace tomofield::batch
