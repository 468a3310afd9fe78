#include "report/page_texts.h"

#include "report/page_text_files.h"  // made by cmake/WriteTexts.cmake

namespace tomofield::report {

std::string_view page_style() { return kPageStyle; }

std::string_view planes_script() { return kPlanesScript; }

std::string_view report_script() { return kReportScript; }

}  // namespace tomofield::report
