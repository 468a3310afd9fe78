#pragma once

#include <cstddef>

#include "kernels/adam.h"
#include "kernels/leaf_decoding.h"
#include "kernels/line_projection.h"
#include "kernels/ray_samples.h"
#include "kernels/row_interpolation.h"
#include "kernels/small_gemm.h"
#include "kernels/total_variation.h"

/// Every slab kernel once more: scalar, in double precision, written down from
/// the equations in the headers and by another route than the fast ones, which
/// tests compare with these. Sizes, strides and geometry come from the same
/// structs as theirs; the data are doubles, and pointers to floats inside the
/// structs are not used.
namespace tomofield::kernels::reference {

void small_gemm(const SmallGemm& shape, const double* a, const double* b, double* c);

/// The weight with which pixel u sees sample j: weight · hat(position(u) − j), or 0.
double line_weight(const LineCrossing& line, int pixel, int sample);

/// detector[u, lane] += Σ_j line_weight(u, j) samples_j[lane] for pixels
/// [first, end), with samples −1 … num_samples.
void project_line(const LineCrossing& line, int num_samples, std::ptrdiff_t stride, int first,
                  int end, const double* samples, double* detector);

/// samples_j[lane] += Σ_u line_weight(u, j) detector[u, lane] for samples [first, end).
void backproject_line(const LineCrossing& line, std::ptrdiff_t stride, int first, int end,
                      const double* detector, double* samples);

double activation_value(Activation activation, double value);
double activation_derivative(Activation activation, double value);

/// samples[z stride_z + x kLanes + lane] = act(bilinear interpolation of values [x, z, lane]).
void decode_leaf(const LeafPiece& piece, const double* values, double* samples);

/// grad_values += interpolationᵀ (grad_samples · act′(interpolated values)); returns
/// Σ grad_samples · act′. The derivative is taken from the values, not from the samples.
double decode_leaf_adjoint(const LeafPiece& piece, const double* values, const double* grad_samples,
                           double* grad_values);

/// out[lane, c] = Σ_row hat-weights of the taps · matrix[row, c], and its adjoint.
void interpolate_rows(const LaneTaps& taps, int width, const double* matrix, double* out);
void spread_rows(const LaneTaps& taps, int width, const double* grad, double* grad_matrix);

/// A whole volume [z, x, y], without slabs.
struct VolumeVariation {
  int nx = 0, ny = 0, nz = 0;
  double per_hx = 1.0, per_hz = 1.0, weight = 0.0;
  VariationPenalty penalty;
  bool backward_x = false, backward_z = false;
};

/// weight · Σ φ(√(|∇f|² + ε²)) over all voxels, forward differences that are
/// zero past the last of each axis; adds its derivative to `gradient`.
double volume_variation(const VolumeVariation& shape, const double* volume, double* gradient);

/// Σ segment_length · act(trilinear interpolation of values [x, z, y]) over the
/// samples of a piece, and g times its derivative: grad_values += …; returns the bias's.
double integrate_piece(const LeafVertices& leaf, Activation activation, const double* values,
                       const RayPiece& piece);
double spread_piece(const LeafVertices& leaf, Activation activation, const double* values,
                    const RayPiece& piece, double g, double* grad_values);

void adam_step(const AdamStep& step, std::ptrdiff_t count, double* parameters, double* gradient,
               double* m, double* v);

}  // namespace tomofield::kernels::reference
