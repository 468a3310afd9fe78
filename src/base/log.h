#pragma once

#include <functional>
#include <string>
#include <string_view>

namespace tomofield::base {

enum class LogLevel { kInfo, kWarning };

/// The library says things through this sink only; it never prints. The
/// default sink drops everything; the program sets its own. Set it before any
/// work starts; the sink may be called from several threads, one at a time.
void set_log_sink(std::function<void(LogLevel, std::string_view)> sink);
void log_info(const std::string& message);
void log_warning(const std::string& message);

}  // namespace tomofield::base
