#include "batch/series_list.h"

#include <gtest/gtest.h>

#include <fstream>
#include <utility>

#include "base/log.h"
#include "batch/placeholders.h"
#include "batch/planning.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

using option_table::GivenOption;
using testing::message_of;

ColumnKind kind_of(const std::string& flag) {
  if (flag == "--thickness" || flag == "--center" || flag == "--tlt") return ColumnKind::kWithValue;
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
  std::vector<Series> read(const std::string& text, const std::string& name = "list.csv") {
    base::Faults faults;
    auto all = read_table(directory_.write(name, text),
                          {kind_of, {"thickness", "center", "invert", "tlt"}}, faults);
    require_none(faults);
    return all;
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
                        ",150,true,first,out/x.mrc,\"3,4\"\n" + path("b.mrc") + ",,no,,,\n");
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
                                   path("b.mrc") + ",,3\n" + path("a.mrc") + "\n");
  for (const char* part : {"line 2", "'maybe'", "line 4", "'nowhere'", "line 5", "no stack",
                           "line 6", "3 fields", "line 7", "1 field,", "5 mistakes"})
    EXPECT_NE(said.find(part), std::string::npos) << part << " in " << said;
}

TEST_F(SeriesList, ColumnsMustBeKnown) {
  const std::string said = refusal("stack,thicknes,threads,,name,name\nx\n");
  for (const char* part : {"'thicknes'", "'threads'", "no name", "two columns 'name'"})
    EXPECT_NE(said.find(part), std::string::npos) << part << " in " << said;
  EXPECT_NE(refusal("stack,path\nx,y\n").find("'stack'"), std::string::npos);
  EXPECT_NE(refusal("stack\n").find("no series"), std::string::npos);
}

TEST_F(SeriesList, ColumnsThatAreAlmostRightAreNamed) {
  const std::pair<std::string, std::string> heads[] = {
      {"stack,thicknes", "(did you mean 'thickness'?)"},
      {"stack,--tlt", "'--tlt' must be written 'tlt'"},
      {"stack,Thickness", "'Thickness' must be written 'thickness'"},
      {"Stack,tlt", "'Stack' must be written 'stack'"},
      {"stack;tlt", "semicolons: save it with commas"},
      {"stack\ttlt", "tabs: give the table a name that ends with .tsv"}};
  for (const auto& [head, part] : heads) {
    const std::string said = refusal(head + "\n" + path("a.mrc") + "\n");
    EXPECT_NE(said.find(part), std::string::npos) << part << " in " << said;
    EXPECT_EQ(said.find("one column must be"), std::string::npos) << said;
  }
}

TEST_F(SeriesList, MistakesOfTheHeadDoNotHideThoseOfRows) {
  const std::string said =
      refusal("stack,thicknes,invert\n" + path("a.mrc") + ",12,maybe\nnowhere,1,\n");
  for (const char* part : {"'thicknes'", "'maybe'", "'nowhere'", "3 mistakes"})
    EXPECT_NE(said.find(part), std::string::npos) << part << " in " << said;
}

TEST_F(SeriesList, NamesHavePlaceholders) {
  const auto all = read("stack,name\n" + path("a.mrc") + ",C_{name}\n" + path("b.mrc") + ",{x\n");
  EXPECT_EQ(all[0].name, "C_a");
  EXPECT_EQ(all[1].name, "{x");
  EXPECT_NE(refusal("stack,name\n" + path("a.mrc") + ",C_{nam}\n").find("name: '{nam}' stands"),
            std::string::npos);
  EXPECT_NE(refusal("stack,name\n" + path("a.mrc") + ",{name\n").find("is not closed"),
            std::string::npos);
}

TEST(FillPlaceholders, FillsWordsInBracesAndRefusesOthers) {
  const auto filled = [](const std::string& text) {
    return fill_placeholders("data/a.b.mrc", text, "here");
  };
  EXPECT_EQ(filled("{folder}/{name}.tlt"), "data/a.b.tlt");
  EXPECT_EQ(fill_placeholders("a.mrc", "{folder}", "here"), ".");
  for (const char* text : {"{", "{}", "{1}", "{a b}", "{na", "}{"}) EXPECT_EQ(filled(text), text);
  EXPECT_THROW(filled("{names}"), Error);
  for (const char* text : {"{name.tlt", "{folder/x", "x{name", "{name.tlt}"})
    EXPECT_NE(message_of<Error>([&] { filled(text); }).find("here: the brace of '{"),
              std::string::npos)
        << text;
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
  const auto check = [](const std::vector<Series>& all) {
    base::Faults faults;
    check_names(all, faults);
    require_none(faults);
  };
  EXPECT_NO_THROW(check({series("a", "a.mrc"), series("b", "b.mrc")}));
  EXPECT_THROW(check({series("a", "a.mrc"), series("a", "b.mrc")}), Error);
  EXPECT_THROW(check({series("a", "a.mrc"), series("b", "x/../a.mrc")}), Error);
  for (const char* name : {"", "a/b", ".hidden", "a\nb"})
    EXPECT_THROW(check({series(name, "a.mrc")}), Error) << name;
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

TEST_F(SeriesList, ACellOfAFlagThatIsFalseReplacesThatOfTheCommandLine) {
  const Series without{.name = "n",
                       .source = {},
                       .input = "a.mrc",
                       .output = "n.mrc",
                       .options = {},
                       .left_out = {"--invert"}};
  EXPECT_EQ(command_of(without, {{"--invert", std::nullopt}, {"--bin", "2"}}),
            (std::vector<std::string>{"reconstruct", "a.mrc", "--bin=2", "--output=n.mrc"}));
}

}  // namespace
}  // namespace tomofield::batch
