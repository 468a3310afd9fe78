#pragma once

#include <string_view>

namespace tomofield::view {

// The files of src/view/page, which the build puts into the program.

/// Returns the page that shows volumes, page/view.html.
std::string_view view_page();
/// Returns its script, page/view.js.
std::string_view view_script();

}  // namespace tomofield::view
