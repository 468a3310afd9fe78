#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "report/contrast.h"
#include "view/plane.h"

namespace tomofield::view {

/// A volume that planes can be taken from.
class ViewedVolume {
 public:
  virtual ~ViewedVolume() = default;
  ViewedVolume(const ViewedVolume&) = delete;
  ViewedVolume& operator=(const ViewedVolume&) = delete;

  /// Returns the values of the pixels of a plane, [row, column] with row 0 at the bottom; NaN
  /// where the middle of a pixel is outside of the volume, which costs next to nothing. Throws
  /// base::StopRequested after `must_stop` has returned true, which is asked several times a
  /// second.
  std::vector<float> sample(
      const Plane& plane, const std::function<bool()>& must_stop = [] { return false; }) const;

  const std::string& title() const { return title_; }
  /// Returns the number of voxels.
  const std::array<std::int64_t, 3>& size() const { return size_; }
  /// Returns the side of a voxel, or 0 if the file does not say.
  double voxel_size_A() const { return voxel_size_A_; }
  /// Returns the values that are black and white at first.
  const report::Contrast& contrast() const { return contrast_; }
  /// Returns what the viewer should know, such as that the volume is reduced; it may be empty.
  const std::string& note() const { return note_; }

 protected:
  ViewedVolume() = default;
  /// Returns the values of a plane, with any value outside of the volume.
  virtual std::vector<float> sample_voxels(const Plane& plane) const = 0;
  /// Returns how many points a pixel of a plane is the mean of.
  virtual std::int64_t points_per_pixel(const Plane& plane) const = 0;

  std::string title_, note_;
  std::array<std::int64_t, 3> size_{};
  double voxel_size_A_ = 0;
  report::Contrast contrast_;
};

/// Opens a model (.h5) of reconstruct, whose region of interest is shown. A plane is evaluated from
/// the field: pixels that are larger than those of the fit are means.
std::unique_ptr<ViewedVolume> open_model(const std::filesystem::path& path);

/// Opens an MRC volume and reads it into memory. If it would take more than half of the memory that
/// is free, it is reduced to that.
std::unique_ptr<ViewedVolume> open_mrc(const std::filesystem::path& path);

/// Returns what the page asks for first (JSON): the volumes, and the largest plane that it may ask
/// for.
std::string info_text(const std::vector<std::unique_ptr<ViewedVolume>>& volumes);

/// Opens a file by its contents: a model if it is HDF5, else an MRC volume.
std::unique_ptr<ViewedVolume> open_volume(const std::filesystem::path& path);

}  // namespace tomofield::view
