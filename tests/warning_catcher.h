#pragma once

#include <string>
#include <string_view>

#include "base/log.h"

namespace tomofield::testing {

/// Collects warnings while it lives.
class WarningCatcher {
 public:
  WarningCatcher() {
    base::set_log_sink([this](base::LogLevel level, std::string_view text) {
      if (level == base::LogLevel::kWarning) text_ += std::string(text) + "\n";
    });
  }
  ~WarningCatcher() { base::set_log_sink({}); }
  WarningCatcher(const WarningCatcher&) = delete;
  WarningCatcher& operator=(const WarningCatcher&) = delete;

  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

}  // namespace tomofield::testing
