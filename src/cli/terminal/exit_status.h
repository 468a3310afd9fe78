#pragma once

#include <stdexcept>
#include <string>

namespace tomofield::cli {

/// Ends the program with a message and a status of its own. A run that a signal stopped is neither
/// a success nor a fault.
class ExitStatus : public std::runtime_error {
 public:
  ExitStatus(int status, const std::string& message)
      : std::runtime_error(message), status_(status) {}
  int status() const { return status_; }

 private:
  int status_;
};

}  // namespace tomofield::cli
