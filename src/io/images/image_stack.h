#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/images/mrc.h"

namespace tomofield::io {

/// A stack of images of one size, wherever it lies: in an MRC or TIFF file, in one file a view, or
/// in memory. Reading is thread-safe.
class ImageStack {
 public:
  virtual ~ImageStack() = default;

  /// Returns sizes, pixel size and tilt angles, as the header of an MRC file states them.
  virtual const MrcHeader& header() const = 0;
  /// Returns what messages call the stack: its path, or a description.
  virtual std::string name() const = 0;
  /// Tells whether the images are in memory, which a user of the library gave, and not in a file.
  virtual bool is_in_memory() const { return false; }
  /// Returns what RELION calls the image of a section: "000002@stack.mrc", or "a.mrc" for the only
  /// image of a file.
  virtual std::string image_name(std::int64_t section) const;
  /// Copies section `section` into `out`, ny × nx floats.
  virtual void read_section(std::int64_t section, std::span<float> out) const = 0;
};

/// Opens an MRC or TIFF file, or the images that an .mdoc file (mdoc_images.h) or a table of RELION
/// or Warp (view_images.h) names. Throws Error as MrcReader and open_tiff_stack() do, and for other
/// files of a tilt series with how to give them.
std::shared_ptr<const ImageStack> open_image_stack(const std::filesystem::path& path);

/// An image among those of a file.
struct ImageInFile {
  std::filesystem::path file;
  std::optional<std::int64_t> section;  ///< zero-based; none: the file has one image
};

/// Makes a stack of images in files, in their order. `name` is what messages call it. Throws Error
/// if a file cannot be read, has no such image, or has images of another size.
std::shared_ptr<const ImageStack> image_stack_of_files(const std::vector<ImageInFile>& images,
                                                       std::string name);

/// Wraps images [section, y, x], x fastest, with an angle a section (degrees about +Y) and the
/// pixel size in Å, or 0 if it is not known. Throws Error if the sizes do not agree.
std::shared_ptr<const ImageStack> image_stack_in_memory(std::vector<float> values,
                                                        std::int64_t width, std::int64_t height,
                                                        std::vector<double> tilt_deg,
                                                        double pixel_size_A);

}  // namespace tomofield::io
