#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

namespace tomofield {

/// Cubic voxels anywhere in a model. Positions are pixels of the model: of the
/// aligned, binned view at zero tilt, whose pixel i covers [i, i + 1); z runs
/// from 0 to the thickness, towards the source.
struct SampleBox {
  std::array<double, 3> centre_px{};   ///< x, y, z of the box's geometric centre
  std::array<std::int64_t, 3> size{};  ///< voxels in x, y, z
  double voxel_px = 1.0;               ///< side of a voxel
  /// rot, tilt, psi as RELION's rlnAngleRot, rlnAngleTilt, rlnAnglePsi: turned
  /// about its centre, the box shows a particle as its reference lies.
  std::array<double, 3> euler_deg{};
};

/// A density field that `tomofield reconstruct` fitted, read from its model
/// file (.h5). Cheap to copy; a copy shares the field. Everything is const and may
/// be called from several threads, but for the constructor: one file at a time.
class Model {
 public:
  /// Throws tomofield::Error, naming the file and the reason, for anything but
  /// a whole model of a version that this library knows.
  explicit Model(const std::filesystem::path& path);

  double pixel_size_A() const;
  /// The region of interest, of whole voxels of `voxel_px` pixels.
  SampleBox region(double voxel_px = 1.0) const;

  /// Values of a box, [z, y, x] with x fastest, in the units and the contrast of
  /// the tilt series (dark series: dense is low), as `tomofield export` writes
  /// them; 0 outside of the model. Voxels larger than a pixel are means. Throws
  /// Error for sizes below 1 and for numbers that are not finite.
  std::vector<float> sample(const SampleBox& box) const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace tomofield
