#include "cli/model_info.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <string>
#include <tuple>

#include "base/enum_names.h"
#include "output/model_file.h"
#include "tomofield/options.h"

namespace tomofield::cli {
namespace {

using field::Field;
using field::LeafShape;

void print_geometry(const output::ModelInfo& model) {
  const geometry::TiltGeometry& g = model.geometry;
  const Rectangle& roi = model.roi;
  fmt::print("  pixel size       {:.7g} Å\n", model.pixel_size_A);
  fmt::print("  view             {} × {} px, thickness {:.6g} px\n", g.width, g.height,
             g.thickness);
  fmt::print("  region           {} × {} px from {},{}\n", roi.width(), roi.height(), roi.x0,
             roi.y0);
  if (!g.tilt_deg.empty()) {
    const auto [low, high] = std::minmax_element(g.tilt_deg.begin(), g.tilt_deg.end());
    fmt::print("  tilts            {} views from {:.6g}° to {:.6g}°\n", g.num_views(), *low, *high);
  }
  fmt::print("  tilt axis        x = {:.6g} px, z = {:.6g} px, hand {:+}\n", g.axis_x, g.axis_z,
             g.hand);
  fmt::print("  contrast         {}, 1 density unit is {:.6g} units of the series\n",
             model.is_dark ? "dark" : "bright", model.density_unit);
}

std::string describe(const LeafShape& shape) {
  std::string text = fmt::format("{} × {} × {} vertices", shape.nx, shape.ny, shape.nz);
  const bool is_factorised = shape.rank_x + shape.rank_y + shape.rank_z > 0;
  if (is_factorised)
    text += fmt::format(", ranks {}, {}, {}", shape.rank_x, shape.rank_y, shape.rank_z);
  return text;
}

// Prints a line for each kind of leaves, large ones first.
void print_leaves(const Field& field) {
  std::map<std::tuple<bool, std::int64_t, std::string>, int> kinds;
  for (int i = 0; i < field.tree().num_leaves(); ++i) {
    const field::QuadtreeNode& leaf = field.tree().leaf(i);
    ++kinds[{leaf.region == field::Region::kMargin, -leaf.square.size, describe(field.shape(i))}];
  }
  for (const auto& [kind, count] : kinds) {
    const auto& [is_margin, size, shape] = kind;
    fmt::print("    {:6} of {} px: {}{}\n", count, -size, shape, is_margin ? " (margin)" : "");
  }
}

void print_field(const Field& field) {
  const field::RootGrid& roots = field.tree().roots();
  fmt::print("  field            {}, {} parameters, bias {:.6g}, {}\n", base::name_of(field.kind()),
             field.num_parameters(), field.bias,
             field.activation.beta > 0
                 ? fmt::format("softplus of sharpness {:.6g}", field.activation.beta)
                 : "no activation");
  fmt::print("  quadtree         {} × {} root cells of {} px from {},{}; {} leaves\n",
             roots.columns, roots.rows, roots.cell_size, roots.x0, roots.y0,
             field.tree().num_leaves());
  print_leaves(field);
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
  fmt::print("  training state   {}\n", names.empty() ? "none" : names);
}

}  // namespace

void print_model(const std::filesystem::path& path) {
  output::TrainingState training;
  const output::Model model = output::load_model(path, &training);
  fmt::print("{}: model, written by {}\n", path.string(), model.written_by);
  print_geometry(model);
  print_field(*model.field);
  print_training(training);
  fmt::print("  options          {}\n", model.options_json);
}

}  // namespace tomofield::cli
