#pragma once

#include <cstddef>

#include "kernels/adam.h"
#include "kernels/convolution.h"
#include "kernels/leaf_decoding.h"
#include "kernels/line_projection.h"
#include "kernels/ray_samples.h"
#include "kernels/row_interpolation.h"
#include "kernels/small_gemm.h"
#include "kernels/spikes.h"
#include "kernels/total_variation.h"

/// Reference implementations of every slab kernel for tests. They are scalar, in double precision,
/// and follow the equations in the headers by another route than the fast kernels. Sizes, strides
/// and geometry come from the same structs. The data are doubles; pointers to floats inside the
/// structs are not used.
namespace tomofield::kernels::reference {

/// Computes C += A B.
void small_gemm(const SmallGemm& shape, const double* a, const double* b, double* c);

/// Returns the weight with which pixel u sees sample j: weight · hat(position(u) − j), or 0.
double line_weight(const LineCrossing& line, int pixel, int sample);

/// Projects a line: detector[u, lane] += Σ_j line_weight(u, j) samples_j[lane] for pixels
/// [first, end), over samples −1 … num_samples.
void project_line(const LineCrossing& line, int num_samples, std::ptrdiff_t stride, int first,
                  int end, const double* samples, double* detector);

/// Applies the adjoint: samples_j[lane] += Σ_u line_weight(u, j) detector[u, lane] for samples
/// [first, end).
void backproject_line(const LineCrossing& line, std::ptrdiff_t stride, int first, int end,
                      const double* detector, double* samples);

/// Return act(value) and act′(value).
double activation_value(Activation activation, double value);
double activation_derivative(Activation activation, double value);

/// Decodes samples[z stride_z + x kLanes + lane] = act(bilinear interpolation of values
/// [x, z, lane]).
void decode_leaf(const LeafPiece& piece, const double* values, double* samples);

/// Applies the adjoint: grad_values += interpolationᵀ (grad_samples · act′(interpolated values)).
/// Returns Σ grad_samples · act′. The derivative is taken from the values, not from the samples.
double decode_leaf_adjoint(const LeafPiece& piece, const double* values, const double* grad_samples,
                           double* grad_values);

/// Computes out[lane, c] = Σ_row hat-weights of the taps · matrix[row, c]; spread_rows applies the
/// adjoint.
void interpolate_rows(const LaneTaps& taps, int width, const double* matrix, double* out);
void spread_rows(const LaneTaps& taps, int width, const double* grad, double* grad_matrix);

/// The total variation of a whole volume [z, x, y], without slabs.
struct VolumeVariation {
  int nx = 0, ny = 0, nz = 0;
  double per_hx = 1.0, per_hz = 1.0, weight = 0.0;
  VariationPenalty penalty;
  bool backward_x = false, backward_z = false;
};

/// Returns weight · Σ φ(√(|∇f|² + ε²)) over all voxels and adds its derivative to `gradient`. The
/// differences are forward and zero past the last of each axis, or backward as the shape says.
double volume_variation(const VolumeVariation& shape, const double* volume, double* gradient);

/// Returns Σ segment_length · act(trilinear interpolation of values [x, z, y]) over the samples of
/// a piece.
double integrate_piece(const LeafVertices& leaf, Activation activation, const double* values,
                       const RayPiece& piece);
/// Adds g times the derivative of that sum to grad_values and returns g times the derivative with
/// respect to the bias.
double spread_piece(const LeafVertices& leaf, Activation activation, const double* values,
                    const RayPiece& piece, double g, double* grad_values);

/// Applies a step of Adam and sets the gradient to zero.
void adam_step(const AdamStep& step, std::ptrdiff_t count, double* parameters, double* gradient,
               double* m, double* v);

/// Moves values beyond the kSpikeRank-th of the 26 values around them to that one.
void limit_spikes(const LatticeShape& shape, int rank, double* values);

/// Convolves all planes of channels; the weights are those of `convolution`.
void convolve(const ChannelShape& shape, const Convolution& convolution, const double* in,
              double* out);

}  // namespace tomofield::kernels::reference
