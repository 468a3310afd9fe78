#include "io/json.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using nlohmann::json;

constexpr int kMostLevels = 32;

const json& entry(const json& object, const char* key) {
  const auto found = object.is_object() ? object.find(key) : object.end();
  if (!object.is_object() || found == object.end())
    throw Error(fmt::format("there is no '{}'", key));
  return *found;
}

// `value` has an accepted depth, since parse_json() made it.
std::string text_of(const json& value) {
  return quote(value.dump(-1, ' ', false, json::error_handler_t::replace));
}

base::Finite number_in(const json& value, const char* key, double low, double high) {
  if (value.is_number()) {
    if (const auto number = base::Interval(low, high).find(value.get<double>())) return *number;
  }
  throw Error(
      fmt::format("'{}' is {}, not a number from {} to {}", key, text_of(value), low, high));
}

// Says where a document stops to be JSON.
std::string place_text(std::string_view text, std::size_t byte) {
  const std::string_view before = text.substr(0, byte > 0 ? byte - 1 : 0);
  const auto line = 1 + std::ranges::count(before, '\n');
  const std::size_t column = before.size() - (before.rfind('\n') + 1) + 1;
  return fmt::format("it is no JSON from line {}, column {} on", line, column);
}

}  // namespace

std::string fault_text(const json::exception& fault) {
  constexpr int kKeyNotFound = 403;
  const std::string said = fault.what();
  const std::size_t key = said.find('\''), end = said.rfind('\'');
  if (fault.id == kKeyNotFound && key < end)
    return fmt::format("there is no '{}'", quote(said.substr(key + 1, end - key - 1)));
  return "an entry is of another kind than tomofield writes there";
}

json parse_json(std::string_view text) {
  const auto refuse_depth = [](int depth, json::parse_event_t, json&) {
    if (depth > kMostLevels)
      throw Error(fmt::format("it is nested deeper than {} levels", kMostLevels));
    return true;
  };
  try {
    return json::parse(text.begin(), text.end(), refuse_depth);
  } catch (const json::parse_error& error) {
    throw Error(place_text(text, error.byte));
  } catch (const json::exception&) {
    throw Error("it has a number that is too large");
  }
}

json read_json(const std::filesystem::path& path) { return parse_json(read_text_file(path)); }

base::Finite number_at(const json& object, const char* key, double low, double high) {
  return number_in(entry(object, key), key, low, high);
}

std::int64_t integer_at(const json& object, const char* key, std::int64_t low, std::int64_t high) {
  const json& value = entry(object, key);
  const bool fits = value.is_number_unsigned() ? value.get<std::uint64_t>() <= INT64_MAX
                                               : value.is_number_integer();
  const std::int64_t number = fits ? value.get<std::int64_t>() : low;
  if (fits && number >= low && number <= high) return number;
  throw Error(
      fmt::format("'{}' is {}, not a whole number from {} to {}", key, text_of(value), low, high));
}

std::vector<double> numbers_at(const json& object, const char* key, double low, double high) {
  const json& values = entry(object, key);
  if (!values.is_array()) throw Error(fmt::format("'{}' is no array of numbers", key));
  std::vector<double> numbers;
  for (const json& value : values) numbers.push_back(number_in(value, key, low, high));
  return numbers;
}

}  // namespace tomofield::io
