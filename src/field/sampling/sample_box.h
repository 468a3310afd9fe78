#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "base/range.h"
#include "field/field.h"
#include "tomofield/options.h"

namespace tomofield::field {

using Point = std::array<double, 3>;                    ///< x, y, z
using Rotation = std::array<std::array<double, 3>, 3>;  ///< [row][column]
inline constexpr Rotation kNoRotation{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

/// Returns RELION's matrix of the Euler angles rlnAngleRot, rlnAngleTilt, rlnAnglePsi (ZYZ), in
/// degrees. It turns a particle's reference into the tomogram, so a box rotated by a particle's
/// angles shows the particle in the orientation of the reference. Throws Error for angles that are
/// not finite or beyond ± 1e5.
Rotation rotation_from_euler(double rot_deg, double tilt_deg, double psi_deg);

/// A box of cubic voxels anywhere in a field, like the public SampleBox but with its rotation as a
/// matrix. The field's coordinates are pixels of the view at zero tilt, with z from 0 to the
/// thickness.
struct OrientedBox {
  Point centre_px{};                      ///< the box's geometric centre
  std::array<std::int64_t, 3> size{};     ///< voxels in x, y, z
  double voxel_px = 1.0;                  ///< side of a voxel in pixels
  Rotation field_from_box = kNoRotation;  ///< rotation about the centre

  bool is_aligned() const { return field_from_box == kNoRotation; }
  /// Returns the position in the field of a point that is counted in voxels from the box's corner;
  /// voxel i covers [i, i + 1).
  Point position(const Point& voxel) const;
};

/// The voxels that a box may have along an axis. A row of them is sampled within a second.
inline constexpr std::int64_t kMostVoxelsAlongAxis = std::int64_t{1} << 24;

/// Returns the box with corners `low` and `high`, about the same centre, as far as whole voxels
/// fill it (at least one). Throws Error for more than kMostVoxelsAlongAxis voxels in a side.
OrientedBox box_between(const Point& low, const Point& high, double voxel_px);

/// Returns the number of points in all voxels of a box.
double num_points(const OrientedBox& box);

/// Throws Error for a box that cannot be sampled in reasonable time: with more than 10¹³ points in
/// all of its voxels, or a side of more than kMostVoxelsAlongAxis. All arithmetic on the sizes of a
/// box is safe after that.
void require_feasible(const OrientedBox& box);

/// Returns the number of points along each axis whose mean is a voxel: 1 for voxels up to one
/// pixel.
std::int64_t points_per_voxel(const OrientedBox& box);

/// A part of a sampled box. `values` are [section, row, x] with the box's whole width in x; rows go
/// along its y and sections along its z.
struct BoxPart {
  std::int64_t first_section, num_sections;
  std::int64_t first_row, num_rows;
  std::span<const float> values;
};

/// Receives the densities of a box part by part, every voxel once. Parts come in any order and from
/// several threads at once.
using BoxSink = std::function<void(const BoxPart&)>;
/// Computes the densities of a box. A voxel larger than a pixel is the mean of ceil(voxel_px)³
/// regularly spaced points, so that coarse boxes do not alias; other voxels are single points. The
/// density is 0 outside the domain. Throws Error as require_feasible() does, and if memory is too
/// small for the rows that are sampled at once.
///
/// Boxes that are not rotated are evaluated 16 rows at a time, as in a fit. Rotated ones are
/// evaluated point by point, which is tens of times slower. Memory: a few rows of the field's
/// vertex values, and 16 MiB a thread.
void sample_box(const Field& field, const OrientedBox& box, const BoxSink& sink);
/// Computes the densities of some rows of a box. If the box is not rotated, the range must begin at
/// a multiple of 16.
void sample_box(const Field& field, const OrientedBox& box, base::Range rows, const BoxSink& sink);

/// Throws Error as require_feasible() does, or if memory is too small for all voxels of a box.
void require_memory_of(const OrientedBox& box);
/// Returns the densities of a whole box, [z, y, x]. Throws Error as require_memory_of() does.
std::vector<float> sample_box(const Field& field, const OrientedBox& box);

/// Passes every voxel of a box to a sink.
using BoxSource = std::function<void(const BoxSink&)>;
/// Returns the densities that a source passes of a box, [z, y, x]. Throws Error as
/// require_memory_of() does.
std::vector<float> gather_box(const OrientedBox& box, const BoxSource& source);

/// Returns the densities at points, 0 outside the domain.
std::vector<float> sample_points(const Field& field, std::span<const Point> points);

/// Returns the densities of a region at half the thickness, one value a pixel: [y, x].
std::vector<float> middle_plane(const Field& field, const Rectangle& region);

}  // namespace tomofield::field
