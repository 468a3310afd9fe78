#pragma once

#include <cstddef>

namespace tomofield::base {

/// Returns the bytes that can be allocated now without swapping, or 0 if the system does not say.
std::size_t available_memory();

/// Returns the bytes that this process has had in memory at most, or 0 if the system does not say.
std::size_t peak_memory();

/// Throws Error if `needed` bytes are more than are available: "NOUN needs about X GiB of memory
/// and Y GiB are available: ADVICE". Does nothing if the system does not say how many there are.
void require_memory(std::size_t needed, const char* noun, const char* advice);

}  // namespace tomofield::base
