#include "base/code_text.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <type_traits>

namespace tomofield::base {
namespace {

// A language in which a text stands between brackets.
struct Brackets {
  static std::string quoted(std::string_view text) { return "[" + std::string(text) + "]"; }
};
using Code = CodeText<Brackets>;

struct Others {
  static std::string quoted(std::string_view text) { return std::string(text); }
};

template <typename... Parts>
concept CanBeFormatted = requires(const Parts&... parts) {
  Code::format("{}", parts...);
};

TEST(CodeText, QuotesAWordOfTheShellWhereItNeedsIt) {
  EXPECT_EQ(Shell::quoted_if_needed("a/b-1.mrc"), "a/b-1.mrc");
  EXPECT_EQ(Shell::quoted_if_needed(""), "''");
  for (int c = 1; c < 0x80; ++c) {
    const std::string name = "a" + std::string(1, static_cast<char>(c));
    const bool is_special =
        std::string_view(" \t\n\r|&;<>()$`\\\"'*?[]#~!{}^").find(static_cast<char>(c)) !=
        std::string_view::npos;
    if (!is_special) continue;
    EXPECT_EQ(Shell::quoted_if_needed(name), Shell::quoted(name)) << c;
  }
  EXPECT_EQ(Shell::quoted("it's"), "'it'\\''s'");
}

TEST(CodeText, QuotesWhatComesFromOutside) {
  const std::string name = "a; b";
  Code code = "run ";
  code += Code::of(name);
  code += Code::format(" {}x{:.1f} {}", 2, 0.25, Code::of("c"));
  EXPECT_EQ(code.text(), "run [a; b] 2x0.2 [c]");
}

TEST(CodeText, IsNotMadeOfOtherTexts) {
  static_assert(!std::is_convertible_v<std::string, Code>);
  static_assert(!std::is_convertible_v<std::string_view, Code>);
  static_assert(!std::is_convertible_v<const char*, Code>);
  static_assert(!std::is_convertible_v<CodeText<Others>, Code>);
  static_assert(!std::is_convertible_v<char(&)[8], Code>);  // a buffer
  static_assert(std::is_convertible_v<decltype("literal"), Code>);
}

TEST(CodeText, FormatsNoOtherTexts) {
  static_assert(!std::is_convertible_v<const char*, LiteralPattern>);
  static_assert(!std::is_convertible_v<std::string, LiteralPattern>);
  static_assert(CanBeFormatted<Code>);
  static_assert(CanBeFormatted<double>);
  static_assert(!CanBeFormatted<std::string>);
  static_assert(!CanBeFormatted<const char*>);
  static_assert(!CanBeFormatted<CodeText<Others>>);
}

}  // namespace
}  // namespace tomofield::base
