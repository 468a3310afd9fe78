#include "io/tables/mdoc_images.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "io/tables/alignment_files.h"
#include "tomofield/error.h"

namespace tomofield::io {

namespace fs = std::filesystem;
namespace {

bool is_image(const fs::path& path) {
  constexpr std::array<std::string_view, 3> kExtensions{".mrc", ".tif", ".tiff"};
  return std::ranges::find(kExtensions, path.extension().string()) != kExtensions.end();
}

// Returns the images in a folder, sorted by name.
std::vector<fs::path> images_in(const fs::path& folder) {
  std::vector<fs::path> images;
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(folder, failure))
    if (is_image(entry.path())) images.push_back(entry.path());
  if (failure)
    throw Error(
        fmt::format("the folder '{}' cannot be read: {}", folder.string(), failure.message()));
  std::ranges::sort(images);
  return images;
}

// Finds the image of a movie: the one with its name, else the only one whose name goes on after
// it. "TS_1" does not go on as "TS_12".
fs::path find_image(const std::string& movie, const std::vector<fs::path>& images,
                    const std::string& section) {
  const std::string stem = fs::path(movie).stem().string();
  std::vector<fs::path> longer;
  for (const fs::path& image : images) {
    const std::string name = image.stem().string();
    if (name == stem) return image;
    const bool goes_on =
        name.starts_with(stem) && std::isalnum(static_cast<unsigned char>(name[stem.size()])) == 0;
    if (goes_on) longer.push_back(image);
  }
  if (longer.size() == 1) return longer.front();
  if (longer.empty()) {
    throw Error(
        fmt::format("{} is of the movie '{}', and no image in its folder is named after it "
                    "('{}.mrc' or .tif)",
                    section, movie, stem));
  }
  throw Error(
      fmt::format("{} is of the movie '{}', and several images are named after it, such as "
                  "'{}' and '{}': leave one of them in the folder",
                  section, movie, longer[0].filename().string(), longer[1].filename().string()));
}

}  // namespace

std::shared_ptr<const ImageStack> open_mdoc_images(const fs::path& mdoc, const fs::path& folder) {
  const std::vector<fs::path> images = images_in(folder);
  std::vector<ImageInFile> views;
  for (const MdocSection& section : read_mdoc(mdoc).sections) {
    const std::string where =
        fmt::format("'{}', line {}: [ZValue = {}]", mdoc.string(), section.line, section.section);
    if (section.frame_name.empty()) {
      throw Error(
          fmt::format("{} has no SubFramePath, so its image cannot be found: give the stack "
                      "itself, with --mdoc {}",
                      where, mdoc.string()));
    }
    views.push_back({find_image(section.frame_name, images, where), std::nullopt});
  }
  return image_stack_of_files(views, fmt::format("the images of {}", mdoc.string()));
}

}  // namespace tomofield::io
