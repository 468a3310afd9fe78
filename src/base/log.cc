#include "base/log.h"

#include <mutex>
#include <utility>

#include "base/threads/fork_safe_mutex.h"

namespace tomofield::base {
namespace {
ForkSafeMutex g_mutex;
std::function<void(LogLevel, std::string_view)> g_sink;
HeldLog* g_holder = nullptr;  // the innermost one
}  // namespace

void send_or_hold(LogLevel level, const std::string& message) {
  const std::lock_guard lock(g_mutex);
  if (g_holder != nullptr)
    g_holder->messages_.emplace_back(level, message);
  else if (g_sink)
    g_sink(level, message);
}

void set_log_sink(std::function<void(LogLevel, std::string_view)> sink) {
  const std::lock_guard lock(g_mutex);
  g_sink = std::move(sink);
}

void log_info(const std::string& message) { send_or_hold(LogLevel::kInfo, message); }
void log_warning(const std::string& message) { send_or_hold(LogLevel::kWarning, message); }

HeldLog::HeldLog() {
  const std::lock_guard lock(g_mutex);
  outer_ = std::exchange(g_holder, this);
}

HeldLog::~HeldLog() {
  {
    const std::lock_guard lock(g_mutex);
    g_holder = outer_;
  }
  send(messages_);
}

LogMessages HeldLog::take() {
  const std::lock_guard lock(g_mutex);
  return std::exchange(messages_, {});
}

void send(const LogMessages& messages) {
  for (const auto& [level, message] : messages) send_or_hold(level, message);
}

}  // namespace tomofield::base
