#include "cli/options/config_file.h"

#include <fmt/format.h>

#include <toml++/toml.h>
#include <algorithm>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "cli/options/common_options.h"
#include "cli/options/help_formatter.h"
#include "io/saving/output_files.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::cli {
namespace {

constexpr const char* kConfigFlag = "--config";

// Returns the end of the options among the words of a command line: behind "--" all are files.
auto end_of_options(std::vector<std::string>& arguments) {
  return std::ranges::find(arguments, "--");
}

// Removes `--config FILE` or `--config=FILE` from the arguments. Returns FILE, or nothing.
std::optional<std::string> take_config_path(std::vector<std::string>& arguments) {
  std::optional<std::string> path;
  const std::string assignment = std::string(kConfigFlag) + "=";
  for (auto it = arguments.begin(); it != end_of_options(arguments);) {
    const bool is_assignment = it->rfind(assignment, 0) == 0;
    if (*it != kConfigFlag && !is_assignment) {
      ++it;
      continue;
    }
    if (path) throw Error("--config is given twice: put the options into one file");
    const auto end = it + (is_assignment ? 1 : 2);
    if (!is_assignment && it + 1 == end_of_options(arguments))
      throw Error("--config needs a file name");
    path = is_assignment ? it->substr(assignment.size()) : *(it + 1);
    it = arguments.erase(it, end);
  }
  return path;
}

std::string read_config(const std::string& path) {
  try {
    return io::read_text_file(path);
  } catch (const Error& error) {
    throw Error(fmt::format("--config '{}' cannot be read: {}", path, error.what()));
  }
}

// Writes each byte beyond ASCII, and each '%', as '%' and two digits. toml++ 3.3 runs into
// undefined behaviour for some characters outside of texts, so it sees none of them.
std::string encoded(const std::string& text) {
  std::string ascii;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x80 || c == '%')
      ascii += fmt::format("%{:02X}", byte);
    else
      ascii += c;
  }
  return ascii;
}

// Returns the text that encoded() has written.
std::string decoded(const std::string& ascii) {
  std::string text;
  for (std::size_t i = 0; i < ascii.size(); ++i) {
    const auto is_digit = [&](std::size_t at) {
      return at < ascii.size() && std::isxdigit(static_cast<unsigned char>(ascii[at])) != 0;
    };
    const bool is_code = ascii[i] == '%' && is_digit(i + 1) && is_digit(i + 2);
    text += is_code ? static_cast<char>(std::stoi(ascii.substr(i + 1, 2), nullptr, 16)) : ascii[i];
    if (is_code) i += 2;
  }
  return text;
}

toml::table read_toml(const std::string& path) {
  const std::string text = read_config(path);
  try {
    return toml::parse(encoded(text), path);
  } catch (const toml::parse_error& error) {
    const bool is_ascii =
        std::ranges::all_of(text, [](char c) { return static_cast<unsigned char>(c) < 0x80; });
    throw Error(fmt::format("'{}', line {}: {}{}", path, error.source().begin.line,
                            std::string(error.description()),
                            is_ascii ? "" : "; put text with other than ASCII letters in quotes"));
  }
}

// One entry of the file. Its faults name the line.
class Entry {
 public:
  Entry(const std::string& path, std::string name, const toml::node& node)
      : path_(path), name_(std::move(name)), node_(node) {}

  const std::string& name() const { return name_; }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error(
        fmt::format("'{}', line {}: '{}' {}", path_, node_.source().begin.line, name_, what));
  }

  // Returns the words of the command line that the entry stands for.
  std::vector<std::string> arguments(int most_values) const {
    const bool is_flag = most_values == 0;
    const auto flag = node_.value_exact<bool>();
    if (flag.has_value() != is_flag)
      fail(is_flag ? "must be true or false" : "needs a value, not true or false");
    if (flag) return *flag ? std::vector{"--" + name_} : std::vector<std::string>{};
    const toml::array* array = node_.as_array();
    if (array == nullptr) return {"--" + name_ + "=" + text_of(node_)};  // also for "-60:60:2"
    std::vector<std::string> words;
    for (const toml::node& element : *array) words.push_back(text_of(element));
    if (words.empty()) fail_without_value();
    // The list becomes one word, like --roi's. Other options refuse such a word themselves.
    if (most_values == 1) return {fmt::format("--{}={}", name_, fmt::join(words, ","))};
    if (words.size() > static_cast<std::size_t>(most_values))
      fail(fmt::format("takes at most {} values, not {}", most_values, words.size()));
    for (const std::string& word : words)
      if (word.starts_with('-') && !io::parse_number(word))
        fail(fmt::format("has a value '{}', which would be an option", io::quote(word)));
    words.insert(words.begin(), "--" + name_);
    return words;
  }

 private:
  // The command line would take the next word for the value.
  [[noreturn]] void fail_without_value() const { fail("has no value: give one, or leave it out"); }

  std::string text_of(const toml::node& node) const {
    if (const auto text = node.value_exact<std::string>()) {
      if (text->find('\0') != std::string::npos) fail("has a character NUL, which no value has");
      if (text->empty()) fail_without_value();
      return decoded(*text);
    }
    if (const auto integer = node.value_exact<std::int64_t>()) return fmt::format("{}", *integer);
    if (const auto number = node.value_exact<double>()) return fmt::format("{}", *number);
    fail("must be a number, a text, true or false, or an array of numbers or texts");
  }

  const std::string& path_;
  std::string name_;
  const toml::node& node_;
};

}  // namespace

void expand_config_file(const CLI::App& program, std::vector<std::string>& arguments) {
  const std::optional<std::string> path = take_config_path(arguments);
  if (!path) return;
  io::add_input(*path);
  const CLI::App* command = find_command(program, arguments);
  const std::vector<std::string> given(arguments.begin(), end_of_options(arguments));
  for (const auto& [key, node] : read_toml(*path)) {
    const Entry entry(*path, decoded(std::string(key.str())), node);
    const CLI::Option* option = command->get_option_no_throw("--" + entry.name());
    if (option == nullptr || option->check_name(kConfigFlag) || option->check_name("--help") ||
        option->check_name("--help-all")) {
      entry.fail(fmt::format("is no option of `{0}`; `{0} {1}` lists them", full_name(*command),
                             help_flag_of(*command)));
    }
    if (is_given(*option, given)) continue;
    const std::vector<std::string> words = entry.arguments(option->get_items_expected_max());
    arguments.insert(end_of_options(arguments), words.begin(), words.end());
  }
}

std::vector<std::string> names_in_config_file(const std::string& path) {
  std::vector<std::string> names;
  for (const auto& [key, node] : read_toml(path)) names.push_back(decoded(std::string(key.str())));
  return names;
}

}  // namespace tomofield::cli
