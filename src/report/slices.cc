#include "report/slices.h"

#include <algorithm>
#include <string>

#include "report/grey_scale.h"
#include "report/slice.h"

namespace tomofield::report {

std::vector<std::filesystem::path> write_slice_pictures(const std::filesystem::path& mrc,
                                                        const std::filesystem::path& prefix) {
  const auto slices = read_central_slices(mrc);
  const GreyScale scale = grey_scale_of(slices);
  const auto [narrowest, widest] = std::minmax({slices[0].width, slices[2].width});
  const std::int64_t zoom = picture_zoom(narrowest, widest);
  std::vector<std::filesystem::path> paths;
  for (const Slice& slice : slices) {
    paths.emplace_back(prefix.string() + "_" + slice.name + ".png");
    write_slice_picture(paths.back(), slice, scale, zoom);
  }
  return paths;
}

}  // namespace tomofield::report
