#include "io/tables/star_file.h"

#include <gtest/gtest.h>

#include "expect_parts.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using testing::expect_parts;
using testing::message_of;
using testing::ScratchDirectory;

TEST(StarFile, ReadsTablesWithAndWithoutLoops) {
  const ScratchDirectory scratch;
  const auto path = scratch.write("a.star",
                                  "\xEF\xBB\xBF\n# version 50001\n\ndata_general\n\n_rlnA  1\n"
                                  "_rlnB 'two words'\n\ndata_\n\nloop_ \n_rlnC #1 \n_rlnD #2 \n"
                                  "  [1,2]   -3.5\r\n x/y.mrc \"\"\n\n");
  const auto tables = read_star_file(path);
  ASSERT_EQ(tables.size(), 2u);
  EXPECT_EQ(tables[0].name(), "general");
  EXPECT_EQ(tables[0].num_rows(), 1u);
  EXPECT_EQ(tables[0].find(0, "rlnB"), "two words");
  EXPECT_EQ(tables[1].name(), "");
  ASSERT_EQ(tables[1].num_rows(), 2u);
  EXPECT_EQ(tables[1].find(0, "rlnC"), "[1,2]");
  EXPECT_EQ(tables[1].find(1, "rlnD"), "");
  EXPECT_EQ(tables[1].find(1, "rlnE"), std::nullopt);
  const StarRow row(path, tables[1], 0);
  EXPECT_EQ(row.number("rlnD"), -3.5);
}

TEST(StarFile, RefusesWhatIsNoStarFile) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::string& text) {
    const auto path = scratch.write("a.star", text);
    return message_of<Error>([&] { read_star_file(path); });
  };
  for (const std::string bad :
       {"abc\n", "data_x\nloop_\n_a #1\n_b #2\n1 2 3\n", "data_x\nloop_\n_a\n_a\n1 2\n",
        "data_x\n_a 'never ends\n", "data_x\n_a\n"})
    expect_parts(refusal(bad), {"a.star", "no STAR file"});
  expect_parts(refusal("data_x\nloop_\n_a #1\n_b #2\n1 2 3\n"), {"line:2:1"});
  expect_parts(refusal("data_x\n_a 1\nsave_part\n_b 2\nsave_\n"), {"a.star", "save frame", "part"});
  expect_parts(refusal(std::string(100, '\0')), {"a.star", "zero bytes"});
  EXPECT_TRUE(read_star_file(scratch.write("a.star", "")).empty());
}

TEST(StarFile, NamesTheRowAndTheColumnOfABadValue) {
  const ScratchDirectory scratch;
  const auto path = scratch.write("a.star", "data_t\nloop_\n_a #1\n_b #2\n1 nan\n None 2\n");
  const auto tables = read_star_file(path);
  const StarRow first(path, tables[0], 0), second(path, tables[0], 1);
  expect_parts(message_of<Error>([&] { first.number("b"); }), {"a.star", "data_t", "row 1", "nan"});
  expect_parts(message_of<Error>([&] { second.number("a"); }), {"row 2", "_a is empty"});
  expect_parts(message_of<Error>([&] { first.text("c"); }), {"no column _c"});
  expect_parts(message_of<Error>([&] { second.number("b", 1.0); }), {"'2'", "-1 to 1"});
  EXPECT_EQ(second.find_number("a"), std::nullopt);
  EXPECT_EQ(second.find_text("c"), std::nullopt);
}

TEST(StarFile, WritesWhatItReads) {
  const ScratchDirectory scratch;
  StarTable table("global", {"rlnTomoName", "rlnTomoHand"});
  table.add_row({"TS_01", "-1.00000"});
  table.add_row({"TS 'two'", ""});
  table.set(1, "rlnTomoReconstructedTomogram", "_a.mrc");
  table.set(0, "rlnTomoHand", "1");
  const auto tables = read_star_file(scratch.write("b.star", star_file_text(table)));
  ASSERT_EQ(tables.size(), 1u);
  EXPECT_EQ(tables[0].name(), "global");
  EXPECT_EQ(tables[0].columns(), table.columns());
  EXPECT_EQ(tables[0].find(0, "rlnTomoName"), "TS_01");
  EXPECT_EQ(tables[0].find(0, "rlnTomoHand"), "1");
  EXPECT_EQ(tables[0].find(0, "rlnTomoReconstructedTomogram"), "None");
  EXPECT_EQ(tables[0].find(1, "rlnTomoName"), "TS 'two'");
  EXPECT_EQ(tables[0].find(1, "rlnTomoHand"), "");
  EXPECT_EQ(tables[0].find(1, "rlnTomoReconstructedTomogram"), "_a.mrc");
}

TEST(StarFile, ReadsTheTextsThatItWrites) {
  const ScratchDirectory scratch;
  const std::vector<std::string> texts{
      "data_x",       "Data_", "loop_",      "stop_",   "save_1",
      "global_",      "[x]",   "two\nlines", "$a",      "it's \"so\"",
      "a\n\"b\" 'c'", "_x",    "#1",         ";",       "ä",
      "tab\tbed",     "?",     ".",          "loop_es", ";it's \"so\"",
      ";a\n\"b\" 'c'"};
  StarTable table("global", {"rlnTomoName", "rlnTomoHand"});
  for (const std::string& text : texts) table.add_row({text, text});
  const auto tables = read_star_file(scratch.write("a.star", star_file_text(table)));
  ASSERT_EQ(tables.at(0).num_rows(), texts.size());
  for (std::size_t row = 0; row < texts.size(); ++row) {
    EXPECT_EQ(tables[0].find(row, "rlnTomoName"), texts[row]);
    EXPECT_EQ(tables[0].find(row, "rlnTomoHand"), texts[row]);
  }
}

TEST(StarFile, KeepsSignsOfNoValue) {
  const ScratchDirectory scratch;
  const auto path = scratch.write("a.star", "data_\nloop_\n_a\n_b\n? .\n\"?\" \"\"\n");
  const auto read = read_star_file(path);
  EXPECT_EQ(read.at(0).find(0, "a"), "?");
  EXPECT_EQ(read.at(0).find(0, "b"), ".");
  EXPECT_EQ(StarRow(path, read[0], 0).find_number("b"), std::nullopt);
  const auto again = read_star_file(scratch.write("b.star", star_file_text(read[0])));
  for (const char* column : {"a", "b"})
    for (const std::size_t row : {0, 1})
      EXPECT_EQ(again.at(0).find(row, column), read[0].find(row, column));
}

TEST(StarFile, RefusesATextThatNoQuotesHold) {
  StarTable table("global", {"a"});
  table.add_row({"x\n;y"});
  EXPECT_THROW(star_file_text(table), Error);
}

TEST(StarFile, NamesOfColumnsAreTheSameInUpperAndLowerCase) {
  StarTable table("global", {"rlnTomoName", "rlntomosizex"});
  table.add_row({"TS_01", "3"});
  table.set(0, "rlnTomoSizeX", "4");
  EXPECT_EQ(table.columns().size(), 2u);
  EXPECT_EQ(table.find(0, "rlnTomoSizeX"), "4");
}

TEST(StarFile, RemovesAColumn) {
  StarTable table("global", {"a", "b", "c"});
  table.add_row({"1", "2", "3"});
  table.add_row({"4", "5", "6"});
  table.remove("b");
  table.remove("d");
  EXPECT_EQ(table.columns(), (std::vector<std::string>{"a", "c"}));
  EXPECT_EQ(table.num_rows(), 2u);
  EXPECT_EQ(table.find(1, "a"), "4");
  EXPECT_EQ(table.find(0, "c"), "3");
}

// RELION quotes words with blanks alone (escapeStringForSTAR() in metadata_table.cpp).
TEST(StarFile, ReadsWordsThatRelionWritesAsTheyAre) {
  const ScratchDirectory scratch;
  const auto tables = read_star_file(scratch.write(
      "a.star",
      "# für\ndata_Müller\n\nloop_\n_näme #1\n_b #2\r\n"
      "TS_Müller frames/Bü_0.eer # ü\ndata_01 data_02\n$A _old/A.star\nloop_1 \"_a b\"\n"
      "x ~%41\n'é ~%' \"data_ it's\"\n'A'#1' 'b'#c d' # note\nx\n;first ü\r\ndata_x y\r\n;\n\n"
      "data_next\n_single data_01\n"));
  ASSERT_EQ(tables.size(), 2u);
  EXPECT_EQ(tables[0].name(), "Müller");
  const std::vector<std::pair<std::string, std::string>> rows{{"TS_Müller", "frames/Bü_0.eer"},
                                                              {"data_01", "data_02"},
                                                              {"$A", "_old/A.star"},
                                                              {"loop_1", "_a b"},
                                                              {"x", "~%41"},
                                                              {"é ~%", "data_ it's"},
                                                              {"A'#1", "b'#c d"},
                                                              {"x", "first ü\ndata_x y"}};
  ASSERT_EQ(tables[0].num_rows(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(tables[0].find(i, "näme"), rows[i].first);
    EXPECT_EQ(tables[0].find(i, "b"), rows[i].second);
  }
  EXPECT_EQ(tables[1].name(), "next");
}

}  // namespace
}  // namespace tomofield::io
