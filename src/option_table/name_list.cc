#include "option_table/name_list.h"

#include <algorithm>
#include <cctype>

namespace tomofield::option_table {
namespace {

int lower(char c) { return std::tolower(static_cast<unsigned char>(c)); }

}  // namespace

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
