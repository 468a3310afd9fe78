#pragma once

#include <cstdint>
#include <string>

#include "field/field.h"

// Declares what the writer and the reader of model files share (model_writer.cc, model_file.cc).
namespace tomofield::output {

// These values are in files: do not change one without a new version.
inline constexpr const char* kFormat = "tomofield model";
inline constexpr std::int64_t kFormatVersion = 2;
inline constexpr std::int64_t kCompactVersion = 3;  ///< of models with codes in place of parameters

/// Throws Error, which begins with `complaint`, if a parameter that a field keeps is not
/// plausible (base/plausible.h).
void require_plausible_parameters(const field::Field& field, const std::string& complaint);

}  // namespace tomofield::output
