#pragma once

namespace tomofield::base {

/// Drops all messages (log.h) while it lives: for work that will be done again, and speak then.
class LogPause {
 public:
  LogPause();
  ~LogPause();
  LogPause(const LogPause&) = delete;
  LogPause& operator=(const LogPause&) = delete;
};

}  // namespace tomofield::base
