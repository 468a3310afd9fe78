#include "option_table/values.h"

#include <fmt/format.h>
#include <cctype>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <span>
#include <system_error>
#include <type_traits>

#include "base/check.h"
#include "base/enum_names.h"
#include "base/plausible.h"
#include "base/utf8.h"
#include "tomofield/error.h"

namespace tomofield::option_table {
namespace {

using nlohmann::json;

constexpr std::string_view kAutomatic = "auto";

template <typename T>
inline constexpr bool kIsChoice = false;
template <typename T>
inline constexpr bool kIsChoice<Choice<T>> = true;

// Says whether a value may be absent or open.
template <typename T>
inline constexpr bool kIsOptional = kIsChoice<T>;
template <typename T>
inline constexpr bool kIsOptional<std::optional<T>> = true;

// The type of a value, without the std::optional or the Choice around it.
template <typename T>
struct Plain {
  using type = T;
};
template <typename T>
struct Plain<std::optional<T>> {
  using type = T;
};
template <typename T>
struct Plain<Choice<T>> {
  using type = T;
};

template <typename T>
inline constexpr bool kIsNumber = std::is_arithmetic_v<T> && !std::is_same_v<T, bool>;

// Joins names as "a, b or c".
std::string alternatives(const std::vector<std::string>& names) {
  std::string text = names.front();
  for (std::size_t i = 1; i < names.size(); ++i)
    text += (i + 1 == names.size() ? " or " : ", ") + names[i];
  return text;
}

template <typename Enum>
std::vector<std::string> names_of() {
  std::vector<std::string> names;
  for (const auto& [value, name] : base::EnumNames<Enum>::kNames) names.emplace_back(name);
  return names;
}

// Reading. Each overload sets `value`, or returns what the text must be.

template <typename Integer>
requires std::is_integral_v<Integer> std::string read(std::string_view text, Integer& value) {
  Integer number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc::result_out_of_range) return "a whole number that is not so large";
  if (error != std::errc() || end != text.data() + text.size())
    return std::is_unsigned_v<Integer> ? "a whole number from 0" : "a whole number";
  value = number;
  return {};
}

std::string read(std::string_view text, bool& value) {
  if (text != "true" && text != "false") return "true or false";
  value = text == "true";
  return {};
}

std::string read(std::string_view text, double& value) {
  const std::string copy(text);
  char* end = nullptr;
  const double number = std::strtod(copy.c_str(), &end);
  if (copy.empty() || *end != '\0') return "a number";
  value = number;
  return {};
}

std::string read(std::string_view text, std::string& value) {
  value = text;
  return {};
}

std::string read(std::string_view text, std::filesystem::path& value) {
  value = text;
  return {};
}

std::string read(std::string_view text, Rectangle& value) {
  Rectangle found;
  std::int64_t* const corners[] = {&found.x0, &found.y0, &found.x1, &found.y1};
  constexpr const char* kWanted = "four whole numbers, x0,y0,x1,y1";
  std::string_view rest = text;
  for (std::int64_t* corner : corners) {
    const bool is_last = corner == &found.y1;
    const std::size_t end = is_last ? rest.size() : rest.find(',');
    if (end == std::string_view::npos || !read(rest.substr(0, end), *corner).empty())
      return kWanted;
    if (!is_last) rest.remove_prefix(end + 1);
  }
  value = found;
  return {};
}

template <typename Enum>
requires std::is_enum_v<Enum> std::string read(std::string_view text, Enum& value) {
  const std::optional<Enum> found = base::enum_named<Enum>(text);
  if (!found) return alternatives(names_of<Enum>());
  value = *found;
  return {};
}

// Reads a value that can also be automatic; a switch that can is on or off.
template <typename T>
std::string read_chosen(std::string_view text, T& value) {
  if constexpr (std::is_same_v<T, bool>) {
    if (text != "on" && text != "off") return "auto, on or off";
    value = text == "on";
    return {};
  } else {
    const std::string wanted = read(text, value);
    if (wanted.empty() || std::is_same_v<T, Rectangle>) return wanted;
    return fmt::format("auto{} {}", std::is_enum_v<T> ? "," : " or", wanted);
  }
}

std::string read(std::string_view text, std::optional<std::filesystem::path>& value) {
  value = text;
  return {};
}

// Makes an option automatic again, with its usual value.
template <typename T>
std::string set_default(const Row& row, Choice<T>& value) {
  Choices usual;
  value = std::get<Reference<Choice<T>>>(row.member)(usual);
  return {};
}

// Writing.

std::string write(bool value) { return value ? "true" : "false"; }
std::string write(const std::string& value) { return value; }
std::string write(const std::filesystem::path& value) { return value.string(); }
std::string write(const Rectangle& r) { return fmt::format("{},{},{},{}", r.x0, r.y0, r.x1, r.y1); }
template <typename T>
requires(kIsNumber<T> || std::is_enum_v<T>) std::string write(T value) {
  if constexpr (std::is_enum_v<T>)
    return base::name_of(value);
  else
    return fmt::format("{}", value);
}

// JSON.

template <typename T>
json json_of(const T& value) {
  if constexpr (kIsOptional<T>)
    return value.has_value() ? json_of(*value) : json(nullptr);
  else if constexpr (std::is_same_v<T, std::filesystem::path>)
    return base::utf8_text(value.string());
  else if constexpr (std::is_same_v<T, std::string>)
    return base::utf8_text(value);
  else if constexpr (std::is_same_v<T, Rectangle>)
    return {value.x0, value.y0, value.x1, value.y1};
  else if constexpr (std::is_same_v<T, VoxelType>)
    return std::stoi(base::name_of(value));  // the number of the MRC mode
  else if constexpr (std::is_enum_v<T>)
    return base::name_of(value);
  else
    return value;
}

std::string shown(const json& value) {
  if (value.is_null()) return kNoValue;
  if (value.is_string()) return value.get_ref<const std::string&>().empty() ? kNoValue : value;
  if (value.is_boolean()) return value.get<bool>() ? "on" : "off";
  if (value.is_number_float()) return fmt::format("{:.6g}", value.get<double>());
  if (!value.is_array()) return value.dump();
  std::vector<std::string> texts;
  for (const json& item : value) texts.push_back(shown(item));
  return fmt::format("{}", fmt::join(texts, ", "));
}

json::json_pointer pointer_to(std::string_view key) {
  std::string path = fmt::format("/{}", key);
  for (char& c : path)
    if (c == '.') c = '/';
  return json::json_pointer(path);
}

int lower(char c) { return std::tolower(static_cast<unsigned char>(c)); }

}  // namespace

std::string set_from_text(const Row& row, std::string_view text, Choices& choices, Origin origin) {
  return visit_value(row, choices, [&]<typename T>(T& value) -> std::string {
    using Value = typename Plain<T>::type;
    if constexpr (std::is_same_v<T, std::optional<std::filesystem::path>> || !kIsOptional<T>) {
      return read(text, value);
    } else if constexpr (kIsChoice<T>) {
      if (text == kAutomatic) return set_default(row, value);
      Value found{};
      std::string wanted = read_chosen(text, found);
      if (wanted.empty()) value = {std::move(found), origin};
      return wanted;
    } else {
      if (text == kAutomatic) {
        value.reset();
        return {};
      }
      Value found{};
      std::string wanted = read_chosen(text, found);
      if (wanted.empty()) value = std::move(found);
      return wanted;
    }
  });
}

std::string set_flag_from_text(std::string_view flag, const std::string& text, Choices& choices) {
  const std::span<const Row> rows = rows_of_flag(flag);
  TOMOFIELD_CHECK(!rows.empty(), std::string(flag));
  if (rows.size() == 1) {
    const bool turns_off = is_flag(rows.front()) && flag.starts_with("--no-");
    return set_from_text(rows.front(), turns_off ? "false" : text, choices);
  }
  std::size_t begin = 0;
  for (const Row& row : rows) {
    const std::size_t end = text.find(',', begin);
    const std::string wanted =
        set_from_text(row, text.substr(begin, end == text.npos ? end : end - begin), choices);
    if (!wanted.empty() || end == text.npos) return wanted;
    begin = end + 1;
  }
  return fmt::format("at most {} numbers", rows.size());
}

std::optional<std::string> text_of(const Row& row, const Choices& choices) {
  const auto text =
      visit_value(row, choices, []<typename T>(const T& value) -> std::optional<std::string> {
        if constexpr (kIsChoice<T>) {
          if (value.is_open()) return std::nullopt;
          if constexpr (std::is_same_v<T, Choice<bool>>)
            return *value ? "on" : "off";
          else
            return write(*value);
        } else if constexpr (kIsOptional<T>) {
          return value ? std::optional(write(*value)) : std::nullopt;
        } else {
          return write(value);
        }
      });
  return text && text->empty() ? std::nullopt : text;
}

std::string shown_text(const Row& row, const Choices& choices) {
  const json value = visit_value(row, choices, [](const auto& member) { return json_of(member); });
  if (value.is_boolean() && row.flag.starts_with("--no-")) return shown(!value.get<bool>());
  return shown(value);
}

std::string flag_text_of(std::string_view flag, const Choices& choices) {
  std::vector<std::string> texts;
  for (const Row& row : rows_of_flag(flag)) texts.push_back(text_of(row, choices).value_or("none"));
  return fmt::format("{}", fmt::join(texts, ","));
}

std::string label_of(const Row& row) {
  if (!row.label.empty()) return std::string(row.label);
  const Choices none;
  return visit_value(row, none, []<typename T>(const T&) -> std::string {
    using Value = typename Plain<T>::type;
    const std::string automatic = kIsOptional<T> ? "auto|" : "";
    if constexpr (std::is_same_v<T, Choice<bool>>)
      return "auto|on|off";
    else if constexpr (std::is_enum_v<Value>)
      return automatic + fmt::format("{}", fmt::join(names_of<Value>(), "|"));
    else if constexpr (std::is_same_v<Value, std::filesystem::path>)
      return "FILE";
    else if constexpr (std::is_integral_v<Value>)
      return "N";
    else
      return "NUMBER";
  });
}

bool is_flag(const Row& row) { return std::holds_alternative<Reference<bool>>(row.member); }

namespace {

// Returns what is wrong with a number that is out of its range.
template <typename Number>
std::string range_sentence(const Row& row, Number number, const Choices& choices) {
  const std::string flag(flag_of(row.key)), range = row.range.text();
  if (text_of(row, {}) == text_of(row, choices))  // a default that stands for no value
    return fmt::format("{} is required: it must be {}", flag, range);
  const auto as_real = static_cast<double>(number);
  const bool is_huge =
      std::isfinite(as_real) && as_real > base::kLargestNumber && !row.range.has_upper_limit();
  return fmt::format("{} must be {}{}, not {}", flag, range.empty() ? "a finite number" : range,
                     is_huge ? fmt::format(" and at most {:g}", base::kLargestNumber) : "", number);
}

}  // namespace

std::string range_fault(const Row& row, const Choices& choices) {
  return visit_value(row, choices, [&]<typename T>(const T& value) -> std::string {
    using Value = typename Plain<T>::type;
    if constexpr (kIsNumber<Value>) {
      const auto fault_of = [&](Value number) {
        return row.range.contains(static_cast<double>(number))
                   ? std::string()
                   : range_sentence(row, number, choices);
      };
      if constexpr (kIsOptional<T>)
        return value.has_value() ? fault_of(*value) : std::string();
      else
        return fault_of(value);
    } else {
      return {};
    }
  });
}

std::vector<std::string> range_faults(const Options& options) {
  std::vector<std::string> faults;
  const Choices choices{{}, options};
  for (const Row& row : all_rows())
    if (std::string fault = range_fault(row, choices); !fault.empty())
      faults.push_back(std::move(fault));
  return faults;
}

json to_json(const Choices& choices) {
  json all = json::object();
  for (const Row& row : all_rows()) {
    all[pointer_to(row.key)] =
        visit_value(row, choices, [](const auto& value) { return json_of(value); });
  }
  return all;
}

Origin origin_of(const Row& row, const Choices& choices) {
  return visit_value(row, choices, [&]<typename T>(const T& value) {
    if constexpr (kIsChoice<T>) {
      return value.origin();
    } else {
      Choices usual;
      const bool is_usual = value == std::get<Reference<T>>(row.member)(usual);
      const bool is_named = std::ranges::count(choices.options.given, row.flag) > 0;
      return is_usual && !is_named ? Origin::kDefault : Origin::kGiven;
    }
  });
}

void choose_by_contrast(Options& options) {
  const bool is_dark = options.views.contrast == Contrast::kDark;
  if (options.fit.fit_view_scale.is_open())
    options.fit.fit_view_scale = Choice<bool>::usual(is_dark);
  options.field.activation.derive(is_dark ? Activation::kIdentity : Activation::kSoftplus);
}

std::vector<std::string> split_names(std::string_view list) {
  std::vector<std::string> names(1);
  for (const char c : list) {
    if (c == ',')
      names.emplace_back();
    else if (std::isspace(static_cast<unsigned char>(c)) == 0)
      names.back() += c;
  }
  std::erase(names, "");
  return names;
}

bool has_name(const std::vector<std::string>& names, std::string_view name) {
  return std::ranges::any_of(names, [&](const std::string& other) {
    return std::ranges::equal(other, name, {}, lower, lower);
  });
}

}  // namespace tomofield::option_table
