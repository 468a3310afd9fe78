#include "view/http/request.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::view {
namespace {

constexpr std::string_view kLineEnd = "\r\n";

// Removes what lies before a separator from a text and returns it, or the whole text if there is
// none.
std::string_view take_until(std::string_view& text, std::string_view separator) {
  const std::size_t at = text.find(separator);
  const std::string_view before = text.substr(0, at);
  text.remove_prefix(at == std::string_view::npos ? text.size() : at + separator.size());
  return before;
}

bool is_visible(char c) { return c > ' ' && c < '\x7f'; }

std::string lower_case(std::string_view text) {
  std::string lower(text);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return lower;
}

std::string_view without_spaces(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

std::string decoded(std::string_view text) {
  std::string plain;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      plain += text[i] == '+' ? ' ' : text[i];
      continue;
    }
    unsigned char byte = 0;
    const char* digits = text.data() + i + 1;
    if (i + 2 >= text.size() || std::from_chars(digits, digits + 2, byte, 16).ptr != digits + 2)
      throw Error("a % in the address must have two hexadecimal digits behind it");
    plain += static_cast<char>(byte);
    i += 2;
  }
  return plain;
}

// Reads "GET /path?query HTTP/1.1".
void read_request_line(std::string_view line, Request& request) {
  request.method = take_until(line, " ");
  std::string_view target = take_until(line, " ");
  const bool is_target = target.starts_with('/') && std::ranges::all_of(target, is_visible);
  if (request.method.empty() || !is_target || (line != "HTTP/1.1" && line != "HTTP/1.0"))
    throw Error("this is no request of HTTP 1.0 or 1.1");
  request.keeps_open = line == "HTTP/1.1";
  request.path = take_until(target, "?");
  request.parameters = parse_query(target);
}

void read_header(std::string_view line, Request& request) {
  const bool has_name = line.find(':') != std::string_view::npos;
  const std::string name = lower_case(take_until(line, ":"));
  const std::string_view value = without_spaces(line);
  if (!has_name || name.empty() || !std::ranges::all_of(name, is_visible))
    throw Error("a header of the request has no name");
  if (name == "host") {
    if (!request.host.empty()) throw Error("the request names two hosts");
    request.host = value;
  } else if (name == "connection") {
    if (lower_case(value) == "close") request.keeps_open = false;
  } else if (name == "transfer-encoding" || (name == "content-length" && value != "0")) {
    request.has_body = true;
  }
}

}  // namespace

std::map<std::string, std::string> parse_query(std::string_view query) {
  std::map<std::string, std::string> parameters;
  while (!query.empty()) {
    std::string_view value = take_until(query, "&");
    const std::string name = decoded(take_until(value, "="));
    if (!parameters.emplace(name, decoded(value)).second)
      throw Error(fmt::format("'{}' is given twice", io::quote(name)));
  }
  return parameters;
}

Request parse_request(std::string_view head) {
  Request request;
  read_request_line(take_until(head, kLineEnd), request);
  while (true) {
    const std::string_view line = take_until(head, kLineEnd);
    if (line.empty()) return request;
    read_header(line, request);
  }
}

}  // namespace tomofield::view
