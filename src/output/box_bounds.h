#pragma once

#include <cstddef>
#include <optional>

#include "field/sampling/sample_box.h"
#include "output/model_file.h"

namespace tomofield::output {

/// The smallest upright box of the field around a box that may be turned, in pixels.
struct BoxBounds {
  field::Point low{}, high{};

  BoxBounds(const field::Point& lowest, const field::Point& highest) : low(lowest), high(highest) {}
  explicit BoxBounds(const field::OrientedBox& box);

  /// Returns the first axis on which this box does not meet another one.
  std::optional<std::size_t> axis_apart(const BoxBounds& other) const;
  /// Returns the first axis on which this box reaches farther than another one by more than
  /// `tolerance_px`.
  std::optional<std::size_t> axis_beyond(const BoxBounds& other, double tolerance_px) const;
};

/// Returns where a model has densities: in the region of interest and in its margin.
BoxBounds field_bounds(const Model& model);

/// Returns the region of interest in the field. Beside it lies the margin, which only some views
/// see.
BoxBounds region_bounds(const ModelInfo& model);

}  // namespace tomofield::output
