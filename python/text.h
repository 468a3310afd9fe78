#pragma once

#include <pybind11/pybind11.h>

#include <string_view>

namespace tomofield::python {

/// Returns a text for people. Bytes that are no UTF-8, as names of files may have, become "\xfc".
inline pybind11::str to_message(std::string_view text) {
  return pybind11::reinterpret_steal<pybind11::str>(PyUnicode_DecodeUTF8(
      text.data(), static_cast<pybind11::ssize_t>(text.size()), "backslashreplace"));
}

/// Returns a text that Python's own functions for files take back as the same bytes.
inline pybind11::str to_name(std::string_view text) {
  return pybind11::reinterpret_steal<pybind11::str>(PyUnicode_DecodeUTF8(
      text.data(), static_cast<pybind11::ssize_t>(text.size()), "surrogateescape"));
}

}  // namespace tomofield::python
