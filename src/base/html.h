#pragma once

#include <string>
#include <string_view>

#include "base/code_text.h"

namespace tomofield::base {

/// HTML, with SVG inside. A text from outside has its special characters replaced.
struct Markup {
  static std::string quoted(std::string_view text);
};
using Html = CodeText<Markup>;

}  // namespace tomofield::base
