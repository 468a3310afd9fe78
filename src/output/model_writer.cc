#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "base/enum_names.h"
#include "base/plausible.h"
#include "base/threads/parallel.h"
#include "base/trace.h"
#include "io/hdf5/hdf5_file.h"
#include "io/saving/atomic_file.h"
#include "output/model_file.h"
#include "tomofield/error.h"
#include "tomofield/version.h"

namespace tomofield::output {
namespace {

using io::Hdf5Group;
using Integers = std::vector<std::int64_t>;

// Writes one member of a list of structs as an array.
template <typename Items, typename Get>
void write_column(Hdf5Group& group, const char* name, const Items& items, Get get) {
  Integers column;
  for (const auto& item : items) column.push_back(static_cast<std::int64_t>(get(item)));
  group.write_array<std::int64_t>(name, column);
}

void write_geometry(Hdf5Group group, const ModelInfo& info) {
  const geometry::TiltGeometry& g = info.geometry;
  group.write_integer("width", g.width);
  group.write_integer("height", g.height);
  group.write_number("thickness", g.thickness);
  group.write_integer("hand", g.hand);
  group.write_number("axis_x", g.axis_x);
  group.write_number("axis_z", g.axis_z);
  if (!info.alignment_json.empty()) group.write_text("alignment_json", info.alignment_json);
  group.write_array<double>("tilt_deg", g.tilt_deg);
  const Integers roi{info.roi.x0, info.roi.y0, info.roi.x1, info.roi.y1};
  group.write_array<std::int64_t>("roi", roi);
}

void write_tree(Hdf5Group group, const field::Quadtree& tree) {
  const field::RootGrid& roots = tree.roots();
  group.write_integer("x0", roots.x0);
  group.write_integer("y0", roots.y0);
  group.write_integer("cell_size", roots.cell_size);
  group.write_integer("columns", roots.columns);
  group.write_integer("rows", roots.rows);
  const auto& nodes = tree.nodes();
  using Node = const field::QuadtreeNode&;
  write_column(group, "node_x0", nodes, [](Node n) { return n.square.x0; });
  write_column(group, "node_y0", nodes, [](Node n) { return n.square.y0; });
  write_column(group, "node_size", nodes, [](Node n) { return n.square.size; });
  write_column(group, "node_level", nodes, [](Node n) { return n.level; });
  write_column(group, "node_is_margin", nodes,
               [](Node n) { return n.region == field::Region::kMargin; });
  write_column(group, "node_parent", nodes, [](Node n) { return n.parent; });
  write_column(group, "node_first_child", nodes, [](Node n) { return n.first_child; });
}

void write_leaves(Hdf5Group& group, const field::Quadtree& tree,
                  const std::vector<field::LeafShape>& shapes) {
  write_column(group, "node", tree.leaves(), [](int node) { return node; });
  using Shape = const field::LeafShape&;
  write_column(group, "nx", shapes, [](Shape s) { return s.nx; });
  write_column(group, "ny", shapes, [](Shape s) { return s.ny; });
  write_column(group, "nz", shapes, [](Shape s) { return s.nz; });
  write_column(group, "rank_x", shapes, [](Shape s) { return s.rank_x; });
  write_column(group, "rank_y", shapes, [](Shape s) { return s.rank_y; });
  write_column(group, "rank_z", shapes, [](Shape s) { return s.rank_z; });
}

// Writes what all fields have but their leaves.
void write_structure(Hdf5Group& group, FieldKind kind, const field::Quadtree& tree,
                     double thickness, double bias, double softplus_beta) {
  group.write_text("kind", base::name_of(kind));
  group.write_number("thickness", thickness);
  group.write_number("bias", bias);
  group.write_number("softplus_beta", softplus_beta);
  write_tree(group.create_group("tree"), tree);
}

void write_offsets(Hdf5Group& group, const field::Field& field) {
  Integers offsets;
  for (int i = 0; i <= field.tree().num_leaves(); ++i)
    offsets.push_back(static_cast<std::int64_t>(field.offset(i)));
  group.write_array<std::int64_t>("offset", offsets);
}

void write_codes(Hdf5Group group, const compact::LeafCodes& codes) {
  group.write_array<double>("step", codes.step);
  group.write_array<double>("face_weight", codes.face_weight);
  group.write_array<std::int64_t>("offset", codes.offset);
  group.write_array<std::uint8_t>("bytes", codes.bytes);
}

void write_coded_field(Hdf5Group group, const compact::CodedField& coded) {
  write_structure(group, FieldKind::kVm, coded.tree, coded.thickness, 0.0, 0.0);
  {
    Hdf5Group leaves = group.create_group("leaves");
    write_leaves(leaves, coded.tree, coded.codes.shapes);
  }
  write_codes(group.create_group("code"), coded.codes);
}

template <typename T>
void write_arrays(Hdf5Group group, const std::map<std::string, std::vector<T>>& arrays) {
  for (const auto& [name, values] : arrays) group.write_array<T>(name, values);
}

void write_training(Hdf5Group group, const TrainingState& state, const FloatArrays& more_floats) {
  Hdf5Group floats = group.create_group("floats");
  for (const auto& [name, values] : state.floats) floats.write_array<float>(name, values);
  for (const auto& [name, source] : more_floats)
    floats.write_floats(name, source.size, source.hand_out);
  write_arrays(group.create_group("doubles"), state.doubles);
  write_arrays(group.create_group("integers"), state.integers);
}

// Writes what all models have, and then what `write_rest` writes: the field and a training state.
void write_contents(Hdf5Group root, const ModelInfo& info, std::int64_t version,
                    const std::function<void(Hdf5Group&)>& write_rest) {
  root.write_text("format", kFormat);
  root.write_integer("format_version", version);
  root.write_text("written_by", fmt::format("tomofield {}", library_version()));
  root.write_number("x_tilt_deg", info.x_tilt_deg);
  root.write_number("pixel_size_A", info.pixel_size_A);
  root.write_number("density_unit", info.density_unit);
  root.write_text("contrast", info.is_dark ? "dark" : "bright");
  root.write_text("options_json", info.options_json);
  write_geometry(root.create_group("geometry"), info);
  write_rest(root);
}

// Writes a model (write_contents()) atomically.
void write_model(const std::filesystem::path& path, const ModelInfo& info, std::int64_t version,
                 const std::function<void(Hdf5Group&)>& write_rest) {
  const base::TraceSpan span("write model");
  io::AtomicFile target(path);
  {
    io::Hdf5File file = io::Hdf5File::create(target.temporary_path());
    write_contents(file.root(), info, version, write_rest);
    file.close();
  }
  target.commit();
}

}  // namespace

void require_plausible_parameters(const field::Field& field, const std::string& complaint) {
  const std::span<const float> parameters = field.parameters();
  std::vector<std::size_t> bad(static_cast<std::size_t>(field.tree().num_leaves()),
                               parameters.size());  // the first one of each leaf
  base::parallel_for("check parameters", std::ssize(bad), [&](std::int64_t i) {
    const int leaf = static_cast<int>(i);
    if (!field.keeps(leaf)) return;
    const auto first = parameters.begin() + std::ptrdiff_t(field.offset(leaf)),
               end = parameters.begin() + std::ptrdiff_t(field.offset(leaf + 1));
    const auto found = std::find_if(
        first, end, [](float value) { return !base::is_plausible(static_cast<double>(value)); });
    if (found != end)
      bad[static_cast<std::size_t>(i)] = static_cast<std::size_t>(found - parameters.begin());
  });
  const auto first_bad = std::ranges::min_element(bad);
  if (first_bad == bad.end() || *first_bad == parameters.size()) return;
  throw Error(fmt::format("{}: parameter {} is {}", complaint, *first_bad, parameters[*first_bad]));
}

void require_converged(const field::Field& field) {
  require_plausible_parameters(
      field,
      "the fit diverged, and no file is replaced; check --contrast and --black-level, and look for "
      "views whose grey levels differ from the rest; a lower --learning-rate may help, too");
}

void save_model(const std::filesystem::path& path, const field::Field& field, const ModelInfo& info,
                const TrainingState* training, const FloatArrays& more_floats) {
  require_converged(field);
  save_model(path, field, FloatSource(field.parameters()), info, training, more_floats);
}

void save_model(const std::filesystem::path& path, const field::Field& field,
                const FloatSource& parameters, const ModelInfo& info, const TrainingState* training,
                const FloatArrays& more_floats) {
  write_model(path, info, kFormatVersion, [&](Hdf5Group& root) {
    Hdf5Group group = root.create_group("field");
    write_structure(group, field.kind(), field.tree(), field.thickness(),
                    static_cast<double>(field.bias), static_cast<double>(field.activation.beta));
    {
      Hdf5Group leaves = group.create_group("leaves");
      write_leaves(leaves, field.tree(), field.shapes());
      write_offsets(leaves, field);
    }
    group.write_floats("parameters", parameters.size, parameters.hand_out);
    if (training != nullptr) write_training(root.create_group("training"), *training, more_floats);
  });
}

void save_coded(const std::filesystem::path& path, const compact::CodedField& coded,
                const ModelInfo& info, const TrainingState* training) {
  write_model(path, info, kCompactVersion, [&](Hdf5Group& root) {
    write_coded_field(root.create_group("field"), coded);
    if (training != nullptr) write_training(root.create_group("training"), *training, {});
  });
}

std::size_t coded_file_size(const compact::CodedField& coded, const ModelInfo& info) {
  const io::Hdf5File file = io::Hdf5File::create_in_memory();
  write_contents(file.root(), info, kCompactVersion,
                 [&](Hdf5Group& root) { write_coded_field(root.create_group("field"), coded); });
  return file.size();
}

void save_model(const std::filesystem::path& path, const Model& model,
                const TrainingState* training) {
  if (model.coded) return save_coded(path, *model.coded, model);
  save_model(path, *model.field, model, training);
}

}  // namespace tomofield::output
