#include "options.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <tomofield/error.h>

#include <array>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/enum_names.h"
#include "base/nearest_names.h"
#include "option_table/rows.h"
#include "text.h"

namespace tomofield::python {
namespace {

namespace py = pybind11;
using option_table::Choices;
using option_table::Reference;
using option_table::Row;
using Corners = std::array<std::int64_t, 4>;  // x0, y0, x1, y1

// The types that stand for a value in Python: words for enums, and four numbers for a rectangle.
// Each conversion is a function that overloading finds.

template <typename T>
requires(!std::is_enum_v<T>) T to_python(const T& value) { return value; }
Corners to_python(const Rectangle& r) { return {r.x0, r.y0, r.x1, r.y1}; }
template <typename Enum>
requires std::is_enum_v<Enum> std::string to_python(Enum value) {
  return option_table::python_name_of(value);
}

template <typename T>
struct InPython {
  using type = decltype(to_python(std::declval<T>()));
};
template <>
struct InPython<bool> {
  using type = py::bool_;  // None is no False
};

template <typename T>
T from_python(const Row& row, const typename InPython<T>::type& value) {
  if constexpr (std::is_same_v<T, Rectangle>) {
    return {value[0], value[1], value[2], value[3]};
  } else if constexpr (std::is_enum_v<T>) {
    std::string choices;
    for (const auto& [known, _] : base::EnumNames<T>::kNames) {
      const std::string name = option_table::python_name_of(known);
      if (name == value) return known;
      choices += (choices.empty() ? "'" : ", '") + name + "'";
    }
    throw Error("the option " + std::string(row.name) + " is one of " + choices + ", not '" +
                value + "'");
  } else {
    return value;
  }
}

// A property with a value of its own, and one that is None while it is open or absent.

template <typename T>
void add_property(py::class_<Choices>& choices, const Row& row, Reference<T> member) {
  using Value = typename InPython<T>::type;
  choices.def_property(
      row.name.data(), [member](Choices& c) { return to_python(member(c)); },
      [member, &row](Choices& c, const Value& value) {
        member(c) = from_python<T>(row, value);
        c.options.given.emplace_back(row.flag);
      });
}

template <typename T, typename Optional>
void add_optional(py::class_<Choices>& choices, const Row& row, Reference<Optional> member) {
  using Value = std::optional<typename InPython<T>::type>;
  choices.def_property(
      row.name.data(),
      [member](Choices& c) -> Value {
        const Optional& value = member(c);
        return option_table::is_chosen(value) ? Value(to_python(*value)) : std::nullopt;
      },
      [member, &row](Choices& c, const Value& value) {
        Choices usual;
        member(c) = value ? Optional(from_python<T>(row, *value)) : member(usual);
        if (value)
          c.options.given.emplace_back(row.flag);
        else
          std::erase(c.options.given, row.flag);
      });
}

template <typename T>
void add_property(py::class_<Choices>& choices, const Row& row,
                  Reference<std::optional<T>> member) {
  add_optional<T>(choices, row, member);
}
template <typename T>
void add_property(py::class_<Choices>& choices, const Row& row, Reference<Choice<T>> member) {
  add_optional<T>(choices, row, member);
}

// Returns the names in Python of the options that are most like an unknown one: by these names, or
// else by their flags.
std::vector<std::string> nearest_options(const std::string& unknown) {
  std::vector<std::string> names, flags;
  std::map<std::string, std::string> name_of_flag;
  for (const Row& row : option_table::all_rows()) {
    if (row.name == "stack") continue;  // is no option in Python
    std::string_view flag = option_table::flag_of(row.key);
    flag.remove_prefix(flag.find_first_not_of('-'));
    names.emplace_back(row.name);
    if (name_of_flag.emplace(flag, row.name).second) flags.emplace_back(flag);
  }
  std::vector<std::string> nearest = base::nearest_names(unknown, names);
  if (!nearest.empty()) return nearest;
  for (const std::string& flag : base::nearest_names(unknown, flags))
    nearest.push_back(name_of_flag.at(flag));
  return nearest;
}

}  // namespace

void add_options(py::module_& module) {
  py::class_<Choices> choices(module, "Choices");
  choices.def(py::init());
  choices.def("copy", [](const Choices& c) { return c; });
  choices.def_property_readonly("settings", [](const Choices& c) {
    py::list settings;
    for (const Setting& s : c.options.settings)
      settings.append(py::make_tuple(s.option, to_name(s.value), s.file, to_message(s.entry),
                                     to_message(s.row)));
    return settings;
  });
  py::list files;
  for (const Row& row : option_table::all_rows()) {
    std::visit([&](auto member) { add_property(choices, row, member); }, row.member);
    if (row.section == "files") files.append(std::string(row.name));
  }
  module.attr("FILES") = py::tuple(files);
  module.def("nearest_options", &nearest_options);
}

}  // namespace tomofield::python
