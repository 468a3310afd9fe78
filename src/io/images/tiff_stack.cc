#include "io/images/tiff_stack.h"

#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/check.h"
#include "io/saving/positioned_file.h"
#include "io/tables/alignment_files.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

constexpr std::uint32_t kLargestSide = std::uint32_t{1} << 24;
constexpr std::size_t kMostPages = 100'000;
// Compression makes no real image smaller than this part of its size; deflate's limit is 1/1032,
// and LZMA reaches 1/7000 for a blank one.
constexpr double kLargestCompression = 65536;

int keep_first_message(TIFF*, void* user_data, const char*, const char* format, va_list arguments) {
  auto& message = *static_cast<std::string*>(user_data);
  std::array<char, 200> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  if (message.empty()) message = text.data();
  return 1;
}

int drop_message(TIFF*, void*, const char*, const char*, va_list) { return 1; }

// Describes the size of a page, the size of its pixels in Å (0: unknown), and its values.
struct PageFormat {
  std::uint32_t width = 0, height = 0;
  std::uint16_t bits = 1, samples = 1, kind = SAMPLEFORMAT_UINT;
  std::uint16_t photometric = PHOTOMETRIC_MINISBLACK, orientation = ORIENTATION_TOPLEFT;
  double pixel_width_A = 0, pixel_height_A = 0;
  bool is_tiled = false;

  bool operator==(const PageFormat&) const = default;
  double bytes() const { return static_cast<double>(width) * height * bits / 8; }
};

// An open TIFF file. libtiff keeps the page that it is at, so each thread opens its own.
class TiffFile {
 public:
  explicit TiffFile(const std::filesystem::path& path) : path_(path) {
    file_bytes_ = PositionedFile(path, PositionedFile::Access::kRead).size();
    TIFFOpenOptions* options = TIFFOpenOptionsAlloc();
    TIFFOpenOptionsSetErrorHandlerExtR(options, keep_first_message, &message_);
    TIFFOpenOptionsSetWarningHandlerExtR(options, drop_message, nullptr);
    TIFFOpenOptionsSetMaxSingleMemAlloc(options, static_cast<tmsize_t>(most_bytes()));
    // Without a memory map (m), a file that becomes shorter is an error and no signal.
    handle_ = TIFFOpenExt(path.c_str(), "rm", options);
    TIFFOpenOptionsFree(options);
    if (handle_ == nullptr) fail("cannot be opened as a TIFF file");
  }
  ~TiffFile() {
    if (handle_ != nullptr) TIFFClose(handle_);
  }
  TiffFile(const TiffFile&) = delete;
  TiffFile& operator=(const TiffFile&) = delete;

  TIFF* handle() const { return handle_; }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error(fmt::format("'{}' {}{}", path_.string(), what,
                            message_.empty() ? "" : fmt::format(" ({})", message_)));
  }

  // Returns the most bytes that a page of this file can have.
  double most_bytes() const { return kLargestCompression * static_cast<double>(file_bytes_); }

  // Returns the lines of the description of the page that the file is at. SerialEM writes there
  // what the labels of an MRC file have.
  std::vector<std::string> description() const {
    constexpr std::size_t kMostLines = 20, kLongestLine = 200;
    const char* text = nullptr;
    if (TIFFGetField(handle_, TIFFTAG_IMAGEDESCRIPTION, &text) == 0 || text == nullptr) return {};
    std::vector<std::string> lines;
    std::string_view rest(text);
    while (!rest.empty() && lines.size() < kMostLines) {
      const std::size_t end = std::min(rest.find('\n'), rest.size());
      lines.emplace_back(rest.substr(0, std::min(end, kLongestLine)));
      rest.remove_prefix(std::min(end + 1, rest.size()));
    }
    return lines;
  }

  // Returns the format of the page that the file is at. Throws Error for one that is not read.
  PageFormat format(std::size_t page) const {
    PageFormat format;
    TIFFGetField(handle_, TIFFTAG_IMAGEWIDTH, &format.width);
    TIFFGetField(handle_, TIFFTAG_IMAGELENGTH, &format.height);
    TIFFGetFieldDefaulted(handle_, TIFFTAG_BITSPERSAMPLE, &format.bits);
    TIFFGetFieldDefaulted(handle_, TIFFTAG_SAMPLESPERPIXEL, &format.samples);
    TIFFGetFieldDefaulted(handle_, TIFFTAG_SAMPLEFORMAT, &format.kind);
    TIFFGetField(handle_, TIFFTAG_PHOTOMETRIC, &format.photometric);
    TIFFGetFieldDefaulted(handle_, TIFFTAG_ORIENTATION, &format.orientation);
    format.is_tiled = TIFFIsTiled(handle_) != 0;
    require_linear(page);
    read_pixel_size(format);
    require_readable(format, page);
    return format;
  }

 private:
  // Reads the size of a pixel from the resolution tags. A size that no image of a microscope has
  // is that of a printer, which has 72 to 2400 dots an inch.
  void read_pixel_size(PageFormat& format) const {
    float across = 0, down = 0;
    std::uint16_t unit = RESUNIT_NONE;
    TIFFGetField(handle_, TIFFTAG_XRESOLUTION, &across);
    TIFFGetField(handle_, TIFFTAG_YRESOLUTION, &down);
    // Without a unit, or with one that TIFF 6 does not have, such as tifffile's millimetres,
    // libtiff would take inches.
    TIFFGetField(handle_, TIFFTAG_RESOLUTIONUNIT, &unit);
    const double unit_A = unit == RESUNIT_CENTIMETER ? 1e8 : unit == RESUNIT_INCH ? 2.54e8 : 0.0;
    constexpr double kSmallest_A = 0.05, kLargest_A = 1000;
    const auto size_A = [&](float per_unit) {
      return per_unit > 0 ? unit_A / static_cast<double>(per_unit) : 0.0;
    };
    const auto is_plausible = [&](double size) {
      return size >= kSmallest_A && size <= kLargest_A;
    };
    const double width_A = size_A(across > 0 ? across : down);
    const double height_A = size_A(down > 0 ? down : across);
    if (!is_plausible(width_A) && !is_plausible(height_A)) return;
    format.pixel_width_A = width_A;
    format.pixel_height_A = height_A;
  }

  void require_readable(const PageFormat& format, std::size_t page) const {
    if (format.width < 1 || format.height < 1 || format.width > kLargestSide ||
        format.height > kLargestSide || format.bytes() > most_bytes()) {
      fail(
          fmt::format("says that page {} has {} × {} pixels, which its {} bytes cannot hold: it "
                      "is damaged",
                      page + 1, format.width, format.height, file_bytes_));
    }
    const bool is_integer = format.kind == SAMPLEFORMAT_UINT || format.kind == SAMPLEFORMAT_INT;
    const bool is_float = format.kind == SAMPLEFORMAT_IEEEFP && format.bits == 32;
    const bool has_bits = format.bits == 8 || format.bits == 16 || format.bits == 32;
    if (format.orientation != ORIENTATION_TOPLEFT && format.orientation != ORIENTATION_BOTLEFT) {
      fail(fmt::format(
          "says that page {} is mirrored or turned (Orientation {}), which is not read: "
          "convert it to Orientation 1",
          page + 1, format.orientation));
    }
    if (format.samples == 1 && ((is_integer && has_bits) || is_float))
      return require_grey(format, page);
    fail(fmt::format(
        "has {} {} of {} bits a pixel on page {}{}; grey values that are whole numbers of 8, 16 or "
        "32 bits or floats of 32 bits can be read",
        format.samples, format.samples == 1 ? "value" : "values", format.bits, page + 1,
        is_integer ? "" : ", which are no whole numbers"));
  }

  // Throws Error for a curve that says which grey a value stands for (TIFF 6.0, page 84). libtiff
  // passes the older GrayResponseCurve over.
  void require_linear(std::size_t page) const {
    std::array<std::uint16_t*, 3> curves{};
    if (TIFFGetField(handle_, TIFFTAG_TRANSFERFUNCTION, &curves[0], &curves[1], &curves[2]) != 0)
      fail(
          fmt::format("has a curve of grey values (TransferFunction) on page {}, which is not "
                      "applied: convert it without one",
                      page + 1));
  }

  // Values may stand for colours of a palette, or count down from white (TIFF 6.0, page 37).
  void require_grey(const PageFormat& format, std::size_t page) const {
    const bool is_unsigned = format.kind == SAMPLEFORMAT_UINT;
    if (format.photometric == PHOTOMETRIC_MINISBLACK ||
        (format.photometric == PHOTOMETRIC_MINISWHITE && is_unsigned))
      return;
    fail(fmt::format("has {} on page {}; grey values from black can be read: convert it",
                     format.photometric == PHOTOMETRIC_PALETTE ? "numbers of a palette"
                     : format.photometric == PHOTOMETRIC_MINISWHITE
                         ? "signed values or floats that count from white"
                         : "colours",
                     page + 1));
  }

  std::filesystem::path path_;
  std::int64_t file_bytes_ = 0;
  std::string message_;  // the first that libtiff gave
  TIFF* handle_ = nullptr;
};

template <typename T>
void convert(const std::byte* raw, std::size_t count, float* out) {
  for (std::size_t i = 0; i < count; ++i) {
    T value;
    std::memcpy(&value, raw + i * sizeof(T), sizeof(T));
    out[i] = static_cast<float>(value);
  }
}

// Converts numbers of a page to floats.
void convert_numbers(const PageFormat& format, const std::byte* raw, std::size_t count,
                     float* out) {
  const bool is_signed = format.kind == SAMPLEFORMAT_INT;
  if (format.kind == SAMPLEFORMAT_IEEEFP) return convert<float>(raw, count, out);
  switch (format.bits) {
    case 8:
      return is_signed ? convert<std::int8_t>(raw, count, out)
                       : convert<std::uint8_t>(raw, count, out);
    case 16:
      return is_signed ? convert<std::int16_t>(raw, count, out)
                       : convert<std::uint16_t>(raw, count, out);
    default:
      return is_signed ? convert<std::int32_t>(raw, count, out)
                       : convert<std::uint32_t>(raw, count, out);
  }
}

// Converts values of a page to floats that count up from black.
void decode(const PageFormat& format, const std::byte* raw, std::size_t count, float* out) {
  convert_numbers(format, raw, count, out);
  if (format.photometric != PHOTOMETRIC_MINISWHITE) return;
  const auto white = static_cast<float>(std::exp2(format.bits) - 1);
  std::transform(out, out + count, out, [&](float value) { return white - value; });
}

// Reads the page that a file is at, its top row last.
class PageReader {
 public:
  PageReader(const TiffFile& file, const PageFormat& format, std::span<float> out)
      : file_(file), format_(format), out_(out) {}

  void read() {
    if (format_.is_tiled)
      read_tiles();
    else
      read_strips();
  }

 private:
  std::size_t bytes_per_value() const { return format_.bits / 8; }

  // Returns a row by its number in the file, which begins with the top one or with the bottom one.
  float* row(std::uint32_t number) const {
    const bool is_bottom_first = format_.orientation == ORIENTATION_BOTLEFT;
    const std::uint32_t from_bottom = is_bottom_first ? number : format_.height - 1 - number;
    return out_.data() + static_cast<std::size_t>(from_bottom) * format_.width;
  }

  std::vector<std::byte> buffer(tmsize_t bytes) const {
    if (bytes < 1 || static_cast<double>(bytes) > file_.most_bytes()) file_.fail("is damaged");
    return std::vector<std::byte>(static_cast<std::size_t>(bytes));
  }

  void read_strips() const {
    std::uint32_t rows_of_strip = format_.height;
    TIFFGetFieldDefaulted(file_.handle(), TIFFTAG_ROWSPERSTRIP, &rows_of_strip);
    rows_of_strip = std::clamp(rows_of_strip, std::uint32_t{1}, format_.height);
    const std::size_t row_bytes = format_.width * bytes_per_value();
    std::vector<std::byte> raw = buffer(static_cast<tmsize_t>(rows_of_strip * row_bytes));
    for (std::uint32_t first = 0; first < format_.height; first += rows_of_strip) {
      const std::uint32_t rows = std::min(rows_of_strip, format_.height - first);
      const auto wanted = static_cast<tmsize_t>(rows * row_bytes);
      const std::uint32_t strip = TIFFComputeStrip(file_.handle(), first, 0);
      if (TIFFReadEncodedStrip(file_.handle(), strip, raw.data(), wanted) != wanted)
        file_.fail("is truncated or damaged");
      for (std::uint32_t i = 0; i < rows; ++i)
        decode(format_, raw.data() + i * row_bytes, format_.width, row(first + i));
    }
  }

  void read_tiles() const {
    std::uint32_t width = 0, height = 0;
    TIFFGetField(file_.handle(), TIFFTAG_TILEWIDTH, &width);
    TIFFGetField(file_.handle(), TIFFTAG_TILELENGTH, &height);
    if (width < 1 || height < 1 || width > kLargestSide || height > kLargestSide)
      file_.fail("is damaged");
    const std::size_t row_bytes = width * bytes_per_value();
    const auto tile_bytes = static_cast<tmsize_t>(height * row_bytes);
    std::vector<std::byte> raw = buffer(tile_bytes);
    for (std::uint32_t y = 0; y < format_.height; y += height) {
      for (std::uint32_t x = 0; x < format_.width; x += width) {
        const std::uint32_t tile = TIFFComputeTile(file_.handle(), x, y, 0, 0);
        if (TIFFReadEncodedTile(file_.handle(), tile, raw.data(), tile_bytes) != tile_bytes)
          file_.fail("is truncated or damaged");
        for (std::uint32_t i = 0; i < std::min(height, format_.height - y); ++i)
          decode(format_, raw.data() + i * row_bytes, std::min(width, format_.width - x),
                 row(y + i) + x);
      }
    }
  }

  const TiffFile& file_;
  const PageFormat& format_;
  std::span<float> out_;
};

// ImageJ's calibration: a number n of the file stands for offset + scale n.
struct Calibration {
  double offset = 0.0, scale = 1.0;
};

// Returns the calibration that a description of ImageJ states: "cf=0", a straight line, with "c0="
// and "c1=". Throws Error for another curve. ImageJ writes numbers with a sign in this way.
Calibration calibration_of(const std::filesystem::path& path,
                           const std::vector<std::string>& description) {
  Calibration found;
  if (description.empty() || !description.front().starts_with("ImageJ=")) return found;
  for (const std::string& line : description) {
    const std::size_t equals = line.find('=');
    if (equals == std::string::npos) continue;
    const std::string_view key = trim(std::string_view(line).substr(0, equals));
    const auto number = parse_number(trim(std::string_view(line).substr(equals + 1)));
    if (key != "cf" && key != "c0" && key != "c1") continue;
    if (!number || (key == "cf" && *number != 0.0))
      throw Error(fmt::format(
          "'{}' has a calibration of ImageJ that is no straight line ({}), which is not applied: "
          "save it as 32-bit numbers",
          path.string(), quote(line)));
    if (key == "c0") found.offset = *number;
    if (key == "c1") found.scale = *number;
  }
  return found;
}

class TiffStack : public ImageStack {
 public:
  explicit TiffStack(std::filesystem::path path) : path_(std::move(path)) {
    const TiffFile file(path_);
    format_ = file.format(0);
    header_.voxel_size_A = {format_.pixel_width_A, format_.pixel_height_A, format_.pixel_width_A};
    header_.labels = file.description();
    calibration_ = calibration_of(path_, header_.labels);
    for (;;) {
      const PageFormat of_page = file.format(pages_.size());
      if (of_page != format_) refuse(file, of_page);
      note_other_axis(file.description());
      pages_.push_back(TIFFCurrentDirOffset(file.handle()));
      if (pages_.size() > kMostPages) file.fail("has more pages than any tilt series");
      if (TIFFLastDirectory(file.handle()) != 0) break;
      if (TIFFReadDirectory(file.handle()) == 0)
        file.fail(fmt::format("is truncated or damaged after page {}", pages_.size()));
    }
    header_.nx = format_.width;
    header_.ny = format_.height;
    header_.nz = std::ssize(pages_);
  }

  const MrcHeader& header() const override { return header_; }
  std::string name() const override { return path_.string(); }

  void read_section(std::int64_t section, std::span<float> out) const override {
    TOMOFIELD_CHECK(
        section >= 0 && section < header_.nz && std::ssize(out) == header_.nx * header_.ny,
        "a section of the stack is read into as many values");
    const TiffFile file(path_);
    if (TIFFSetSubDirectory(file.handle(), pages_[static_cast<std::size_t>(section)]) == 0 ||
        file.format(static_cast<std::size_t>(section)) != format_)
      file.fail("has changed while it was read");
    PageReader(file, format_, out).read();
    const auto offset = static_cast<float>(calibration_.offset),
               scale = static_cast<float>(calibration_.scale);
    if (offset != 0.0f || scale != 1.0f)
      std::ranges::transform(out, out.begin(), [&](float value) { return offset + scale * value; });
  }

 private:
  // Notes the first page whose title states another tilt axis than that of the first page.
  void note_other_axis(const std::vector<std::string>& description) {
    const std::vector<double> first = axes_of_labels(header_.labels),
                              here = axes_of_labels(description);
    if (first.empty() || here.empty() || !header_.differences.empty()) return;
    if (are_two_axes(here.front(), first.front()))
      header_.differences.push_back(fmt::format(
          "a tilt axis of {:.6g}° on page {}, and of {:.6g}° on the first, which is taken",
          here.front(), pages_.size() + 1, first.front()));
  }

  // Refuses a page that is of another kind than the first.
  [[noreturn]] void refuse(const TiffFile& file, const PageFormat& page) const {
    const auto kind = [](const PageFormat& of) {
      return fmt::format(
          "{} × {} pixels of {} bits and {:.4g} × {:.4g} Å (photometric {}, orientation {}, sample "
          "format {}, in {})",
          of.width, of.height, of.bits, of.pixel_width_A, of.pixel_height_A, of.photometric,
          of.orientation, of.kind, of.is_tiled ? "tiles" : "strips");
    };
    file.fail(fmt::format("has pages of several kinds: page {} has {}, and the first {}",
                          pages_.size() + 1, kind(page), kind(format_)));
  }

  std::filesystem::path path_;
  PageFormat format_;
  Calibration calibration_;
  std::vector<std::uint64_t> pages_;  // places of their directories in the file
  MrcHeader header_;
};

}  // namespace

bool is_tiff(const std::filesystem::path& path) {
  const PositionedFile file(path, PositionedFile::Access::kRead);
  std::array<char, 4> start{};
  if (file.size() < std::ssize(start)) return false;
  file.read_at(0, start.data(), start.size());
  const std::string_view text(start.data(), start.size());
  using namespace std::string_view_literals;
  for (const std::string_view magic : {"II*\0"sv, "MM\0*"sv, "II+\0"sv, "MM\0+"sv})
    if (text == magic) return true;
  return false;
}

std::shared_ptr<const ImageStack> open_tiff_stack(const std::filesystem::path& path) {
  return std::make_shared<TiffStack>(path);
}

}  // namespace tomofield::io
