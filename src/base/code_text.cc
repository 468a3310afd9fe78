#include "base/code_text.h"

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

}  // namespace tomofield::base
