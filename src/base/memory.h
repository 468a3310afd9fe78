#pragma once

#include <cstddef>

namespace tomofield::base {

/// Bytes that can be had now without swapping; 0 where the system does not say.
std::size_t available_memory();

/// Throws Error if `needed` bytes are more than there are: "NOUN needs about X GiB of memory
/// and Y GiB are available: ADVICE". Says nothing where the system does not.
void require_memory(std::size_t needed, const char* noun, const char* advice);

}  // namespace tomofield::base
