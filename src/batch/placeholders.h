#pragma once

#include <filesystem>
#include <string>

namespace tomofield::batch {

/// Returns a text with {name}, which stands for the name of a series' file without its ending, and
/// {folder}, which stands for its folder, filled in. Throws Error, with what `where` says of the
/// text, for another word in braces, and for one of these whose brace is not closed.
std::string fill_placeholders(const std::filesystem::path& input, const std::string& text,
                              const std::string& where);

}  // namespace tomofield::batch
