#pragma once

#include <filesystem>

#include "compact/compress.h"
#include "output/model_file.h"

namespace tomofield::output {

/// Writes a compact model (docs/model-format.md) atomically: the codes stand for the parameters of
/// `field`, which are not written. load_model() and the other readers take it like any model.
/// Throws Error if `path` cannot be written.
void save_model(const std::filesystem::path& path, const field::Field& field,
                const compact::LeafCodes& codes, const ModelInfo& info);

}  // namespace tomofield::output
