#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "base/plausible.h"
#include "io/saving/atomic_file.h"
#include "tomofield/error.h"

namespace tomofield::io {

/// Returns `document` as text, indented for people. Replaces the bytes of names that are no UTF-8.
inline std::string json_text(const nlohmann::json& document) {
  return document.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

/// Writes json_text() to `path` atomically.
inline void write_json(const std::filesystem::path& path, const nlohmann::json& document) {
  write_text_file(path, json_text(document));
}

// Readers of JSON that somebody may have changed. All throw Error with what is wrong, but not
// where: the caller names the file.

/// Parses a document. Refuses one that is nested deeper than any that tomofield writes, because
/// copying it would need more stack than there is.
nlohmann::json parse_json(std::string_view text);

/// Returns a clause with the fault of a document in which the JSON library found another entry than
/// it was asked for.
std::string fault_text(const nlohmann::json::exception& fault);

/// Reads and parses a file as parse_json() does. Throws Error also for a file that is not regular,
/// or is larger than any that tomofield writes.
nlohmann::json read_json(const std::filesystem::path& path);

/// Returns the number of an object under `key`, which must be from `low` to `high`.
base::Finite number_at(const nlohmann::json& object, const char* key, double low, double high);

/// Returns the whole number of an object under `key`, which must be from `low` to `high`.
std::int64_t integer_at(const nlohmann::json& object, const char* key, std::int64_t low,
                        std::int64_t high);

/// Returns the array of numbers of an object under `key`, each of which must be from `low` to
/// `high`.
std::vector<double> numbers_at(const nlohmann::json& object, const char* key, double low,
                               double high);

/// Returns what `read` makes of a JSON file. If the file cannot be read, or has mistakes, it throws
/// Error with what `sentence` makes of the reason; the sentence names the file.
template <typename Read, typename Sentence>
auto read_record(const std::filesystem::path& file, const Read& read, const Sentence& sentence) {
  std::string why;
  try {
    return read(read_json(file));
  } catch (const nlohmann::json::exception& fault) {
    why = fault_text(fault);
  } catch (const Error& fault) {
    why = fault.what();
  }
  throw Error(sentence(why));
}

}  // namespace tomofield::io
