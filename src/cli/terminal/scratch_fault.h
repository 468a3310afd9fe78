#pragma once

namespace tomofield::cli {

/// Lets a disk that loses a scratch file while it is used (SIGBUS) end the program with a sentence
/// and status 2, as other faults of the disk do.
void tell_scratch_faults();

}  // namespace tomofield::cli
