#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace tomofield::report {

/// Returns a picture (PNG) as the address of an image inside a page ("data:…"). A file of more than
/// a mebibyte, such as a noisy view of many pixels, is reduced to at most 1400 pixels a side and
/// stored as JPEG, so that pages stay small. Throws Error if it cannot be read.
std::string page_picture(const std::filesystem::path& png);

/// Encodes bytes by RFC 4648, with padding.
std::string base64(std::string_view bytes);

}  // namespace tomofield::report
