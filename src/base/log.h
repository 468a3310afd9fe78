#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tomofield::base {

enum class LogLevel { kInfo, kWarning };

/// Sets the sink that receives all messages of the library, which itself never prints. The default
/// sink drops everything; the program sets its own before any work starts. Several threads may log,
/// but the sink is called by one at a time.
void set_log_sink(std::function<void(LogLevel, std::string_view)> sink);
/// Sends a message to the sink.
void log_info(const std::string& message);
void log_warning(const std::string& message);

/// Messages in the order in which they came.
using LogMessages = std::vector<std::pair<LogLevel, std::string>>;

/// Holds back all messages while it lives, so that who prepares something says what was
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
