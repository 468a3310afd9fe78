#include "base/log.h"

#include <mutex>
#include <utility>

#include "base/log_pause.h"

namespace tomofield::base {
namespace {
std::mutex g_mutex;
std::function<void(LogLevel, std::string_view)> g_sink;
int g_num_pauses = 0;

void emit(LogLevel level, const std::string& message) {
  const std::lock_guard lock(g_mutex);
  if (g_sink && g_num_pauses == 0) g_sink(level, message);
}
}  // namespace

void set_log_sink(std::function<void(LogLevel, std::string_view)> sink) {
  const std::lock_guard lock(g_mutex);
  g_sink = std::move(sink);
}

void log_info(const std::string& message) { emit(LogLevel::kInfo, message); }
void log_warning(const std::string& message) { emit(LogLevel::kWarning, message); }

LogPause::LogPause() {
  const std::lock_guard lock(g_mutex);
  ++g_num_pauses;
}

LogPause::~LogPause() {
  const std::lock_guard lock(g_mutex);
  --g_num_pauses;
}

}  // namespace tomofield::base
