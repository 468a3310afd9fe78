#include "io/images/image_stack.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "base/plausible.h"
#include "io/images/tiff_stack.h"
#include "io/images/view_images.h"
#include "io/tables/mdoc_images.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

class FileStack : public ImageStack {
 public:
  explicit FileStack(const std::filesystem::path& path) : file_(path) {}
  const MrcHeader& header() const override { return file_.header(); }
  std::string name() const override { return file_.path().string(); }
  void read_section(std::int64_t section, std::span<float> out) const override {
    file_.read_section(section, out);
  }

 private:
  MrcReader file_;
};

class MemoryStack : public ImageStack {
 public:
  MemoryStack(std::vector<float> values, MrcHeader header)
      : values_(std::move(values)), header_(std::move(header)) {}
  const MrcHeader& header() const override { return header_; }
  std::string name() const override { return "views in memory"; }
  bool is_in_memory() const override { return true; }
  void read_section(std::int64_t section, std::span<float> out) const override {
    const auto size = static_cast<std::size_t>(header_.nx * header_.ny);
    std::ranges::copy(std::span(values_).subspan(static_cast<std::size_t>(section) * size, size),
                      out.begin());
  }

 private:
  std::vector<float> values_;
  MrcHeader header_;
};

// A kind of file that belongs to a tilt series and is no stack.
struct OtherFile {
  std::string_view extension, what, how_to_give;
};
constexpr OtherFile kOtherFiles[] = {
    {".tlt", "a list of tilt angles", "give the stack, and this file with --tlt"},
    {".rawtlt", "a list of tilt angles", "give the stack, and this file with --tlt"},
    {".xtilt", "a list of x-axis tilts", "give the stack, and this file with --xtilt"},
    {".xf", "a list of IMOD's transforms", "give the raw stack, and this file with --xf"},
    {".aln", "AreTomo's alignment", "give the raw stack, and this file with --aln"},
    {".com", "a command file of IMOD",
     "`tomofield reconstruct` reads eTomo's tilt.com and what it names"},
    {".toml", "a configuration file", "give the stack, and this file with --config"},
};

// Throws Error for a file whose name says that it is no stack.
void refuse_other_file(const std::filesystem::path& path, std::string_view extension) {
  for (const OtherFile& other : kOtherFiles) {
    if (extension != other.extension) continue;
    throw Error(fmt::format("'{}' is {}, not a stack of images: {}", path.string(), other.what,
                            other.how_to_give));
  }
}

}  // namespace

std::string ImageStack::image_name(std::int64_t section) const {
  return header().nz == 1 ? name() : fmt::format("{:06d}@{}", section + 1, name());
}

std::shared_ptr<const ImageStack> open_image_stack(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  if (extension == ".mdoc") return open_mdoc_images(path, path.parent_path());
  if (is_view_table(path)) return open_view_images(path);
  refuse_other_file(path, extension);
  if (is_tiff(path)) return open_tiff_stack(path);
  return std::make_shared<FileStack>(path);
}

std::shared_ptr<const ImageStack> image_stack_in_memory(std::vector<float> values,
                                                        std::int64_t width, std::int64_t height,
                                                        std::vector<double> tilt_deg,
                                                        double pixel_size_A) {
  const auto count = static_cast<std::int64_t>(tilt_deg.size());
  if (count == 0 || width == 0 || height == 0 ||
      !(base::CheckedSize(width) * height * count).is(values.size())) {
    throw Error(fmt::format(
        "{} values are not {} images of {} × {} pixels: give one value a pixel and one tilt angle "
        "an image",
        values.size(), count, width, height));
  }
  MrcHeader header;
  header.nx = width;
  header.ny = height;
  header.nz = count;
  header.voxel_size_A.fill(pixel_size_A);
  header.extended_tilt_deg = std::move(tilt_deg);
  return std::make_shared<MemoryStack>(std::move(values), std::move(header));
}

}  // namespace tomofield::io
