#pragma once

#include <functional>
#include <string_view>

namespace tomofield {

/// kInfo: what was done; kWarning: what may be wrong with the input.
enum class MessageKind { kInfo, kWarning };

using MessageHandler = std::function<void(MessageKind, std::string_view)>;

/// Sets the function that receives the library's messages, which are dropped without one: the
/// library itself never prints. Set it before any work starts. It is called from any thread, for
/// one message at a time.
void set_message_handler(MessageHandler handler);

}  // namespace tomofield
