#pragma once

#include "kernels/total_variation.h"

namespace tomofield::field {

/// Returns weight · Σ φ over a stack of arrays [n0, n1, n2, channels] and adds its gradient. The
/// differences are forward, along the first three axes, for each channel by itself. An axis of size
/// 1 has no differences, so the function serves vectors, matrices and volumes of parameters alike.
double array_variation(const float* values, int n0, int n1, int n2, int channels,
                       const kernels::VariationPenalty& penalty, double weight, float* gradient);

}  // namespace tomofield::field
