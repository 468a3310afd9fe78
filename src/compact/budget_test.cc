#include "compact/budget.h"

#include <gtest/gtest.h>

#include <string>

#include "tomofield/error.h"

namespace tomofield::compact {
namespace {

void expect_budget(const char* text, Budget::Kind kind, double amount) {
  const Budget budget = parse_budget(text);
  EXPECT_EQ(budget.kind, kind) << text;
  EXPECT_DOUBLE_EQ(budget.amount, amount) << text;
}

TEST(Budget, HasThreeUnits) {
  using enum Budget::Kind;
  expect_budget("0.1dB", kDecibels, 0.1);
  expect_budget("500000", kParameters, 5e5);
  expect_budget("500k", kParameters, 5e5);
  expect_budget("1.5M", kParameters, 1.5e6);
  expect_budget("800kB", kBytes, 8e5);
  expect_budget("5MB", kBytes, 5e6);
  expect_budget("0.1db", kDecibels, 0.1);
  expect_budget("5mb", kBytes, 5e6);
}

TEST(Budget, OtherTextsGetASentence) {
  for (const char* text :
       {"", "dB", "0.1", "-2M", "0dB", "11dB", "nan", "infdB", "5m", "5 MB", "1MBx", "999e-3kB"}) {
    SCOPED_TRACE(text);
    try {
      parse_budget(text);
      ADD_FAILURE() << "no error";
    } catch (const Error& error) {
      const std::string message = error.what();
      EXPECT_NE(message.find(std::string("'") + text + "' is no budget"), std::string::npos)
          << message;
      EXPECT_NE(message.find("5MB"), std::string::npos) << message;
    }
  }
}

}  // namespace
}  // namespace tomofield::compact
