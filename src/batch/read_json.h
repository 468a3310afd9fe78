#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "io/json_numbers.h"
#include "tomofield/error.h"

namespace tomofield::batch {

/// Returns what `read` makes of a JSON file. If the file cannot be read, or has mistakes, it throws
/// Error with what `sentence` makes of the reason; the sentence names the file.
template <typename Read, typename Sentence>
auto read_json(const std::filesystem::path& file, const Read& read, const Sentence& sentence) {
  std::string why;
  try {
    return read(io::read_json(file));
  } catch (const nlohmann::json::exception& fault) {
    why = io::fault_text(fault);
  } catch (const Error& fault) {
    why = fault.what();
  }
  throw Error(sentence(why));
}

}  // namespace tomofield::batch
