#include "tilt_series/series_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "base/check.h"
#include "base/log.h"
#include "base/near_whole.h"
#include "base/plausible.h"
#include "geometry/raw_from_aligned.h"
#include "io/images/mrc.h"
#include "io/images/mrc_format.h"
#include "io/saving/scratch_memory.h"
#include "io/tables/alignment_files.h"
#include "io/tables/text_lines.h"
#include "io/tables/view_table.h"
#include "tilt_series/contradictions.h"
#include "tilt_series/local/file_motion.h"
#include "tilt_series/pixel_size.h"
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

/// Returns the axis of a table of views that are not aligned yet. Throws Error if it states
/// several.
StatedAxis nominal_axis(const SectionTable& table) {
  const auto first = std::ranges::find_if(table.of_section,
                                          [](const auto& section) { return section.has_value(); });
  constexpr double kSame_deg = 1.0;
  for (const auto& section : table.of_section)
    if (section && angle_between_axes(section->rotation_deg, (*first)->rotation_deg) > kSame_deg)
      throw Error(fmt::format(
          "'{}' states nominal tilt axes of {:.6g}° and {:.6g}°: a series has one, so correct it",
          table.source, (*first)->rotation_deg, section->rotation_deg));
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

// A table of views whose alignment another file replaces (--aln, --xf). The views that it leaves
// out stay so.
class ReplacedTable {
 public:
  ReplacedTable(const TiltSeriesOptions& options, const io::ImageStack& stack,
                const std::optional<SectionTable>& table, double pixel_size_A) {
    if (options.images || !io::is_view_table(options.stack)) return;
    if (options.aln)
      table_ = sections_of_views(io::read_view_table(options.stack), stack, pixel_size_A);
    else if (options.xf)
      table_ = table;
  }

  /// Adds the sections that the table leaves out to some that are sorted.
  void exclude_unused(std::vector<std::int64_t>& excluded) const {
    for (std::size_t i = 0; table_ && i < table_->of_section.size(); ++i)
      if (!table_->of_section[i]) excluded.push_back(static_cast<std::int64_t>(i));
    std::ranges::sort(excluded);
  }

  void warn_of_differences(const TiltAngles& angles, const InPlaneAlignment& alignment,
                           const TiltSeriesOptions& options, const io::ImageStack& stack) const {
    if (!table_ || table_->is_nominal) return;
    if (options.aln) warn_of_other_angles(angles, *table_);
    warn_of_other_axis({alignment_of_table(*table_).axis_deg(), "'" + table_->source + "'"},
                       alignment.axis_deg(), options, stack);
  }

 private:
  std::optional<SectionTable> table_;
};

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

double find_bin_factor(const TiltSeriesOptions& options, const SeriesPlan& plan) {
  if (options.angpix && options.bin != 1.0) {
    throw Error("--bin and --angpix both set the size of the binned pixels; give one of them");
  }
  const double factor =
      base::whole_if_near(options.angpix ? *options.angpix / plan.pixel_size_A : options.bin);
  if (!std::isfinite(factor) || factor < 1.0) {
    throw Error(options.angpix
                    ? fmt::format("--angpix {} is below the stack's pixel size of {} Å: views can "
                                  "be reduced, not enlarged",
                                  *options.angpix, plan.pixel_size_A)
                    : fmt::format("--bin {} must be 1 or more", options.bin));
  }
  if (reduced_size(std::min(plan.aligned_width, plan.aligned_height), factor) < 1) {
    throw Error(fmt::format("binning by {} leaves nothing of views of {} × {} pixels", factor,
                            plan.aligned_width, plan.aligned_height));
  }
  return factor;
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

/// Returns the size of the pixels by which a table of views states shifts in Å: the project's, or
/// that of the images. One that somebody gives (--pixel-size) leaves the views where they are.
double listed_pixel_size_A(const TiltSeriesOptions& options, const io::MrcHeader& header,
                           double used_A) {
  if (options.listed_pixel_size_A) return *options.listed_pixel_size_A;
  return io::is_known_size(header.voxel_size_A[0]) ? header.voxel_size_A[0] : used_A;
}

void require_no_axis_beside(const TiltSeriesOptions& options,
                            const std::optional<SectionTable>& table) {
  if (!options.tilt_axis_deg || !table || table->is_nominal) return;
  throw Error(fmt::format(
      "--tilt-axis turns views that have no other alignment, and '{}' aligns them: leave "
      "--tilt-axis out",
      table->source));
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

std::optional<double> project_pixel_size_A(std::span<const Setting> settings) {
  const auto stated = std::ranges::find(settings, "--pixel-size", &Setting::option);
  return stated == settings.end() ? std::nullopt
                                  : std::optional<double>(io::parse_number(stated->value));
}

TiltSeriesOptions series_options(const SeriesFiles& files, const Options& options) {
  TiltSeriesOptions series{files, options.views};
  series.listed_pixel_size_A = project_pixel_size_A(options.settings);
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

double axis_of_transforms(const std::filesystem::path& xf, const io::ImageStack& stack) {
  return alignment_of_imod(xf, stack).axis_deg();
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
  plan.listed_pixel_size_A = listed_pixel_size_A(options, header, plan.pixel_size_A);
  const auto table = find_section_table(options, stack, plan.listed_pixel_size_A);
  require_no_axis_beside(options, table);
  const TiltAngles angles = find_tilt_angles(options, stack, table, mdoc);
  const std::vector<double> x_tilts_deg = find_x_tilts(options, stack, table);
  const ReplacedTable replaced(options, stack, table, plan.listed_pixel_size_A);
  auto excluded = io::parse_section_list(options.exclude, header.nz);
  replaced.exclude_unused(excluded);

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
    if (const auto by_rotation = mdoc ? axis_of_lone_rotation(options, *mdoc) : std::nullopt;
        by_rotation && alignment && !options.tilt_axis_deg)
      warn_of_other_line(*by_rotation, alignment->axis_deg(), options, stack);
    if (table && table->nominal_axis_deg && alignment && !options.xf)
      warn_of_other_axis({*table->nominal_axis_deg, "its _rlnTomoNominalTiltAxisAngle"},
                         alignment->axis_deg(), options, stack);
    if (alignment) replaced.warn_of_differences(angles, *alignment, options, stack);
    if (alignment) warn_of_turned_views(alignment->axes_deg, alignment->axis_deg(), options, stack);
    if (options.tilt_axis_deg)
      warn_of_given_axis(*options.tilt_axis_deg, axis_of_files(options, stack, table, mdoc));
    if (options.starts_raw && !axis && !alignment) warn_of_unknown_axis(stack);
    warn_of_sections_beyond(options, stack);
    warn_of_headers(options, stack, mdoc);
    io::warn_of_mode(header, stack.name());
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
  require_usable_tilts(tilts, options.tilt_offset_deg, sections, stack);
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
