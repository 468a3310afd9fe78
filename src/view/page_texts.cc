#include "view/page_texts.h"

#include "view/page_text_files.h"  // made by cmake/WriteTexts.cmake

namespace tomofield::view {

std::string_view view_page() { return kViewPage; }

std::string_view view_script() { return kViewScript; }

}  // namespace tomofield::view
