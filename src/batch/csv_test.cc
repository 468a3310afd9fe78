#include "batch/csv.h"

#include <gtest/gtest.h>

#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

using Fields = std::vector<std::string>;

std::vector<Fields> fields_of(std::string_view text, char separator = ',') {
  std::vector<Fields> all;
  for (CsvRecord& record : parse_csv(text, separator)) all.push_back(record.fields);
  return all;
}

std::string refusal(std::string_view text) {
  try {
    parse_csv(text, ',');
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST(Csv, HasARecordALine) {
  const std::vector<Fields> wanted{{"a", "b"}, {"1", ""}, {"", "2"}};
  EXPECT_EQ(fields_of("a,b\n1,\n,2\n"), wanted);
  EXPECT_EQ(fields_of("a,b\r\n1,\r\n,2"), wanted);
  EXPECT_EQ(fields_of("\xEF\xBB\xBF"
                      "a , b\n\n  1,\n \t\n,2\n"),
            wanted);
  EXPECT_EQ(fields_of("a\tb\n1\t\n\t2\n", '\t'), wanted);
  EXPECT_TRUE(fields_of("").empty());
  EXPECT_TRUE(fields_of("\r\n\n").empty());
}

TEST(Csv, QuotedFieldsMayHaveAnything) {
  const std::vector<Fields> wanted{{"1,2", "say \"no\"", "two\nlines", " kept "}, {"5\" disc"}};
  EXPECT_EQ(fields_of("\"1,2\", \"say \"\"no\"\"\" ,\"two\nlines\",\" kept \"\n5\" disc\n"),
            wanted);
}

TEST(Csv, LinesAreCountedThroughQuotes) {
  const auto records = parse_csv("a\n\n\"x\ny\"\nz\n", ',');
  ASSERT_EQ(records.size(), 3u);
  EXPECT_EQ(records[1].line, 3);
  EXPECT_EQ(records[2].line, 5);
}

TEST(Csv, MistakesNameTheLine) {
  EXPECT_NE(refusal("a\n\"b\n").find("line 2"), std::string::npos);
  EXPECT_NE(refusal("a\nb,\"c\"d\n").find("line 2"), std::string::npos);
}

TEST(Csv, TextsAreNoFormulas) {
  for (const char* const text : {"=1+1", "+1", "-x.mrc", "@sum", "\tx"})
    EXPECT_EQ(spreadsheet_text(text), std::string("'") + text);
  for (const char* const text : {"", "TS_01", "a=b", "'x"}) EXPECT_EQ(spreadsheet_text(text), text);
}

TEST(Csv, FieldsAreReadAsTheyAreWritten) {
  const Fields fields{"plain", "1,2", "a \"b\"", " x", "two\nlines", "", "tab\there"};
  std::string line;
  for (const std::string& field : fields) line += (line.empty() ? "" : ",") + csv_field(field);
  EXPECT_EQ(fields_of(line + "\n"), std::vector<Fields>{fields});
}

}  // namespace
}  // namespace tomofield::batch
