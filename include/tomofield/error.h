#pragma once

#include <stdexcept>
#include <string>

namespace tomofield {

/// A failure that the user or the system caused: bad input, an unwritable
/// file, too little memory. The message is one sentence or a few that say
/// what is wrong, where, and what to do about it. The program prints it and
/// exits with status 2; any other exception is a bug of ours and exits 1.
class Error : public std::runtime_error {
 public:
  explicit Error(const std::string& message) : std::runtime_error(without_nulls(message)) {}

 private:
  /// what() ends at a null character, which a text of the user may have.
  static std::string without_nulls(std::string text) {
    for (std::size_t at = 0; (at = text.find('\0', at)) != std::string::npos;)
      text.replace(at, 1, "\\x00");
    return text;
  }
};

}  // namespace tomofield
