#include "base/utf8.h"

#include <cstddef>
#include <cstdint>

namespace tomofield::base {
namespace {

// Returns the number of bytes of the character that the text begins with, or 0 if these bytes are
// none (Unicode 15, table 3-7: no overlong forms, no surrogates, at most U+10FFFF).
std::size_t character_length(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t first = byte(0);
  if (first < 0x80) return 1;
  const std::size_t length = first < 0xC2   ? 0
                             : first < 0xE0 ? 2
                             : first < 0xF0 ? 3
                             : first < 0xF5 ? 4
                                            : 0;
  if (length == 0 || text.size() < length) return 0;
  for (std::size_t i = 1; i < length; ++i)
    if ((byte(i) & 0xC0) != 0x80) return 0;
  const std::uint8_t second = byte(1);
  const bool is_overlong = (first == 0xE0 && second < 0xA0) || (first == 0xF0 && second < 0x90);
  const bool is_beyond = (first == 0xED && second > 0x9F) || (first == 0xF4 && second > 0x8F);
  return is_overlong || is_beyond ? 0 : length;
}

// Says whether a character of UTF-8 is a control character: U+0000 to U+001F, U+007F to U+009F.
bool is_control(std::string_view character) {
  const auto first = static_cast<std::uint8_t>(character[0]);
  return first < 0x20 || first == 0x7F ||
         (first == 0xC2 && static_cast<std::uint8_t>(character[1]) < 0xA0);
}

// Returns bytes as UTF-8, with those escaped that are no character or one that is_hidden() names.
std::string escaped_text(std::string_view bytes, bool (*is_hidden)(std::string_view)) {
  constexpr const char* kDigits = "0123456789abcdef";
  std::string text;
  text.reserve(bytes.size());
  while (!bytes.empty()) {
    std::size_t length = character_length(bytes);
    if (length > 0 && is_hidden(bytes.substr(0, length))) length = 0;
    if (length > 0) {
      text += bytes.substr(0, length);
    } else {
      const auto byte = static_cast<std::uint8_t>(bytes.front());
      text += {'\\', 'x', kDigits[byte >> 4], kDigits[byte & 15]};
    }
    bytes.remove_prefix(length > 0 ? length : 1);
  }
  return text;
}

}  // namespace

std::string utf8_text(std::string_view bytes) {
  return escaped_text(bytes, [](std::string_view) { return false; });
}

std::string printable(std::string_view bytes) { return escaped_text(bytes, is_control); }

}  // namespace tomofield::base
