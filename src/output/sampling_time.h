#pragma once

#include <span>

#include "field/sampling/sample_box.h"
#include "output/model_file.h"

namespace tomofield::output {

/// Says how long it may take to sample these boxes one after the other, if it is more than some
/// seconds: a small part of one of them is timed. A warning says it of more than ten minutes. The
/// boxes have equal sizes; there is at least one.
void announce_sampling(const Model& model, std::span<const field::OrientedBox> boxes);

}  // namespace tomofield::output
