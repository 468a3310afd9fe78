#include "base/utf8.h"

#include <gtest/gtest.h>

#include <string>

namespace tomofield::base {
namespace {

using namespace std::string_literals;

TEST(Utf8, KeepsCharacters) {
  for (const char* text : {"", "plain", "Å × ½ – 観 😀", "\xEF\xBF\xBD", "\xF4\x8F\xBF\xBF"})
    EXPECT_EQ(utf8_text(text), text);
}

TEST(Utf8, EscapesBytesThatAreNoCharacters) {
  EXPECT_EQ(utf8_text("a\xff"
                      "b.mrc"),
            "a\\xffb.mrc");
  EXPECT_EQ(utf8_text("\xC3"), "\\xc3") << "the end of the character is missing";
  EXPECT_EQ(utf8_text("\xE2\x82z"), "\\xe2\\x82z");
  EXPECT_EQ(utf8_text("\xC0\xAF"), "\\xc0\\xaf") << "an overlong form";
  EXPECT_EQ(utf8_text("\xED\xA0\x80"), "\\xed\\xa0\\x80") << "a surrogate";
  EXPECT_EQ(utf8_text("\xF4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80") << "beyond U+10FFFF";
}

TEST(Printable, TextStaysAsItIs) {
  for (const char* text : {"", "a.mrc", "Ångström × 3 → 日本 🔬", "a\\b 'quoted'"})
    EXPECT_EQ(printable(text), text);
}

TEST(Printable, WhatATerminalObeysIsShown) {
  EXPECT_EQ(printable("\x1b[31mred\x1b]0;title\x07"), "\\x1b[31mred\\x1b]0;title\\x07");
  EXPECT_EQ(printable("two\nlines\r\tand\x7f\0"s), "two\\x0alines\\x0d\\x09and\\x7f\\x00");
  EXPECT_EQ(printable("\xc2\x9b"
                      "31m"),
            "\\xc2\\x9b31m")
      << "CSI as a character of UTF-8";
}

TEST(Printable, BytesThatAreNoUtf8AreShown) {
  EXPECT_EQ(printable("caf\xe9.mrc"), "caf\\xe9.mrc");
  EXPECT_EQ(printable("\x9b"), "\\x9b");
  EXPECT_EQ(printable("\xc3"), "\\xc3");
  EXPECT_EQ(printable("\xe2\x82"), "\\xe2\\x82");
  EXPECT_EQ(printable("\xc0\xaf\xed\xa0\x80\xf5"), "\\xc0\\xaf\\xed\\xa0\\x80\\xf5");
}

}  // namespace
}  // namespace tomofield::base
