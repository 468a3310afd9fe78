#include "tilt_series/pixel_size.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/log.h"
#include "base/plausible.h"
#include "io/tables/text_lines.h"
#include "tilt_series/tilt_axis.h"
#include "tomofield/error.h"

namespace tomofield::tilt_series {
namespace {

// Returns the pixel size that an .mdoc states for the images of a stack. Its PixelSpacing is that
// of images of ImageSize, which may be binned records of these. Returns nothing if it states none,
// or if the one size is no whole multiple of the other.
std::optional<double> size_by_image_size(const io::Mdoc& mdoc, const io::ImageStack& stack) {
  const double spacing_A = mdoc.pixel_spacing_A.value_or(0.0);
  if (!base::is_plausible_pixel_size(spacing_A) || !mdoc.image_size_px) return std::nullopt;
  const auto [width, height] = *mdoc.image_size_px;
  const auto ratio = [](std::int64_t a, std::int64_t b) {
    return static_cast<double>(a) / static_cast<double>(b);
  };
  const double across = ratio(stack.header().nx, width), along = ratio(stack.header().ny, height);
  // Cameras leave out a few rows or columns where they bin.
  constexpr double kSame = 0.02;
  const double whole = across >= 1.0 ? std::round(across) : 1.0 / std::round(1.0 / across);
  const bool is_whole =
      std::fabs(across / whole - 1.0) < kSame && std::fabs(along / whole - 1.0) < kSame;
  return is_whole ? std::optional(spacing_A / whole) : std::nullopt;
}

// Returns the pixel size that an .mdoc states for the images of a stack, or 0.
double pixel_size_of_mdoc(const io::Mdoc& mdoc, const std::filesystem::path& path,
                          const io::ImageStack& stack) {
  const double spacing_A = mdoc.pixel_spacing_A.value_or(0.0);
  if (!base::is_plausible_pixel_size(spacing_A)) return 0.0;
  if (const auto size_A = size_by_image_size(mdoc, stack)) return *size_A;
  if (!mdoc.image_size_px) return spacing_A;
  const auto [width, height] = *mdoc.image_size_px;
  base::log_warning(
      fmt::format("'{}' states pixels of {} Å for images of {} × {}, and those of '{}' have {} × "
                  "{}: {} Å is taken (give the right size with --pixel-size)",
                  path.string(), spacing_A, width, height, stack.name(), stack.header().nx,
                  stack.header().ny, spacing_A));
  return spacing_A;
}

// Returns what is wrong with the pixel size of a header that has no usable one.
std::string fault_of_pixel_size(const TiltSeriesOptions& options, const io::ImageStack& stack) {
  const auto facts = facts_of(options, stack);
  if (!facts || (facts->voxel_size_A[0] == 0.0 && facts->voxel_size_A[1] == 0.0))
    return "has no pixel size";
  return fmt::format("states pixels of {:.6g} × {:.6g} Å, which cannot be", facts->voxel_size_A[0],
                     facts->voxel_size_A[1]);
}

// Tells whether the pixels of a stack are square, or none of their sides is known.
bool has_square_pixels(const io::ImageStack& stack) {
  const auto& [width_A, height_A, depth_A] = stack.header().voxel_size_A;
  return !(std::fabs(width_A - height_A) > 0.001 * std::fabs(std::max(width_A, height_A)));
}

void require_square_pixels(const io::ImageStack& stack) {
  if (has_square_pixels(stack)) return;
  const auto& [width_A, height_A, depth_A] = stack.header().voxel_size_A;
  throw Error(
      fmt::format("'{}' has pixels of {:.6g} × {:.6g} Å{}, and only square ones can be "
                  "reconstructed: give their size "
                  "with --pixel-size if the header is wrong",
                  stack.name(), width_A, height_A,
                  std::min(width_A, height_A) == 0.0 ? " (0: none, or one that cannot be)" : ""));
}

// Warns if a source states another pixel size than the header of a stack. Sizes of headers are
// often calibrated. Stacks are often binned by a whole number, of which a source may not know.
void warn_of_other_size(const std::string& source, double stated_A, bool knows_binning,
                        const io::ImageStack& stack) {
  constexpr double kCalibration = 0.1;
  const double in_header_A = stack.header().voxel_size_A[0];
  if (stated_A == 0.0) return;  // not known
  const double ratio = in_header_A / stated_A;
  const double expected = knows_binning ? 1.0 : std::max(1.0, std::round(ratio));
  if (std::fabs(ratio / expected - 1.0) < kCalibration) return;
  base::log_warning(
      fmt::format("{} states pixels of {:.6g} Å, and '{}' of {:.6g} Å: the latter is taken (give "
                  "the right size with --pixel-size)",
                  source, stated_A, stack.name(), in_header_A));
}

void warn_of_other_size(const io::Mdoc& mdoc, const std::filesystem::path& path,
                        const io::ImageStack& stack) {
  const auto size_A = size_by_image_size(mdoc, stack);
  warn_of_other_size(fmt::format("'{}'", path.string()),
                     size_A.value_or(mdoc.pixel_spacing_A.value_or(0.0)), size_A.has_value(),
                     stack);
}

// Warns of a cell that is as large as a pixel usually is: libraries for MRC files take its side.
void warn_of_small_cell(const io::ImageStack& stack) {
  constexpr double kSmallestPixel_A = 0.1, kLargestPixel_A = 100;
  const io::MrcHeader& header = stack.header();
  const double pixel_A = header.voxel_size_A[0];
  const double cell_A = pixel_A * static_cast<double>(header.nx);
  if (!io::is_known_size(pixel_A) || pixel_A >= kSmallestPixel_A || cell_A > kLargestPixel_A)
    return;
  base::log_warning(
      fmt::format("the header of '{}' has a cell of {:.6g} Å, so pixels of {:.6g} Å: is the former "
                  "the size of a pixel? (--pixel-size {:.6g})",
                  stack.name(), cell_A, pixel_A, cell_A));
}

// Warns of titles among the labels that state no axis that can be, or another one than the extended
// header does.
void warn_of_titles(const TiltSeriesOptions& options, const io::ImageStack& stack) {
  constexpr double kSameAxis_deg = 10.0;
  const io::MrcHeader& header = stack.header();
  if (options.tilt_axis_deg) return;
  for (const std::string& label : header.labels) {
    const auto word = io::axis_of_title(label);
    if (!word) continue;
    const auto axis_deg = io::parse_number(*word, base::kLargestAngle_deg);
    if (!axis_deg)
      base::log_warning(fmt::format(
          "a label of '{}' states a tilt axis of '{}', which is no angle: give the right one with "
          "--tilt-axis",
          stack.name(), io::quote(*word)));
    else if (header.extended_axis_deg &&
             angle_between_axes(*axis_deg, *header.extended_axis_deg) > kSameAxis_deg)
      base::log_warning(fmt::format(
          "a label of '{}' states a tilt axis of {:.6g}°, and its extended header one of {:.6g}°: "
          "give the right one with --tilt-axis",
          stack.name(), double{*axis_deg}, *header.extended_axis_deg));
  }
}

// Warns of a stack that IMOD's newstack aligned, as its labels say, and that is aligned again.
void warn_of_second_alignment(const TiltSeriesOptions& options, const io::ImageStack& stack) {
  const auto& alignment = options.xf ? options.xf : options.aln;
  if (!alignment || !io::is_in_labels(stack.header(), "transformed")) return;
  base::log_warning(fmt::format(
      "'{}' was transformed already, as its header says, and '{}' aligns it again: give the stack "
      "as it was recorded, or leave {} out",
      stack.name(), alignment->string(), options.xf ? "--xf" : "--aln"));
}

}  // namespace

std::optional<io::MrcFacts> facts_of(const TiltSeriesOptions& options,
                                     const io::ImageStack& stack) {
  if (stack.is_in_memory()) return std::nullopt;
  return io::find_mrc_facts(options.stack, stack.header());
}

double find_pixel_size(const TiltSeriesOptions& options, const io::ImageStack& stack,
                       const std::optional<io::Mdoc>& mdoc) {
  if (options.pixel_size_A) {
    if (base::is_plausible_pixel_size(*options.pixel_size_A)) return *options.pixel_size_A;
    throw Error(fmt::format("the pixel size {} Å (--pixel-size) is not from {} to {} Å",
                            *options.pixel_size_A, base::kPixelSizes_A.low(),
                            base::kPixelSizes_A.high()));
  }
  require_square_pixels(stack);
  const double in_header_A = stack.header().voxel_size_A[0];
  const bool is_known = io::is_known_size(in_header_A);
  if (!is_known && mdoc) {
    const double stated_A = pixel_size_of_mdoc(*mdoc, *options.mdoc, stack);
    if (stated_A > 0.0) return stated_A;
  }
  if (is_known) {
    if (mdoc) warn_of_other_size(*mdoc, *options.mdoc, stack);
    return in_header_A;
  }
  if (stack.is_in_memory()) {
    if (in_header_A > 0.0) return in_header_A;
    throw Error("views in memory have no pixel size: give it in Å with --pixel-size");
  }
  base::log_warning(fmt::format(
      "'{}' {}; 1 Å is assumed (give it with --pixel-size)", stack.name(),
      in_header_A == 0.0 ? fault_of_pixel_size(options, stack)
                         : "states pixels of 1 Å, as programs write that do not know their size"));
  return 1.0;
}

void warn_of_headers(const TiltSeriesOptions& options, const io::ImageStack& stack,
                     const std::optional<io::Mdoc>& mdoc) {
  const io::MrcHeader& header = stack.header();
  for (const std::string& difference : header.differences)
    base::log_warning(fmt::format("the header of '{}' states {}", stack.name(), difference));
  if (header.has_rows_from_top && (options.xf || options.local || options.fiducials))
    base::log_warning(fmt::format(
        "IMOD reads the rows of '{}' from the top, by the version that FEI's header states, and "
        "other programs and this one from the bottom: with files of IMOD, give the stack that its "
        "newstack writes of it",
        stack.name()));
  if (!options.pixel_size_A && !stack.is_in_memory()) warn_of_small_cell(stack);
  warn_of_titles(options, stack);
  warn_of_second_alignment(options, stack);
  if (mdoc)
    for (const std::string& difference : mdoc->differences)
      base::log_warning(fmt::format("'{}' states {}", options.mdoc->string(), difference));
  if (!options.pixel_size_A)
    return warn_of_other_size(fmt::format("the extended header of '{}'", stack.name()),
                              header.extended_pixel_A.value_or(0.0), /*knows_binning=*/false,
                              stack);
  if (has_square_pixels(stack)) return;
  base::log_warning(fmt::format(
      "'{}' has pixels of {:.6g} × {:.6g} Å, and square ones of {:.6g} Å are taken (--pixel-size)",
      stack.name(), header.voxel_size_A[0], header.voxel_size_A[1], *options.pixel_size_A));
}

}  // namespace tomofield::tilt_series
