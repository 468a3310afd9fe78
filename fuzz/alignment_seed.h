#pragma once

#include <nlohmann/json.hpp>

namespace tomofield::fuzz {

/// Returns what the alignment that write_seeds writes was made from, as
/// realign::alignment_origin() states it.
inline nlohmann::json alignment_origin() {
  return {
      {"made_with", {{"seed", 1}}},
      {"series", {{"sections", 3}, {"size_px", {24, 20}}, {"files", nullptr}, {"pixels", "00"}}}};
}

}  // namespace tomofield::fuzz
