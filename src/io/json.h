#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "io/atomic_file.h"

namespace tomofield::io {

/// Writes `document` to `path` atomically, indented for people.
inline void write_json(const std::filesystem::path& path, const nlohmann::json& document) {
  write_text_file(path,
                  document.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
}

}  // namespace tomofield::io
