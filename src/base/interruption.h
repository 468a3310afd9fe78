#pragma once

#include <functional>

namespace tomofield::base {

/// Sets what long work calls between its parts where nobody follows its progress, as in sampling.
/// What it throws ends the work. Any thread calls it, and often. Set it before any work starts.
void set_interruption(std::function<void()> check);

/// Calls what was set, if anything.
void allow_interruption();

}  // namespace tomofield::base
