#include "compare/methods.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <sstream>
#include <string_view>

#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

// Returns true if a known method with the same first words, such as "baseline tv", has a
// capability.
bool can_do(bool Method::*what, const std::vector<std::string>& arguments) {
  return std::ranges::any_of(known_methods(), [&](const Method& known) {
    const auto& words = known.arguments;
    return known.*what && std::ranges::mismatch(words, arguments).in1 == words.end();
  });
}

// Refuses a name whose files would be those of the comparison or of another method.
void require_free_name(const std::string& name) {
  constexpr std::array kTaken{"comparison", "profile", "report", "pictures", "truth"};
  constexpr std::string_view kTrials = "_tune";  // NAME_tune.json: trials of the method NAME
  if (std::ranges::count(kTaken, name) == 0 && !name.ends_with(kTrials)) return;
  throw Error(
      fmt::format("--also: '{}' would have files that the comparison needs itself ({}, and names "
                  "that end in {}): give another name",
                  name, fmt::join(kTaken, ", "), kTrials));
}

Method parse_method(const std::string& text) {
  const std::size_t equals = text.find('=');
  const std::string name = text.substr(0, equals);
  // A name that begins with '-' would be an option, or a formula in a table.
  const bool can_be_a_file =
      !name.empty() && name.front() != '-' && std::ranges::all_of(name, [](unsigned char c) {
        return std::isalnum(c) || c == '-' || c == '_';
      });
  if (equals == std::string::npos || !can_be_a_file) {
    throw Error(fmt::format(
        "--also '{}': give NAME=COMMAND, the name of letters, digits, _ and - (not first), such "
        "as 'smooth=reconstruct --tv-penalty smooth'",
        text));
  }
  require_free_name(name);
  Method method{.name = name, .title = name, .arguments = {}};
  std::istringstream words(text.substr(equals + 1));
  for (std::string word; words >> word;) method.arguments.push_back(word);
  const std::string command = method.arguments.empty() ? "" : method.arguments.front();
  if (command != "reconstruct" && command != "baseline") {
    throw Error(fmt::format("--also '{}': the command must be reconstruct or baseline, not '{}'",
                            text, command));
  }
  method.resumes = can_do(&Method::resumes, method.arguments);
  method.tunes = can_do(&Method::tunes, method.arguments);
  return method;
}

}  // namespace

std::vector<std::string> names_of(const std::vector<Method>& methods) {
  std::vector<std::string> names;
  for (const Method& m : methods) names.push_back(m.name);
  return names;
}

const std::vector<Method>& known_methods() {
  static const std::vector<Method> methods{
      {.name = "grid",
       .title = "tomofield",
       .arguments = {"reconstruct"},
       .resumes = true,
       .tunes = true},
      {.name = "vm",
       .title = "tomofield, factors",
       .arguments = {"reconstruct", "--field", "vm"},
       .resumes = true,
       .tunes = true},
      {.name = "tv", .title = "total variation", .arguments = {"baseline", "tv"}, .tunes = true},
      {.name = "tv-concave",
       .title = "total variation, concave",
       .arguments = {"baseline", "tv", "--penalty", "concave"},
       .tunes = true},
      {.name = "sart-tv",
       .title = "SART with total variation",
       .arguments = {"baseline", "sart-tv"},
       .tunes = true},
      {.name = "sirt", .title = "SIRT", .arguments = {"baseline", "sirt"}, .tunes = true},
      {.name = "wbp",
       .title = "weighted back-projection",
       .arguments = {"baseline", "wbp"},
       .tunes = true},
      {.name = "tensorf",
       .title = "TensoRF with total variation",
       .arguments = {"baseline", "tensorf"},
       .resumes = true},
      {.name = "tensorf-plain",
       .title = "TensoRF",
       .arguments = {"baseline", "tensorf", "--tv", "0"},
       .resumes = true},
      {.name = "tensorf-ifp",
       .title = "TensoRF with total variation and Fourier prior",
       .arguments = {"baseline", "tensorf", "--ifp", "0.1"},
       .resumes = true},
      {.name = "ingp", .title = "hash grid and network", .arguments = {"baseline", "ingp"}},
      {.name = "fourier-net",
       .title = "network of plane waves",
       .arguments = {"baseline", "fourier-net"}}};
  return methods;
}

std::vector<Method> choose_methods(const std::vector<std::string>& names,
                                   const std::vector<std::string>& others) {
  std::vector<Method> chosen;
  for (const std::string& name : names) {
    const auto known = std::ranges::find(known_methods(), name, &Method::name);
    if (known == known_methods().end()) {
      throw Error(
          fmt::format("--methods: there is no method '{}': give some of {}, or your own "
                      "with --also",
                      name, fmt::join(names_of(known_methods()), ", ")));
    }
    chosen.push_back(*known);
  }
  for (const std::string& other : others) chosen.push_back(parse_method(other));
  std::vector<std::string> all = names_of(chosen);
  std::ranges::sort(all);
  const auto twice = std::ranges::adjacent_find(all);
  if (twice != all.end())
    throw Error(fmt::format("the method '{}' is there twice: give one another name", *twice));
  return chosen;
}

}  // namespace tomofield::compare
