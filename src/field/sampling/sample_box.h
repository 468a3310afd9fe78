#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "field/field.h"

namespace tomofield::field {

using Point = std::array<double, 3>;                    ///< x, y, z
using Rotation = std::array<std::array<double, 3>, 3>;  ///< [row][column]
inline constexpr Rotation kNoRotation{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

/// RELION's matrix of the Euler angles rlnAngleRot, rlnAngleTilt, rlnAnglePsi
/// (ZYZ), which turns a particle's reference into the tomogram: a box rotated
/// by a particle's angles shows it as the reference lies.
Rotation rotation_from_euler(double rot_deg, double tilt_deg, double psi_deg);

/// Cubic voxels anywhere in a field, which is in pixels of the view at zero
/// tilt, z from 0 to the thickness.
struct Box {
  Point centre_px{};                      ///< the box's geometric centre
  std::array<std::int64_t, 3> size{};     ///< voxels in x, y, z
  double voxel_px = 1.0;                  ///< side of a voxel
  Rotation field_from_box = kNoRotation;  ///< about the centre

  bool is_aligned() const { return field_from_box == kNoRotation; }
  /// Position of a point counted in voxels from the box's corner; voxel i covers [i, i + 1).
  Point position(const Point& voxel) const;
};

/// The box whose corners are `low` and `high`, or as much of it as whole voxels
/// fill (at least one), about the same centre.
Box box_between(const Point& low, const Point& high, double voxel_px);

/// Points along one axis whose mean is a voxel: 1 up to a voxel of one pixel.
std::int64_t points_per_voxel(const Box& box);

/// Part of a sampled box: `values` is [section, row, x] with the box's whole
/// width in x, rows along its y and sections along its z.
struct BoxPart {
  std::int64_t first_section, num_sections;
  std::int64_t first_row, num_rows;
  std::span<const float> values;
};

/// Densities of a box, part by part, every voxel once; parts come in any order
/// and from several threads at once. A voxel larger than a pixel is the mean of
/// ceil(voxel_px)³ regularly spaced points, so that coarse boxes do not alias;
/// others are points. Outside the domain the density is 0.
///
/// Boxes that are not rotated are evaluated 16 rows at a time as in a fit; rotated ones
/// point by point, tens of times slower. Memory: a few rows of the field's
/// vertex values and 16 MiB a thread.
using BoxSink = std::function<void(const BoxPart&)>;
void sample_box(const Field& field, const Box& box, const BoxSink& sink);
/// Some of its rows alone; of a box that is not rotated, `first_row` must be a multiple of 16.
struct BoxRows {
  std::int64_t first, end;
};
void sample_box(const Field& field, const Box& box, const BoxRows& rows, const BoxSink& sink);

/// The same at once: [z, y, x].
std::vector<float> sample_box(const Field& field, const Box& box);

}  // namespace tomofield::field
