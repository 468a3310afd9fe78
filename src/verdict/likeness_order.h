#pragma once

#include <optional>
#include <vector>

#include "evaluate/image_pair.h"

namespace tomofield::verdict {

/// Returns the probability that two views that are neighbours in tilt are more alike than two that
/// are not: near 1 for the angles of the views, near ½ for shuffled ones. `images` are small images
/// of the views, all of one size and in order of tilt; they may lie four pixels off in x and y.
/// Returns nothing for fewer than twelve, or if no two of them are more alike than noise is.
std::optional<double> order_by_likeness(const std::vector<evaluate::Image>& images);

}  // namespace tomofield::verdict
