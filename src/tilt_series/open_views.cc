#include "tilt_series/open_views.h"

#include <filesystem>

#include "io/tables/mdoc_images.h"

namespace tomofield::tilt_series {

std::shared_ptr<const io::ImageStack> open_views(const TiltSeriesOptions& options) {
  if (options.images) return options.images;
  std::error_code absent;
  if (options.mdoc && std::filesystem::is_directory(options.stack, absent))
    return io::open_mdoc_images(*options.mdoc, options.stack);
  return io::open_image_stack(options.stack);
}

}  // namespace tomofield::tilt_series
