#include "tilt_series/series_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "base/check.h"
#include "base/log.h"
#include "base/plausible.h"
#include "geometry/imod_transform.h"
#include "io/tables/alignment_files.h"
#include "io/tables/view_table.h"
#include "option_table/name_list.h"
#include "tilt_series/resampling/binning.h"
#include "tilt_series/section_table.h"
#include "tilt_series/tilt_angles.h"
#include "tomofield/error.h"

namespace tomofield::tilt_series {
namespace {

/// The in-plane transform of each section, and the rotation of the tilt axis that it undoes.
struct InPlaneAlignment {
  std::vector<std::optional<RawFromAligned>> of_section;  ///< none: not aligned (dark frame)
  double sum_cos = 0.0, sum_sin = 0.0;                    ///< over the sections, of the rotation

  /// Tells whether the aligned images are as wide as the raw ones are high.
  bool swaps_sizes() const { return std::fabs(sum_sin) > std::fabs(sum_cos); }
};

InPlaneAlignment alignment_of_imod(const std::filesystem::path& path, const io::ImageStack& stack) {
  const auto transforms = io::read_imod_transforms(path);
  require_count(transforms.size(), path, "transforms", stack);
  InPlaneAlignment alignment;
  for (const io::ImodTransform& t : transforms) {
    alignment.of_section.emplace_back(geometry::invert(t));
    // A pure rotation is R(−ROT): cos on the diagonal, +sin ROT above it.
    const double cosine = t.a11 + t.a22, sine = t.a12 - t.a21;
    const double length = std::hypot(cosine, sine);
    if (length == 0.0) continue;
    alignment.sum_cos += cosine / length;
    alignment.sum_sin += sine / length;
  }
  return alignment;
}

InPlaneAlignment alignment_of_table(const SectionTable& table) {
  InPlaneAlignment alignment;
  for (const auto& section : table.of_section) {
    alignment.of_section.emplace_back();
    if (!section) continue;
    alignment.of_section.back() = section->raw_from_aligned;
    const double rotation_rad = section->rotation_deg * std::numbers::pi / 180.0;
    alignment.sum_cos += std::cos(rotation_rad);
    alignment.sum_sin += std::sin(rotation_rad);
  }
  return alignment;
}

/// Returns what --aln says of the sections, or else the table of views that is given as the stack.
std::optional<SectionTable> find_section_table(const TiltSeriesOptions& options,
                                               const io::ImageStack& stack, double pixel_size_A) {
  if (options.aln) return sections_of_aretomo(*options.aln, stack);
  if (options.images || !io::is_view_table(options.stack)) return std::nullopt;
  return sections_of_views(io::read_view_table(options.stack), stack, pixel_size_A);
}

/// Returns the size of an unbinned pixel in Å: --pixel-size, else the header's, else the mdoc's.
double find_pixel_size(const TiltSeriesOptions& options, const io::ImageStack& stack,
                       const std::optional<io::Mdoc>& mdoc) {
  if (options.pixel_size_A) {
    if (base::is_plausible_pixel_size(*options.pixel_size_A)) return *options.pixel_size_A;
    throw Error(fmt::format("the pixel size {} Å (--pixel-size) is not from {} to {} Å",
                            *options.pixel_size_A, base::kSmallestPixel_A, base::kLargestPixel_A));
  }
  const auto& [in_header_A, height_A, depth_A] = stack.header().voxel_size_A;
  if (height_A > 0.0 && std::fabs(in_header_A - height_A) > 0.001 * std::fabs(in_header_A))
    throw Error(fmt::format(
        "'{}' has pixels of {} × {} Å, and only square ones can be reconstructed: give their size "
        "with --pixel-size if the header is wrong",
        stack.name(), in_header_A, height_A));
  const bool is_default = in_header_A == 0.0 || in_header_A == 1.0;
  if (is_default && mdoc && base::is_plausible_pixel_size(mdoc->pixel_spacing_A.value_or(0.0)))
    return *mdoc->pixel_spacing_A;
  if (in_header_A > 0.0) return in_header_A;
  base::log_warning(fmt::format(
      "'{}' has no pixel size; 1 Å is assumed (give it with --pixel-size)", stack.name()));
  return 1.0;
}

double find_bin_factor(const TiltSeriesOptions& options, const SeriesPlan& plan) {
  if (options.angpix && options.bin != 1.0) {
    throw Error("--bin and --angpix both set the size of the binned pixels; give one of them");
  }
  const double factor = options.angpix ? *options.angpix / plan.pixel_size_A : options.bin;
  if (!std::isfinite(factor) || factor < 1.0 - 1e-6) {
    throw Error(options.angpix
                    ? fmt::format("--angpix {} is below the stack's pixel size of {} Å: views can "
                                  "be reduced, not enlarged",
                                  *options.angpix, plan.pixel_size_A)
                    : fmt::format("--bin {} must be 1 or more", options.bin));
  }
  if (reduced_size(std::min(plan.aligned_width, plan.aligned_height), std::max(factor, 1.0)) < 1) {
    throw Error(fmt::format("binning by {} leaves nothing of views of {} × {} pixels", factor,
                            plan.aligned_width, plan.aligned_height));
  }
  return std::max(factor, 1.0);
}

/// Returns the x-axis tilt of each section: from --xtilt, else from the table, else 0.
std::vector<double> find_x_tilts(const TiltSeriesOptions& options, const io::ImageStack& stack,
                                 const std::optional<SectionTable>& table) {
  std::vector<double> x_tilts_deg(static_cast<std::size_t>(stack.header().nz), 0.0);
  if (options.xtilt) {
    const auto numbers = io::read_number_column(*options.xtilt, "an x-axis tilt in degrees");
    require_count(numbers.size(), *options.xtilt, "x-axis tilts", stack);
    for (std::size_t i = 0; i < numbers.size(); ++i) x_tilts_deg[i] = numbers[i].value;
  } else if (table) {
    for (std::size_t i = 0; i < x_tilts_deg.size(); ++i)
      if (table->of_section[i]) x_tilts_deg[i] = table->of_section[i]->x_tilt_deg;
  }
  constexpr double kLargest_deg = 80.0;
  for (std::size_t i = 0; i < x_tilts_deg.size(); ++i) {
    if (std::fabs(x_tilts_deg[i]) <= kLargest_deg) continue;
    throw Error(
        fmt::format("section {} of '{}' has an x-axis tilt of {}°, and they must be within "
                    "±{}°: mend it in '{}'",
                    i + 1, stack.name(), x_tilts_deg[i], kLargest_deg,
                    options.xtilt ? options.xtilt->string() : stack.name()));
  }
  return x_tilts_deg;
}

/// Throws Error for a raw stack without an alignment, as the tilt axis of the .mdoc shows it.
void require_vertical_axis(const TiltSeriesOptions& options, const io::Mdoc& mdoc,
                           const io::ImageStack& stack) {
  constexpr double kVertical_deg = 1.0;
  if (!mdoc.tilt_axis_deg) return;
  const double axis_deg = mdoc.tilt_axis_deg->value;
  if (std::fabs(std::remainder(axis_deg, 180.0)) <= kVertical_deg) return;
  if (option_table::has_name(option_table::split_names(options.ignore), "TiltAxisAngle")) return;
  throw Error(fmt::format(
      "'{}', line {}: the tilt axis is turned by {}° from the vertical, so '{}' must be aligned: "
      "give --xf or --aln, or --ignore TiltAxisAngle if its views are aligned already",
      options.mdoc->string(), mdoc.tilt_axis_deg->line, axis_deg, stack.name()));
}

void require_compatible(const TiltSeriesOptions& options) {
  if (options.xf && options.aln) {
    throw Error(fmt::format("'{}' (--xf) and '{}' (--aln) both align the views; give one of them",
                            options.xf->string(), options.aln->string()));
  }
  if (options.black_level.value_or(0) != 0 && options.contrast == Contrast::kDark)
    throw Error("--black-level is for --contrast bright: leave it out");
  if (options.log_base != 0 && !options.take_log)
    throw Error("--log-base is for the logarithm: give --log as well, or leave it out");
  if (options.take_log && options.contrast == Contrast::kBright) {
    throw Error("--log is for transmitted intensities (--contrast dark); bright data need none");
  }
}

std::array<std::int64_t, 2> aligned_size(const InPlaneAlignment& alignment,
                                         const io::MrcHeader& header) {
  if (alignment.swaps_sizes()) return {header.ny, header.nx};
  return {header.nx, header.ny};
}

void correct(const geometry::ViewCorrection& correction, PlannedView& planned) {
  planned.raw_from_aligned = geometry::corrected(planned.raw_from_aligned, correction);
  planned.view.tilt_deg += correction.tilt_deg;
  planned.local = correction.local;
}

}  // namespace

std::array<std::int64_t, 2> aligned_size(const std::filesystem::path& xf,
                                         const io::ImageStack& stack) {
  return aligned_size(alignment_of_imod(xf, stack), stack.header());
}

SeriesPlan plan_series(const TiltSeriesOptions& options, const io::ImageStack& stack) {
  require_compatible(options);
  const io::MrcHeader& header = stack.header();
  const auto mdoc = options.mdoc ? std::optional(io::read_mdoc(*options.mdoc)) : std::nullopt;
  SeriesPlan plan;
  plan.pixel_size_A = find_pixel_size(options, stack, mdoc);
  const auto table = find_section_table(options, stack, plan.pixel_size_A);
  TiltAngles angles = find_tilt_angles(options, stack, table, mdoc);
  for (auto& angle : angles.of_section)
    if (angle) angle->value += options.tilt_offset_deg;
  if (mdoc && std::ssize(mdoc->sections) != header.nz) {
    base::log_warning(fmt::format("'{}' has {} sections and '{}' {}: are they of one series?",
                                  options.mdoc->string(), mdoc->sections.size(), stack.name(),
                                  header.nz));
  }
  const std::vector<double> x_tilts_deg = find_x_tilts(options, stack, table);
  const auto excluded = io::parse_section_list(options.exclude, header.nz);

  std::optional<InPlaneAlignment> alignment;
  if (options.xf)
    alignment = alignment_of_imod(*options.xf, stack);
  else if (table)
    alignment = alignment_of_table(*table);
  if (mdoc && !alignment) require_vertical_axis(options, *mdoc, stack);

  plan.angle_source = angles.source;
  plan.is_raw = alignment.has_value();
  const auto size = aligned_size(alignment.value_or(InPlaneAlignment{}), header);
  plan.aligned_width = size[0];
  plan.aligned_height = size[1];
  plan.bin_factor = find_bin_factor(options, plan);
  for (std::int64_t section = 0; section < header.nz; ++section) {
    const auto at = static_cast<std::size_t>(section);
    const bool is_dark = alignment && !alignment->of_section[at];
    if (is_dark || std::ranges::binary_search(excluded, section) ||
        std::ranges::binary_search(options.left_out, section))
      continue;
    PlannedView planned;
    planned.view = {section, require_usable_tilt(angles, section),
                    x_tilts_deg[at] - options.x_axis_tilt_deg};
    if (alignment) planned.raw_from_aligned = *alignment->of_section[at];
    if (!options.corrections.empty()) correct(options.corrections[at], planned);
    TOMOFIELD_CHECK(options.resample || !planned.local, "local motion of views as recorded");
    plan.views.push_back(planned);
  }
  if (plan.views.empty()) {
    throw Error(
        fmt::format("no section of '{}' is left to reconstruct from; exclude fewer", stack.name()));
  }
  return plan;
}

}  // namespace tomofield::tilt_series
