#pragma once

#include <cstdint>
#include <span>

#include "simulate/project_phantom.h"

namespace tomofield::simulate {

/// Adds exact line integrals through a phantom and its slab to rows [first_row, first_row +
/// sums.size() / view.width) of any view. Each pixel is computed at its own place of the aligned
/// view. For views that keep their rows, project_rows() is faster.
void add_pixels(const Phantom& phantom, const ViewFrame& view, std::int64_t first_row,
                std::span<double> sums);

}  // namespace tomofield::simulate
