#pragma once

#include <filesystem>

namespace tomofield::testing {

/// Returns the folder of the real data sets, shared/data beside the repository. Where it is absent,
/// the tests that need it are skipped.
std::filesystem::path shared_data();

}  // namespace tomofield::testing
