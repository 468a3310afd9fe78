#pragma once

#include <functional>
#include <string>
#include <string_view>

namespace tomofield::base {

enum class LogLevel { kInfo, kWarning };

/// Sets the sink that receives all messages of the library, which itself never prints. The default
/// sink drops everything; the program sets its own before any work starts. Several threads may log,
/// but the sink is called by one at a time.
void set_log_sink(std::function<void(LogLevel, std::string_view)> sink);
/// Sends a message to the sink.
void log_info(const std::string& message);
void log_warning(const std::string& message);

}  // namespace tomofield::base
