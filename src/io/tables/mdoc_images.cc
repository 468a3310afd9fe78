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

#include "io/lower_extension.h"
#include "io/tables/alignment_files.h"
#include "tomofield/error.h"

namespace tomofield::io {

namespace fs = std::filesystem;
namespace {

bool is_image(const fs::path& path) {
  constexpr std::array<std::string_view, 3> kExtensions{".mrc", ".tif", ".tiff"};
  return std::ranges::find(kExtensions, lower_extension(path)) != kExtensions.end();
}

// Returns the images in a folder, sorted by name.
std::vector<fs::path> images_in(const fs::path& folder) {
  std::vector<fs::path> images;
  std::error_code failure;
  const fs::path where = folder.empty() ? fs::path(".") : folder;  // of a file that is named alone
  for (const auto& entry : fs::directory_iterator(where, failure))
    if (is_image(entry.path())) images.push_back(folder / entry.path().filename());
  if (failure)
    throw Error(
        fmt::format("the folder '{}' cannot be read: {}", folder.string(), failure.message()));
  std::ranges::sort(images);
  return images;
}

// Returns a name as it is compared: without differences of upper and lower case, and with the
// underscores that RELION writes for points.
std::string comparable(std::string name) {
  std::ranges::transform(name, name.begin(), [](unsigned char c) {
    return c == '.' ? '_' : static_cast<char>(std::tolower(c));
  });
  return name;
}

// Finds the image of a movie: the one with its name, else the only one whose name is comparable,
// else the only one whose name goes on after it. "TS_1" does not go on as "TS_12".
fs::path find_image(const std::string& movie, const std::vector<fs::path>& images,
                    const std::string& section) {
  const std::string stem = fs::path(movie).stem().string();
  const std::string wanted = comparable(stem);
  std::vector<fs::path> same, longer;
  for (const fs::path& image : images) {
    if (image.stem().string() == stem) return image;
    const std::string name = comparable(image.stem().string());
    if (name == wanted) {
      same.push_back(image);
    } else if (name.starts_with(wanted) &&
               std::isalnum(static_cast<unsigned char>(name[wanted.size()])) == 0) {
      longer.push_back(image);
    }
  }
  const std::vector<fs::path>& found = same.empty() ? longer : same;
  if (found.size() == 1) return found.front();
  if (found.empty()) {
    throw Error(
        fmt::format("{} is of the movie '{}', and no image in its folder is named after it "
                    "('{}.mrc' or .tif): add it, or delete the section from a copy of the file",
                    section, movie, stem));
  }
  throw Error(
      fmt::format("{} is of the movie '{}', and several images are named after it, such as "
                  "'{}' and '{}': leave one of them in the folder",
                  section, movie, found[0].filename().string(), found[1].filename().string()));
}

}  // namespace

std::vector<ImageInFile> find_mdoc_images(const fs::path& mdoc, const fs::path& folder) {
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
  return views;
}

std::shared_ptr<const ImageStack> open_mdoc_images(const fs::path& mdoc, const fs::path& folder) {
  return image_stack_of_files(find_mdoc_images(mdoc, folder),
                              fmt::format("the images of {}", mdoc.string()));
}

}  // namespace tomofield::io
