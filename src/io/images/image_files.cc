#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <utility>

#include "base/check.h"
#include "io/images/image_stack.h"
#include "io/images/mrc_format.h"
#include "io/saving/file_identity.h"
#include "io/tables/alignment_files.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

// A stack whose sections lie in several files.
class FilesStack : public ImageStack {
 public:
  FilesStack(const std::vector<ImageInFile>& images, std::string name) : name_(std::move(name)) {
    require_distinct(images);
    std::map<std::filesystem::path, std::shared_ptr<const ImageStack>> opened;
    std::vector<double> tilts_deg;
    for (const ImageInFile& image : images) {
      std::shared_ptr<const ImageStack>& stack = opened[image.file];
      if (!stack) stack = open_image_stack(image.file);
      require_fits(image, stack->header());
      take_tilt(image, stack->header(), tilts_deg);
      sections_.push_back({stack, image.section.value_or(0)});
    }
    header_.nz = std::ssize(images);
    const bool differ = std::ranges::adjacent_find(tilts_deg, std::ranges::not_equal_to{}) !=
                        tilts_deg.end();  // headers without a tilt have 0
    if (differ && tilts_deg.size() == images.size())
      header_.extended_tilt_deg = std::move(tilts_deg);
  }

  const MrcHeader& header() const override { return header_; }
  std::string name() const override { return name_; }

  std::string image_name(std::int64_t section) const override {
    const Section& found = sections_.at(static_cast<std::size_t>(section));
    return found.stack->image_name(found.index);
  }

  void read_section(std::int64_t section, std::span<float> out) const override {
    const Section& found = sections_.at(static_cast<std::size_t>(section));
    found.stack->read_section(found.index, out);
  }

 private:
  struct Section {
    std::shared_ptr<const ImageStack> stack;
    std::int64_t index;
  };

  // Throws Error if two views are one image, also by two names of its file.
  void require_distinct(const std::vector<ImageInFile>& images) const {
    std::map<std::pair<FileIdentity, std::int64_t>, std::size_t> view_of;
    for (std::size_t view = 0; view < images.size(); ++view) {
      const ImageInFile& image = images[view];
      const std::int64_t section = image.section.value_or(0);
      const auto [first, is_new] =
          view_of.emplace(std::pair(identity_of(image.file), section), view);
      if (!is_new)
        throw Error(fmt::format("{}: views {} and {} are the same image, {} of '{}': leave one out",
                                name_, first->second + 1, view + 1, section + 1,
                                image.file.string()));
    }
  }

  // Takes sizes from the first file, and throws Error if an image has others or is not there.
  void require_fits(const ImageInFile& image, const MrcHeader& found) {
    if (sections_.empty()) {
      header_.nx = found.nx;
      header_.ny = found.ny;
      header_.voxel_size_A = found.voxel_size_A;
      header_.labels = found.labels;
      header_.extended_axis_deg = found.extended_axis_deg;
      header_.extended_voltage_kV = found.extended_voltage_kV;
    }
    const std::string file = image.file.string();
    if (!image.section && found.nz != 1) {
      throw Error(
          fmt::format("'{}' has {} images, and one view is expected ({}): give averages of "
                      "movies, each in a file",
                      file, found.nz, name_));
    }
    if (image.section.value_or(0) < 0 || image.section.value_or(0) >= found.nz) {
      throw Error(fmt::format("{} asks for image {} of '{}', which has {}", name_,
                              *image.section + 1, file, found.nz));
    }
    note_difference(found, file);
    constexpr double kSamePixel = 1e-3;
    const auto& [width_A, height_A, depth_A] = header_.voxel_size_A;
    if (found.nx != header_.nx || found.ny != header_.ny ||
        std::fabs(found.voxel_size_A[0] - width_A) > kSamePixel * width_A ||
        std::fabs(found.voxel_size_A[1] - height_A) > kSamePixel * height_A) {
      throw Error(
          fmt::format("'{}' has {} × {} pixels of {:g} × {:g} Å, and the first image of {} "
                      "{} × {} of {:g} × {:g} Å: the views of a series have one size",
                      file, found.nx, found.ny, found.voxel_size_A[0], found.voxel_size_A[1], name_,
                      header_.nx, header_.ny, width_A, height_A));
    }
  }

  // Notes if an image states another tilt axis, voltage or pixel size than the images before it, or
  // something that contradicts itself. Takes what those before it do not state.
  void note_difference(const MrcHeader& found, const std::string& file) {
    const auto axis = [](const MrcHeader& header) {
      const std::vector<double> titles = axes_of_labels(header.labels);
      return titles.empty() ? header.extended_axis_deg : std::optional(titles.front());
    };
    const auto note = [&](const char* what, const auto& here, const auto& before) {
      if (here && before && are_two_axes(*here, *before) && header_.differences.empty())
        header_.differences.push_back(
            fmt::format("{} of {:.6g} in '{}', and of {:.6g} in an image before, which is taken",
                        what, *here, file, *before));
    };
    note("a tilt axis in degrees", axis(found), axis(header_));
    note("a voltage in kV", found.extended_voltage_kV, header_.extended_voltage_kV);
    header_.is_ctf_corrected |= is_phase_flipped(found);
    header_.has_pieces |= found.has_pieces;
    for (const std::string& label : found.labels)
      if (std::ranges::find(header_.labels, label) == header_.labels.end())
        header_.labels.push_back(label);
    if (!axis(header_)) header_.extended_axis_deg = axis(found);
    if (!header_.extended_voltage_kV) header_.extended_voltage_kV = found.extended_voltage_kV;
    if (!header_.extended_pixel_A) header_.extended_pixel_A = found.extended_pixel_A;
    if (!contradiction_of_mode(header_) && contradiction_of_mode(found)) {
      header_.mode = found.mode;
      header_.min = found.min;
      header_.max = found.max;
      header_.bytes_are_unsigned = found.bytes_are_unsigned;
    }
    for (const std::string& difference : found.differences)
      if (header_.differences.empty())
        header_.differences.push_back(fmt::format("{} (in '{}')", difference, file));
  }

  // Takes the tilt that the header of an image's file states of it.
  static void take_tilt(const ImageInFile& image, const MrcHeader& found,
                        std::vector<double>& tilts_deg) {
    const auto section = static_cast<std::size_t>(image.section.value_or(0));
    if (section < found.extended_tilt_deg.size())
      tilts_deg.push_back(found.extended_tilt_deg[section]);
  }

  std::string name_;
  std::vector<Section> sections_;
  MrcHeader header_;
};

}  // namespace

std::shared_ptr<const ImageStack> image_stack_of_files(const std::vector<ImageInFile>& images,
                                                       std::string name) {
  if (images.empty()) throw Error(fmt::format("{} names no image", name));
  return std::make_shared<FilesStack>(images, std::move(name));
}

}  // namespace tomofield::io
