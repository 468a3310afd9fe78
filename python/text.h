#pragma once

#include <pybind11/pybind11.h>

#include <string_view>

namespace tomofield::python {

/// Returns a text whose bytes that are no UTF-8, as names of files may have, are taken as one of
/// Python's error handlers says.
inline pybind11::str decoded(std::string_view text, const char* errors) {
  return pybind11::reinterpret_steal<pybind11::str>(
      PyUnicode_DecodeUTF8(text.data(), static_cast<pybind11::ssize_t>(text.size()), errors));
}

/// Returns a text for people, with "\xfc" for such a byte.
inline pybind11::str to_message(std::string_view text) { return decoded(text, "backslashreplace"); }

/// Returns a text that Python's own functions for files take back as the same bytes.
inline pybind11::str to_name(std::string_view text) { return decoded(text, "surrogateescape"); }

}  // namespace tomofield::python
