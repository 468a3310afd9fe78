#include "base/code_text.h"

#include <algorithm>
#include <cctype>

#include "base/utf8.h"

namespace tomofield::base {

std::string Markup::quoted(std::string_view text) {
  std::string escaped;
  for (const char c : utf8_text(text)) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string Shell::quoted(std::string_view text) {
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? "'\\''" : std::string(1, c);
  return word + "'";
}

std::string Shell::quoted_if_needed(std::string_view text) {
  const bool is_plain = std::ranges::all_of(text, [](unsigned char c) {
    return c >= 0x80 || std::isalnum(c) != 0 ||
           std::string_view("/._-+=:,@%").find(static_cast<char>(c)) != std::string_view::npos;
  });
  return is_plain && !text.empty() ? std::string(text) : quoted(text);
}

}  // namespace tomofield::base
