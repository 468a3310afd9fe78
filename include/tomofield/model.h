#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

namespace tomofield {

/// A position in the volume that reconstruct writes of all of the view: x, y, z in pixels of the
/// aligned, binned view at zero tilt, whose pixel i covers [i, i + 1); z runs from 0 to the
/// thickness, towards the source. An x-axis tilt of the views is turned back in it.
using Point = std::array<double, 3>;

/// Cubic voxels anywhere in a model. A tilted plane is a box with one voxel in z.
struct SampleBox {
  Point centre_px{};                   ///< the box's geometric centre
  std::array<std::int64_t, 3> size{};  ///< voxels in x, y, z
  double voxel_px = 1.0;               ///< side of a voxel
  /// rot, tilt, psi as RELION's rlnAngleRot, rlnAngleTilt, rlnAnglePsi: turned
  /// about its centre, the box shows a particle as its reference lies.
  std::array<double, 3> euler_deg{};
};

/// The angles that bring a specimen level, as options of a reconstruction would (`--tilt-offset`,
/// `--x-axis-tilt`).
struct Levelling {
  double pitch_deg = 0.0;   ///< is added to all tilt angles
  double x_tilt_deg = 0.0;  ///< is subtracted from the x-axis tilts of all views
};

/// A density field that reconstruct() fitted, in memory or read from a model file (.h5). Cheap to
/// copy; a copy shares the field. Everything is const and may be called from several threads,
/// except the constructor, which reads one file at a time.
///
/// Values are in the units and the contrast of the tilt series (dark series: dense is low), and 0
/// outside of the model.
class Model {
 public:
  /// Throws tomofield::Error, naming the file and the reason, for anything but
  /// a whole model of a version that this library knows. A compact model whose vertices take more
  /// than a quarter of the free memory is not decoded here: each call of sample() and
  /// sample_points() decodes the parts that it needs, which takes some time.
  explicit Model(const std::filesystem::path& path);

  /// Returns the size in Å of the pixels that positions count.
  double pixel_size_A() const;
  /// Returns the region of interest, in whole voxels of `voxel_px` pixels. Throws Error for a size
  /// of voxels that is not finite or not above 0.
  SampleBox region(double voxel_px = 1.0) const;

  /// Returns the values of a box, [z, y, x] with x fastest, as `tomofield export` writes them.
  /// Voxels larger than a pixel are means. Throws Error for sizes below 1 and for numbers that are
  /// not finite, and for a compact model that is not decoded if its codes are damaged or if the
  /// memory is not enough.
  std::vector<float> sample(const SampleBox& box) const;

  /// Returns the value at each point. Throws Error for numbers that are not finite, and as sample()
  /// does.
  std::vector<float> sample_points(std::span<const Point> points) const;

 private:
  friend struct ModelAccess;
  struct Impl;
  explicit Model(std::shared_ptr<const Impl> impl);
  std::shared_ptr<const Impl> impl_;
};

}  // namespace tomofield
