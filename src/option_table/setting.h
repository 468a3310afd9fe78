#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

namespace tomofield::option_table {

/// An option that a file of another program sets, and where it says so.
struct Setting {
  std::string option;          ///< as users type it: "--thickness", or "stack"
  std::string value;           ///< as users type it; "true" for a flag
  std::filesystem::path file;  ///< "TS_01/tilt.com"
  std::string entry;           ///< the name in that file: "THICKNESS"
  std::string row = {};        ///< the name of its row, if the file lists several series
};

/// Returns settings as an array of objects with the members of Setting, for the metrics.
nlohmann::json to_json(std::span<const Setting> settings);

}  // namespace tomofield::option_table
