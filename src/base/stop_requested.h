#pragma once

namespace tomofield::base {

/// Is thrown by every process of a computation after a stop was requested of one of them.
struct StopRequested {};

}  // namespace tomofield::base
