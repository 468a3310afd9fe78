#pragma once

#include <string>
#include <utility>
#include <vector>

#include "base/log.h"

namespace tomofield::base {

/// Messages in the order in which they came.
using LogMessages = std::vector<std::pair<LogLevel, std::string>>;

/// Holds back all messages (log.h) while it lives, so that who prepares something says what was
/// noticed when it is used. What nobody takes is sent at the end: an error follows its warnings.
class HeldLog {
 public:
  HeldLog();
  ~HeldLog();
  HeldLog(const HeldLog&) = delete;
  HeldLog& operator=(const HeldLog&) = delete;

  /// Returns the messages up to now, which are not sent.
  LogMessages take();

 private:
  HeldLog* outer_;
  LogMessages messages_;
  friend void send_or_hold(LogLevel level, const std::string& message);
};

/// Sends messages that were taken.
void send(const LogMessages& messages);

}  // namespace tomofield::base
