#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "io/saving/atomic_file.h"

namespace tomofield::io {

/// Returns `document` as text, indented for people. Replaces the bytes of names that are no UTF-8.
inline std::string json_text(const nlohmann::json& document) {
  return document.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

/// Writes json_text() to `path` atomically.
inline void write_json(const std::filesystem::path& path, const nlohmann::json& document) {
  write_text_file(path, json_text(document));
}

}  // namespace tomofield::io
