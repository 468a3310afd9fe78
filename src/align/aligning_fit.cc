#include "align/aligning_fit.h"

#include <algorithm>

namespace tomofield::align {

fit::FieldOptions aligning_field(fit::FieldOptions field) {
  field.kind = FieldKind::kGrid;
  field.tree = TreeKind::kUniform;
  field.vertex_spacing = std::max(field.vertex_spacing, 1.0);
  field.leaf_size = fit::usual_leaf_size(field);
  field.depth = fit::usual_depth(field);
  return field;
}

fit::FitOptions aligning_fit(int coarse_epochs, int fine_epochs, std::uint64_t seed) {
  constexpr double kStiffness = 2.0, kLearningRate = 0.035;
  fit::FitOptions options;
  options.seed = seed;
  options.penalty = Penalty::kSmooth;
  options.density_variation = kStiffness * objective::usual_variation(options.penalty);
  options.learning_rate = kLearningRate;
  options.coarse_epochs = coarse_epochs;
  options.epochs = fine_epochs;
  options.fit_noise = false;
  return options;
}

ImagePair image_pair(const measurement::PredictedView& view,
                     const measurement::Measurement& measurement, const fit::Stage& stage) {
  const double bin = stage.bin;
  const auto first_row = static_cast<double>(measurement.rays_shape().first_row);
  return {.width = view.width,
          .height = view.height,
          .pixel = bin * measurement.bin_factor,
          .centre_x = static_cast<double>(measurement.geometry.width) / 2 / bin,
          .centre_y = (static_cast<double>(measurement.geometry.height) / 2 - first_row) / bin,
          .measured = view.measured,
          .predicted = view.predicted};
}

}  // namespace tomofield::align
