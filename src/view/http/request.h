#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>

namespace tomofield::view {

/// The most bytes of a request that are read. Browsers send the cookies of every server of this
/// machine, whatever its port.
inline constexpr std::size_t kLargestHead = 32 << 10;

/// What the server looks at in the head of a request (RFC 9112).
struct Request {
  std::string method;                             ///< such as "GET"
  std::string path;                               ///< as it was sent, up to the question mark
  std::map<std::string, std::string> parameters;  ///< of the query, decoded
  std::string host;                               ///< empty if the request names none
  bool has_body = false;                          ///< its body is not read
  bool keeps_open = false;                        ///< the connection serves for more requests
};

/// Reads the head of a request, which ends with its empty line. Throws Error if it is not one of
/// HTTP 1.0 or 1.1, if a header has no name or is folded, if Host is given twice, or if the query
/// is none (see parse_query()).
Request parse_request(std::string_view head);

/// Reads the query of an address: names and values with = between them and & behind them, where +
/// is a space and %HH a byte. Throws Error for a % without two hexadecimal digits and for a name
/// that is given twice.
std::map<std::string, std::string> parse_query(std::string_view query);

}  // namespace tomofield::view
