#pragma once

#include <memory>

#include "output/model_file.h"
#include "tomofield/model.h"

namespace tomofield {

struct Model::Impl {
  output::Model model;
};

/// Gives the library what the public Model hides.
struct ModelAccess {
  static Model make(output::Model model);
  static const output::Model& model(const Model& model) { return model.impl_->model; }
};

}  // namespace tomofield
