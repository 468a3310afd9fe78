#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "base/plausible.h"

namespace tomofield::io {

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

/// Returns a number, or NaN for any other value, such as the null that stands for NaN in JSON.
double number_or_nan(const nlohmann::json& value);

}  // namespace tomofield::io
