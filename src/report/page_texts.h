#pragma once

#include <string_view>

namespace tomofield::report {

// The files of src/report/page, which the build puts into the program.

/// Returns the style sheet of all pages.
std::string_view page_style();
/// Returns the script that shows linked planes of a volume, page/planes.js.
std::string_view planes_script();
/// Returns the script that shows the volume that a page contains, page/report.js.
std::string_view report_script();

}  // namespace tomofield::report
