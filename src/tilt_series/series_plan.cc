#include "tilt_series/series_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "base/check.h"
#include "base/log.h"
#include "base/plausible.h"
#include "geometry/raw_from_aligned.h"
#include "io/images/mrc.h"
#include "io/images/mrc_format.h"
#include "io/saving/scratch_memory.h"
#include "io/tables/alignment_files.h"
#include "io/tables/view_table.h"
#include "tilt_series/contradictions.h"
#include "tilt_series/local/file_motion.h"
#include "tilt_series/resampling/binning.h"
#include "tilt_series/section_table.h"
#include "tilt_series/tilt_angles.h"
#include "tilt_series/tilt_axis.h"
#include "tomofield/error.h"

namespace tomofield::tilt_series {
namespace {

constexpr double kDegree_rad = std::numbers::pi / 180.0;

/// The in-plane transform of each section, and the rotation of the tilt axis that it undoes.
struct InPlaneAlignment {
  std::vector<std::optional<RawFromAligned>> of_section;  ///< none: not aligned (dark frame)
  Angles axes_deg;                                        ///< [section]; none: it has no rotation
  double sum_cos = 0.0, sum_sin = 0.0;                    ///< of the axes

  void add_section(const RawFromAligned& transform, std::optional<double> axis_deg) {
    of_section.emplace_back(transform);
    axes_deg.push_back(axis_deg);
    if (!axis_deg) return;
    sum_cos += std::cos(*axis_deg * kDegree_rad);
    sum_sin += std::sin(*axis_deg * kDegree_rad);
  }
  void add_dark_frame() {
    of_section.emplace_back();
    axes_deg.emplace_back();
  }

  double axis_deg() const { return std::atan2(sum_sin, sum_cos) / kDegree_rad; }
  /// Tells whether the aligned images are as wide as the raw ones are high.
  bool swaps_sizes() const { return std::fabs(sum_sin) > std::fabs(sum_cos); }
};

InPlaneAlignment alignment_of_imod(const std::filesystem::path& path, const io::ImageStack& stack) {
  const auto transforms = io::read_imod_transforms(path);
  require_count(transforms.size(), path, "transforms", stack);
  InPlaneAlignment alignment;
  for (const io::ImodTransform& t : transforms) {
    // A pure rotation is R(−ROT): cos on the diagonal, +sin ROT above it.
    const double cosine = t.a11 + t.a22, sine = t.a12 - t.a21;
    const bool is_turned = std::hypot(cosine, sine) > 0.0;
    alignment.add_section(
        geometry::invert(t),
        is_turned ? std::optional(std::atan2(sine, cosine) / kDegree_rad) : std::nullopt);
  }
  return alignment;
}

InPlaneAlignment alignment_of_table(const SectionTable& table) {
  InPlaneAlignment alignment;
  for (const auto& section : table.of_section) {
    if (section)
      alignment.add_section(section->raw_from_aligned, section->rotation_deg);
    else
      alignment.add_dark_frame();
  }
  return alignment;
}

/// Returns the alignment of views that are turned by their tilt axis and not shifted.
InPlaneAlignment alignment_of_axis(double axis_deg, const io::ImageStack& stack) {
  const double cosine = std::cos(axis_deg * kDegree_rad), sine = std::sin(axis_deg * kDegree_rad);
  const RawFromAligned turned{cosine, -sine, sine, cosine};
  InPlaneAlignment alignment;
  for (std::int64_t section = 0; section < stack.header().nz; ++section)
    alignment.add_section(turned, axis_deg);
  return alignment;
}

/// Returns the axis of a table of views that are not aligned yet.
StatedAxis nominal_axis(const SectionTable& table) {
  const auto first = std::ranges::find_if(table.of_section,
                                          [](const auto& section) { return section.has_value(); });
  return {first == table.of_section.end() ? 0.0 : (*first)->rotation_deg,
          fmt::format("'{}', whose views are not aligned yet", table.source)};
}

/// Returns the axis that files state: a table of views that are not aligned yet, or what
/// find_stated_axis() finds without --tilt-axis.
std::optional<StatedAxis> axis_of_files(const TiltSeriesOptions& options,
                                        const io::ImageStack& stack,
                                        const std::optional<SectionTable>& table,
                                        const std::optional<io::Mdoc>& mdoc) {
  if (table && table->is_nominal) return nominal_axis(*table);
  TiltSeriesOptions without = options;
  without.tilt_axis_deg.reset();
  return find_stated_axis(without, stack, mdoc, /*is_aligned=*/true);
}

/// Returns the alignment that files give, or that by the tilt axis of a raw stack; nothing for an
/// aligned stack. Throws Error for a raw stack that nobody aligns.
std::optional<InPlaneAlignment> find_alignment(const TiltSeriesOptions& options,
                                               const io::ImageStack& stack,
                                               const std::optional<SectionTable>& table,
                                               const std::optional<StatedAxis>& axis) {
  if (options.xf) return alignment_of_imod(*options.xf, stack);
  if (table && !table->is_nominal) return alignment_of_table(*table);
  if (!axis) return std::nullopt;
  if (axis->is_given || options.starts_raw) return alignment_of_axis(axis->angle_deg, stack);
  if (table) {
    throw Error(fmt::format(
        "'{}' is not aligned yet: it has the nominal tilts and a tilt axis of {:.6g}°. `tomofield "
        "reconstruct` and `align` begin with them if --align full is given; or give the table that "
        "RELION's job 'Align tilt-series' wrote",
        table->source, axis->angle_deg));
  }
  require_vertical(*axis, stack);
  return std::nullopt;
}

/// Returns what --aln says of the sections, or else the table of views that is given as the stack.
std::optional<SectionTable> find_section_table(const TiltSeriesOptions& options,
                                               const io::ImageStack& stack, double pixel_size_A) {
  if (options.aln) return sections_of_aretomo(*options.aln, stack, !options.tlt);
  if (options.images || !io::is_view_table(options.stack)) return std::nullopt;
  return sections_of_views(io::read_view_table(options.stack), stack, pixel_size_A);
}

/// Returns the pixel size that an .mdoc states for the images of a stack, or 0. Its PixelSpacing is
/// that of images of ImageSize, which may be binned records of these.
double pixel_size_of_mdoc(const io::Mdoc& mdoc, const std::filesystem::path& path,
                          const io::ImageStack& stack) {
  const double spacing_A = mdoc.pixel_spacing_A.value_or(0.0);
  if (!base::is_plausible_pixel_size(spacing_A)) return 0.0;
  if (!mdoc.image_size_px) return spacing_A;
  const auto [width, height] = *mdoc.image_size_px;
  const auto ratio = [](std::int64_t a, std::int64_t b) {
    return static_cast<double>(a) / static_cast<double>(b);
  };
  const double across = ratio(stack.header().nx, width), along = ratio(stack.header().ny, height);
  // Cameras leave out a few rows or columns where they bin.
  constexpr double kSame = 0.02;
  const double whole = across >= 1.0 ? std::round(across) : 1.0 / std::round(1.0 / across);
  if (std::fabs(across / whole - 1.0) < kSame && std::fabs(along / whole - 1.0) < kSame)
    return spacing_A / whole;
  base::log_warning(
      fmt::format("'{}' states pixels of {} Å for images of {} × {}, and those of '{}' have {} × "
                  "{}: {} Å is taken (give the right size with --pixel-size)",
                  path.string(), spacing_A, width, height, stack.name(), stack.header().nx,
                  stack.header().ny, spacing_A));
  return spacing_A;
}

/// Returns the facts of a stack that is an MRC file.
std::optional<io::MrcFacts> facts_of(const TiltSeriesOptions& options,
                                     const io::ImageStack& stack) {
  if (stack.is_in_memory()) return std::nullopt;
  return io::find_mrc_facts(options.stack, stack.header());
}

/// Returns what is wrong with the pixel size of a header that has no usable one.
std::string fault_of_pixel_size(const TiltSeriesOptions& options, const io::ImageStack& stack) {
  const auto facts = facts_of(options, stack);
  if (!facts || (facts->voxel_size_A[0] == 0.0 && facts->voxel_size_A[1] == 0.0))
    return "has no pixel size";
  return fmt::format("states pixels of {:.6g} × {:.6g} Å, which cannot be", facts->voxel_size_A[0],
                     facts->voxel_size_A[1]);
}

/// Throws Error unless the pixels of a stack are square, or none of their sides is known.
void require_square_pixels(const io::ImageStack& stack) {
  const auto& [width_A, height_A, depth_A] = stack.header().voxel_size_A;
  if (!(std::fabs(width_A - height_A) > 0.001 * std::fabs(std::max(width_A, height_A)))) return;
  throw Error(
      fmt::format("'{}' has pixels of {:.6g} × {:.6g} Å{}, and only square ones can be "
                  "reconstructed: give their size "
                  "with --pixel-size if the header is wrong",
                  stack.name(), width_A, height_A,
                  std::min(width_A, height_A) == 0.0 ? " (0: none, or one that cannot be)" : ""));
}

void require_whole_images(const io::ImageStack& stack) {
  if (!stack.header().has_pieces) return;
  throw Error(fmt::format(
      "the extended header of '{}' places several sections at one Z: a montage of pieces is not "
      "read: blend them into one image a view (in eTomo or with blendmont)",
      stack.name()));
}

void warn_of_sections_beyond(const TiltSeriesOptions& options, const io::ImageStack& stack) {
  const auto facts = facts_of(options, stack);
  if (!facts || facts->sections_beyond == 0) return;
  base::log_warning(fmt::format(
      "'{}' is longer than its header states: after the {} sections there is room for {} more, "
      "which are not read (is the header right?)",
      stack.name(), stack.header().nz, facts->sections_beyond));
}

/// Warns if an .mdoc states another size than the header of its stack. Stacks are often binned by a
/// whole number, and the sizes of headers are often calibrated.
void warn_of_other_size(const io::Mdoc& mdoc, const std::filesystem::path& path,
                        const io::ImageStack& stack) {
  constexpr double kCalibration = 0.1;
  const double in_header_A = stack.header().voxel_size_A[0];
  if (mdoc.pixel_spacing_A.value_or(0.0) == 0.0) return;  // not known
  const double ratio = in_header_A / *mdoc.pixel_spacing_A;
  if (std::fabs(ratio / std::max(1.0, std::round(ratio)) - 1.0) < kCalibration) return;
  base::log_warning(
      fmt::format("'{}' states pixels of {:.6g} Å, and '{}' of {:.6g} Å: the latter is taken (give "
                  "the right size with --pixel-size)",
                  path.string(), *mdoc.pixel_spacing_A, stack.name(), in_header_A));
}

/// Returns the size of an unbinned pixel in Å: --pixel-size, else the header's, else the mdoc's.
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
  const bool is_default = in_header_A == 0.0 || in_header_A == 1.0;
  if (is_default && mdoc) {
    const double stated_A = pixel_size_of_mdoc(*mdoc, *options.mdoc, stack);
    if (stated_A > 0.0) return stated_A;
  }
  if (in_header_A > 0.0 && !is_default) {
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
    const double all_deg = x_tilts_deg[i] - options.x_axis_tilt_deg;
    if (std::max(std::fabs(x_tilts_deg[i]), std::fabs(all_deg)) <= kLargest_deg) continue;
    throw Error(fmt::format(
        "section {} of '{}' has an x-axis tilt of {}°{}, and they must be within ±{}°: mend it in "
        "'{}'{}",
        i + 1, stack.name(), x_tilts_deg[i],
        options.x_axis_tilt_deg != 0.0 ? fmt::format(", {}° with --x-axis-tilt", all_deg) : "",
        kLargest_deg, options.xtilt ? options.xtilt->string() : stack.name(),
        options.x_axis_tilt_deg != 0.0 ? ", or --x-axis-tilt" : ""));
  }
  return x_tilts_deg;
}

void require_compatible(const TiltSeriesOptions& options) {
  if (options.xf && options.aln) {
    throw Error(fmt::format("'{}' (--xf) and '{}' (--aln) both align the views; give one of them",
                            options.xf->string(), options.aln->string()));
  }
  if (options.tilt_axis_deg && (options.xf || options.aln)) {
    throw Error(fmt::format(
        "--tilt-axis turns views that have no other alignment, and {} '{}' aligns them: "
        "give one of them",
        options.xf ? "--xf" : "--aln", (options.xf ? *options.xf : *options.aln).string()));
  }
  if (options.local && options.aln) {
    throw Error(fmt::format(
        "'{}' (--local) has IMOD's local alignments, and '{}' (--aln) is of AreTomo; give one of "
        "them",
        options.local->string(), options.aln->string()));
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

/// Returns the sections that the files and the options leave in.
std::vector<std::int64_t> used_sections(const TiltSeriesOptions& options, std::int64_t num_sections,
                                        const std::vector<std::int64_t>& excluded,
                                        const std::optional<InPlaneAlignment>& alignment) {
  std::vector<std::int64_t> used;
  for (std::int64_t section = 0; section < num_sections; ++section) {
    const bool is_dark =
        alignment && !alignment->of_section[static_cast<std::size_t>(section)].has_value();
    if (!is_dark && !std::ranges::binary_search(excluded, section) &&
        !std::ranges::binary_search(options.left_out, section))
      used.push_back(section);
  }
  return used;
}

void correct(const geometry::ViewCorrection& correction, PlannedView& planned) {
  planned.raw_from_aligned = geometry::corrected(planned.raw_from_aligned, correction);
  planned.view.tilt_deg += correction.tilt_deg;
  if (planned.local && correction.local)
    planned.local = planned.local->then(*correction.local);
  else if (correction.local)
    planned.local = correction.local;
}

}  // namespace

TiltSeriesOptions series_options(const SeriesFiles& files, const Options& options) {
  TiltSeriesOptions series{files, options.views};
  series.resample = options.fit.engine == Engine::kSlab;
  series.starts_raw = options.run.align == Alignment::kFull;
  series.applies_local = series.resample && options.run.align == Alignment::kOff;
  series.scratch_dir = io::scratch_directory(options.run.output);
  return series;
}

std::array<std::int64_t, 2> aligned_size(const std::filesystem::path& xf,
                                         const io::ImageStack& stack) {
  return aligned_size(alignment_of_imod(xf, stack), stack.header());
}

SeriesPlan plan_series(const TiltSeriesOptions& options, const io::ImageStack& stack) {
  require_compatible(options);
  const io::MrcHeader& header = stack.header();
  if (io::is_own_volume(header)) {
    throw Error(fmt::format(
        "'{}' is a volume that tomofield wrote, and no tilt series: give the stack", stack.name()));
  }
  if (header.sections_a_volume > 0) {
    throw Error(fmt::format(
        "'{}' is a stack of volumes (space group 401), and no tilt series: give the stack",
        stack.name()));
  }
  require_whole_images(stack);
  const auto mdoc = options.mdoc ? std::optional(io::read_mdoc(*options.mdoc)) : std::nullopt;
  SeriesPlan plan;
  plan.pixel_size_A = find_pixel_size(options, stack, mdoc);
  const auto table = find_section_table(options, stack, plan.pixel_size_A);
  const TiltAngles angles = find_tilt_angles(options, stack, table, mdoc);
  const std::vector<double> x_tilts_deg = find_x_tilts(options, stack, table);
  const auto excluded = io::parse_section_list(options.exclude, header.nz);

  const bool has_alignment = options.xf || (table && !table->is_nominal);
  auto axis = find_stated_axis(options, stack, mdoc, has_alignment);
  if (table && table->is_nominal && !options.tilt_axis_deg) axis = nominal_axis(*table);
  const auto alignment = find_alignment(options, stack, table, axis);
  // A series that is aligned is opened several times, and says this once.
  if (options.corrections.empty() && options.left_out.empty()) {
    if (mdoc) warn_of_other_angles(angles, *options.mdoc, *mdoc, stack);
    warn_of_other_angles(angles, stack);
    if (table) warn_of_other_angles(angles, *table);
    if (table) warn_of_other_nominal_angles(*table);
    if (axis && mdoc) warn_of_two_axes(*axis, axis_of_header(stack));
    if (axis && alignment) warn_of_other_axis(*axis, alignment->axis_deg(), options, stack);
    if (table && table->nominal_axis_deg && alignment && !options.xf)
      warn_of_other_axis({*table->nominal_axis_deg, "its _rlnTomoNominalTiltAxisAngle"},
                         alignment->axis_deg(), options, stack);
    if (alignment) warn_of_turned_views(alignment->axes_deg, alignment->axis_deg(), options, stack);
    if (options.tilt_axis_deg)
      warn_of_given_axis(*options.tilt_axis_deg, axis_of_files(options, stack, table, mdoc));
    if (options.starts_raw && !axis && !alignment) warn_of_unknown_axis(stack);
    warn_of_sections_beyond(options, stack);
  }

  plan.angle_source = angles.source;
  plan.is_raw = alignment.has_value();
  if (alignment && !has_alignment) plan.axis = axis;
  const auto size = aligned_size(alignment.value_or(InPlaneAlignment{}), header);
  plan.aligned_width = size[0];
  plan.aligned_height = size[1];
  plan.bin_factor = find_bin_factor(options, plan);
  const std::vector<std::int64_t> sections = used_sections(options, header.nz, excluded, alignment);
  if (sections.empty()) {
    throw Error(
        fmt::format("no section of '{}' is left to reconstruct from; exclude fewer", stack.name()));
  }
  TiltAngles tilts = angles;
  for (auto& tilt : tilts.of_section)
    if (tilt) tilt->value += options.tilt_offset_deg;
  require_usable_tilts(tilts, sections, stack);
  FileMotion motion(options, stack, table, plan.pixel_size_A, size);
  for (const std::int64_t section : sections) {
    const auto at = static_cast<std::size_t>(section);
    PlannedView planned;
    planned.view = {section, tilts.of_section[at]->value,
                    x_tilts_deg[at] - options.x_axis_tilt_deg};
    if (alignment) planned.raw_from_aligned = *alignment->of_section[at];
    planned.local = motion.of(planned.view);
    if (!options.corrections.empty()) correct(options.corrections[at], planned);
    TOMOFIELD_CHECK(options.resample || !planned.local, "local motion of views as recorded");
    plan.views.push_back(planned);
  }
  if (options.corrections.empty() && options.left_out.empty()) motion.report();
  return plan;
}

}  // namespace tomofield::tilt_series
