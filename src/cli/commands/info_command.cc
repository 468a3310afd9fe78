#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <tuple>

#include "base/enum_names.h"
#include "cli/commands/commands.h"
#include "cli/options/help_formatter.h"
#include "cli/options/project_options.h"
#include "cli/options/table_options.h"
#include "cli/terminal/console.h"
#include "io/images/mrc.h"
#include "io/images/mrc_format.h"
#include "io/images/tiff_stack.h"
#include "io/saving/positioned_file.h"
#include "io/tables/view_table.h"
#include "output/model_file.h"
#include "tilt_series/measured_series.h"
#include "tilt_series/series_plan.h"

namespace tomofield::cli {
namespace {

using field::Field;
using field::LeafShape;

enum class FileKind { kMrc, kHdf5, kOtherImages };

/// Returns the kind of a file by its first bytes. The images that an .mdoc names, and those of a
/// folder, are no file.
FileKind kind_of(const std::filesystem::path& path) {
  std::error_code absent;
  if (path.extension() == ".mdoc" || std::filesystem::is_directory(path, absent))
    return FileKind::kOtherImages;
  if (io::is_tiff(path)) return FileKind::kOtherImages;
  constexpr std::string_view kHdf5Signature = "\x89HDF\r\n\x1a\n";
  const io::PositionedFile file(path, io::PositionedFile::Access::kRead);
  std::array<char, kHdf5Signature.size()> start{};
  if (file.size() >= static_cast<std::int64_t>(start.size())) {
    file.read_at(0, start.data(), start.size());
  }
  return std::string_view(start.data(), start.size()) == kHdf5Signature ? FileKind::kHdf5
                                                                        : FileKind::kMrc;
}

void print_voxel_size(const io::MrcHeader& header) {
  const auto& size_A = header.voxel_size_A;
  if (std::all_of(size_A.begin(), size_A.end(), [](double size) { return size == 0.0; })) {
    print("  voxel size       not given\n");
    return;
  }
  print("  voxel size       {:.7g} × {:.7g} × {:.7g} Å\n", size_A[0], size_A[1], size_A[2]);
}

void print_extended_header(const io::MrcHeader& header) {
  if (header.extended_header_bytes == 0) {
    print("  extended header  none\n");
    return;
  }
  print("  extended header  {} bytes of type '{}'\n", header.extended_header_bytes,
        header.extended_header_type);
  const auto& tilts = header.extended_tilt_deg;
  if (tilts.empty()) return;
  const auto [low, high] = std::minmax_element(tilts.begin(), tilts.end());
  print("  tilt angles      {} in the extended header, {}° to {}°\n", tilts.size(), *low, *high);
  if (header.extended_axis_deg)
    print("  tilt axis        {:.4g}° in the extended header\n", *header.extended_axis_deg);
}

void print_mrc(const std::filesystem::path& path) {
  const io::MrcReader reader(path);
  const io::MrcHeader& header = reader.header();
  io::warn_of_mode(header, path.string());
  print("{}: MRC {}\n", path.string(), header.is_volume ? "volume" : "image stack");
  print("  size             {} × {} × {} (x, y, sections)\n", header.nx, header.ny, header.nz);
  print("  values           {}{}, {}-endian\n", io::describe(header.mode),
        header.bytes_are_unsigned ? " read as unsigned (IMOD's rule)" : "",
        header.is_byte_swapped ? "big" : "little");
  print_voxel_size(header);
  print("  origin           {:.7g}, {:.7g}, {:.7g} Å\n", header.origin_A[0], header.origin_A[1],
        header.origin_A[2]);
  print("  in the header    minimum {:.7g}, maximum {:.7g}, mean {:.7g}, rms {:.7g}\n", header.min,
        header.max, header.mean, header.rms);
  print_extended_header(header);
  for (const std::string& label : header.labels) print("  label            {}\n", label);
}

/// Prints what is known of a TIFF stack, or of images in several files.
void print_other_images(const tilt_series::TiltSeriesOptions& options) {
  const auto stack = tilt_series::open_views(options);
  const io::MrcHeader& header = stack->header();
  print("{}: image stack\n", stack->name());
  print("  size             {} × {} × {} (x, y, sections)\n", header.nx, header.ny, header.nz);
  print_voxel_size(header);
}

void print_series(const tilt_series::TiltSeriesOptions& options) {
  const tilt_series::MeasuredSeries series(options);
  print("  as a tilt series {} views of {} × {} pixels of {:.7g} Å, tilt axis along y\n",
        series.views().size(), series.width(), series.height(), series.pixel_size_A());
  if (options.contrast == Contrast::kDark) {
    print("  empty beam       {:.7g}\n", series.empty_beam());
  }
  const tilt_series::MaskMetrics& masks = series.mask_metrics();
  const bool is_undecided = masks.bead_masking == tilt_series::BeadMasking::kUndecided;
  print("  masked           {}, {} hot or dead pixels\n",
        is_undecided ? "no beads" : describe_beads(masks), masks.num_bad_pixels);
  if (is_undecided) {
    print("  found            {}, not masked: they may be the specimen\n", describe_beads(masks));
  }
  if (masks.fixed_pattern.is_any()) {
    print("  fixed pattern    {}\n", tilt_series::describe_pattern(masks.fixed_pattern));
  }
  print("  section  tilt/°  x-tilt/°  noise\n");
  for (std::size_t i = 0; i < series.views().size(); ++i) {
    const tilt_series::View& view = series.views()[i];
    print("  {:7}  {:6.2f}  {:8.2f}  {:.5g}\n", view.section + 1, view.tilt_deg, view.x_tilt_deg,
          series.noise_sigma()[i]);
  }
}

void print_geometry(const output::ModelInfo& model) {
  const geometry::TiltGeometry& g = model.geometry;
  const Rectangle& roi = model.roi;
  print("  pixel size       {:.7g} Å\n", model.pixel_size_A);
  print("  view             {} × {} px, thickness {:.6g} px\n", g.width, g.height, g.thickness);
  print("  region           {} × {} px from {},{}\n", roi.width(), roi.height(), roi.x0, roi.y0);
  if (!g.tilt_deg.empty()) {
    const auto [low, high] = std::minmax_element(g.tilt_deg.begin(), g.tilt_deg.end());
    print("  tilts            {} views from {:.6g}° to {:.6g}°\n", g.num_views(), *low, *high);
  }
  print("  tilt axis        x = {:.6g} px, z = {:.6g} px, hand {:+}\n", g.axis_x, g.axis_z, g.hand);
  print("  contrast         {}, 1 density unit is {:.6g} units of the series\n",
        model.is_dark ? "dark" : "bright", model.density_unit);
}

// Plain vertices have ranks in the file as well, which mean nothing.
std::string describe(const LeafShape& shape, FieldKind kind) {
  std::string text = fmt::format("{} × {} × {} vertices", shape.nx, shape.ny, shape.nz);
  const bool is_factorised =
      kind == FieldKind::kVm && shape.rank_x + shape.rank_y + shape.rank_z > 0;
  if (is_factorised)
    text += fmt::format(", ranks {}, {}, {}", shape.rank_x, shape.rank_y, shape.rank_z);
  return text;
}

// Prints a line for each kind of leaves, large ones first.
void print_leaves(const field::Quadtree& tree, const std::vector<LeafShape>& shapes,
                  FieldKind kind) {
  std::map<std::tuple<bool, std::int64_t, std::string>, int> kinds;
  for (int i = 0; i < tree.num_leaves(); ++i) {
    const field::QuadtreeNode& leaf = tree.leaf(i);
    ++kinds[{leaf.region == field::Region::kMargin, -leaf.square.size,
             describe(shapes[static_cast<std::size_t>(i)], kind)}];
  }
  for (const auto& [leaf, count] : kinds) {
    const auto& [is_margin, size, shape] = leaf;
    print("    {:6} of {} px: {}{}\n", count, -size, shape, is_margin ? " (margin)" : "");
  }
}

void print_field(const output::Model& model) {
  const field::RootGrid& roots = model.tree().roots();
  if (model.coded) {
    print("  field            compact, {} parameters in {} bytes\n",
          model.coded->codes.num_parameters(), model.coded->codes.bytes.size());
  } else {
    const Field& field = *model.field;
    const std::string activation =
        field.activation.beta > 0
            ? fmt::format("softplus of sharpness {:.6g}", field.activation.beta)
            : "no activation";
    print("  field            {}, {} parameters, bias {:.6g}, {}\n", base::name_of(field.kind()),
          field.num_parameters(), field.bias, activation);
  }
  print("  quadtree         {} × {} root cells of {} px from {},{}; {} leaves\n", roots.columns,
        roots.rows, roots.cell_size, roots.x0, roots.y0, model.tree().num_leaves());
  if (model.coded)
    print_leaves(model.tree(), model.coded->codes.shapes, FieldKind::kVm);
  else
    print_leaves(model.tree(), model.field->shapes(), model.field->kind());
}

void print_training(const output::TrainingState& state) {
  std::string names;
  const auto append = [&names](const auto& arrays) {
    for (const auto& [name, values] : arrays)
      names += fmt::format("{}{} [{}]", names.empty() ? "" : ", ", name, values.size());
  };
  append(state.floats);
  append(state.doubles);
  append(state.integers);
  print("  training state   {}\n", names.empty() ? "none" : names);
}

// Prints the contents of a model file.
void print_model(const std::filesystem::path& path) {
  output::TrainingState training;
  const output::Model model = output::load_undecoded(path, &training);
  print("{}: model, written by {}\n", path.string(), model.written_by);
  print_geometry(model);
  print_field(model);
  print_training(training);
  print("  options          {}\n", model.options_json);
}

void print_info(const tilt_series::TiltSeriesOptions& options) {
  if (io::is_view_table(options.stack)) return print_series(options);
  switch (kind_of(options.stack)) {
    case FileKind::kHdf5:
      return print_model(options.stack);
    case FileKind::kOtherImages:
      print_other_images(options);
      break;
    case FileKind::kMrc:
      tilt_series::open_views(options);  // refuses other files of a series, with advice
      print_mrc(options.stack);
      break;
  }
  if (options.tlt || options.aln || options.mdoc) print_series(options);
}

}  // namespace

void add_info_command(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "info",
      "Show what an MRC file or a model holds. With tilt angles, check a stack as a tilt series");
  auto choices = std::make_shared<option_table::Choices>();
  add_input_options(*command, *choices);
  command->get_option("stack")->description(
      "An MRC file, a model (.h5), or a tilt series: a stack, raw or aligned, or a project");
  add_help_all(*command);
  command->callback([command, choices] {
    open_project(*command, *choices);
    print_info(tilt_series::series_options(choices->files, choices->options));
  });
}

}  // namespace tomofield::cli
