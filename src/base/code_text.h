#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

namespace tomofield::base {

/// A pattern of fmt::format() that the source states: a text of which the compiler does not know
/// the letters does not become one.
class LiteralPattern {
 public:
  template <std::size_t size>
  consteval LiteralPattern(const char (&literal)[size])
      : text_(literal) {}  // NOLINT: literals convert
  constexpr std::string_view text() const { return text_; }

 private:
  std::string_view text_;
};

/// Text that a program obeys, such as the HTML of a page or a script of the shell. It is made of
/// literals of the source, numbers, and words that Language::quoted() made harmless. A std::string
/// or a buffer, which may come from outside, does not become code unless of() quotes it.
template <typename Language>
class CodeText {
 public:
  CodeText() = default;
  template <std::size_t size>
  CodeText(const char (&literal)[size]) : text_(literal) {}  // NOLINT: literals convert
  template <std::size_t size>
  CodeText(char (&buffer)[size]) = delete;

  /// Quotes a text, so that it stands for itself.
  static CodeText of(std::string_view outside) { return made(Language::quoted(outside)); }
  /// Takes code that this program made, or checked, by other means.
  static CodeText made(std::string code) {
    CodeText made;
    made.text_ = std::move(code);
    return made;
  }
  /// Puts code and numbers into a literal, as fmt::format() does.
  template <typename... Parts>
  requires((std::is_same_v<Parts, CodeText> || std::is_arithmetic_v<Parts>)&&...) static CodeText
      format(LiteralPattern pattern, const Parts&... parts) {
    return made(fmt::format(fmt::runtime(pattern.text()), text_of(parts)...));
  }

  CodeText& operator+=(const CodeText& more) {
    text_ += more.text_;
    return *this;
  }
  const std::string& text() const { return text_; }
  bool empty() const { return text_.empty(); }

 private:
  static std::string_view text_of(const CodeText& code) { return code.text_; }
  template <typename Number>
  static Number text_of(Number number) {
    return number;
  }

  std::string text_;
};

/// HTML, with SVG inside. A text from outside has its special characters replaced.
struct Markup {
  static std::string quoted(std::string_view text);
};
using Html = CodeText<Markup>;

/// The language of the shell. A text from outside becomes one word of it.
struct Shell {
  static std::string quoted(std::string_view text);
  /// Leaves a word of letters, digits and "/._-+=:,@%" as it is, for commands that people read.
  static std::string quoted_if_needed(std::string_view text);
};

}  // namespace tomofield::base
