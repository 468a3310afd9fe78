#include "output/model_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <utility>

#include "base/enum_names.h"
#include "base/plausible.h"
#include "base/system/memory.h"
#include "base/threads/parallel.h"
#include "compact/decoded_field.h"
#include "io/hdf5/hdf5_reader.h"
#include "tomofield/error.h"
#include "tomofield/version.h"

namespace tomofield::output {
namespace {

using io::StoredGroup;

// Densities within plausible numbers, times the largest unit, are finite floats. A smaller one than
// the least, or a smaller step, would make them zeros; the contrast of no series gives one.
constexpr double kLeastUnit = 1e-30;
constexpr base::Interval kDensityUnits{kLeastUnit, 1e15};
constexpr base::Interval kSteps{kLeastUnit, base::kLargestNumber};

using Integers = std::vector<std::int64_t>;

// Copies floats that arrive in pieces, one a parameter, and keeps those of the leaves that a field
// keeps.
class KeptCopy {
 public:
  KeptCopy(const field::Field& field, std::span<float> values) : field_(field), values_(values) {}

  void operator()(std::span<const float> piece) {
    for (const std::size_t end = at_ + piece.size(); at_ < end;) {
      while (field_.offset(leaf_ + 1) <= at_) ++leaf_;
      const std::size_t count = std::min(end, field_.offset(leaf_ + 1)) - at_;
      if (field_.keeps(leaf_)) std::copy_n(piece.begin(), count, values_.begin() + offset());
      piece = piece.subspan(count);
      at_ += count;
    }
  }

 private:
  std::ptrdiff_t offset() const { return static_cast<std::ptrdiff_t>(at_); }

  const field::Field& field_;
  std::span<float> values_;
  std::size_t at_ = 0;
  int leaf_ = 0;
};

// Reads a model. Every fault is an Error that names the file.
class ModelReader {
 public:
  explicit ModelReader(const std::filesystem::path& path) : path_(path.string()), file_(path) {}

  // Keeps all leaves if `choose` is empty. Decodes a compact model whose leaves take at most
  // `most_decoded_bytes`.
  Model read(TrainingState* training, const ChooseLeaves& choose,
             std::size_t most_decoded_bytes = compact::kNoMemoryHolds) const {
    const StoredGroup root = file_.root();
    Model model;
    read_info(root, model);
    const StoredGroup group = root.group("field");
    if (group.has("code"))
      read_compact_field(group, choose, most_decoded_bytes, model);
    else
      model.field = read_field(group, choose);
    require(model.thickness() == model.geometry.thickness,
            "the thickness of its field is not that of its geometry");
    if (training != nullptr) *training = read_training(/*with_floats=*/true);
    return model;
  }

  TrainingState read_training(bool with_floats) const {
    const StoredGroup root = file_.root();
    require_known_format(root);
    if (!root.has("training")) return {};
    const StoredGroup group = root.group("training");
    using Floats = std::map<std::string, std::vector<float>>;
    return {.floats = with_floats ? read_arrays<float>(group.group("floats")) : Floats{},
            .doubles = read_arrays<double>(group.group("doubles")),
            .integers = read_arrays<std::int64_t>(group.group("integers"))};
  }

  ModelOutline read_outline() const {
    const StoredGroup root = file_.root();
    ModelOutline outline;
    read_info(root, outline);
    name_file_in_faults([&] { outline.tree = read_tree(root.group("field").group("tree")); });
    return outline;
  }

  void read_floats(const std::string& name, const field::Field& field,
                   std::span<float> values) const {
    const StoredGroup root = file_.root();
    const bool is_there = root.has("training") && root.group("training").has("floats") &&
                          root.group("training").group("floats").has(name);
    if (!is_there) {
      throw Error(fmt::format(
          "'{}' holds no optimiser state ('{}' is missing), so it is no checkpoint", path_, name));
    }
    const StoredGroup floats = root.group("training").group("floats");
    if (floats.array_size(name) != values.size()) {
      throw Error(fmt::format("'{}' holds {} of the {} moments of its parameters, so it is damaged",
                              path_, floats.array_size(name), values.size()));
    }
    floats.read_floats(name, KeptCopy(field, values));
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw Error(fmt::format("'{}' is a damaged model: {}; use another copy", path_, what));
  }
  void require(bool condition, const char* what) const {
    if (!condition) fail(what);
  }

  void require_known_format(const StoredGroup& root) const {
    if (!root.has_attribute("format") || root.text("format") != kFormat)
      throw Error(fmt::format(
          "'{}' is an HDF5 file and no model of tomofield. A stack must be MRC or TIFF: convert it "
          "with IMOD's newstack -format MRC or EMAN2's e2proc2d.py",
          path_));
    const std::int64_t version = root.integer("format_version");
    if (version != kFormatVersion && version != kCompactVersion)
      throw Error(
          fmt::format("'{}' is a model of format {}, written by {}; this is tomofield {}, which "
                      "reads formats {} and {}: "
                      "use the tomofield that wrote it",
                      path_, version, root.text("written_by"), library_version(), kFormatVersion,
                      kCompactVersion));
  }

  int small_integer(std::int64_t value) const {
    require(value >= std::numeric_limits<int>::min() && value <= std::numeric_limits<int>::max(),
            "a number is out of range");
    return static_cast<int>(value);
  }

  // Calls a function whose errors may not name the file yet.
  void name_file_in_faults(const std::function<void()>& read) const {
    try {
      read();
    } catch (const Error& error) {
      const std::string what = error.what();
      if (what.find(path_) != std::string::npos) throw;
      fail(what);
    }
  }

  void read_info(const StoredGroup& root, ModelInfo& info) const {
    require_known_format(root);
    info.x_tilt_deg = root.number("x_tilt_deg", base::kLargestTilt_deg);
    info.pixel_size_A = root.number("pixel_size_A", base::kPixelSizes_A);
    info.density_unit = root.number("density_unit", kDensityUnits);
    const std::string contrast = root.text("contrast");
    require(contrast == "dark" || contrast == "bright", "its contrast is neither dark nor bright");
    info.is_dark = contrast == "dark";
    info.options_json = root.text("options_json");
    info.written_by = root.text("written_by");
    read_geometry(root.group("geometry"), info);
  }

  void read_geometry(const StoredGroup& group, ModelInfo& info) const {
    constexpr std::int64_t kFar = std::int64_t{1} << 20;  // in pixels; no detector is wider
    geometry::TiltGeometry& g = info.geometry;
    g.width = group.integer("width");
    g.height = group.integer("height");
    g.thickness = group.number("thickness", {0, static_cast<double>(kFar)});
    g.hand = small_integer(group.integer("hand"));
    g.axis_x = group.number("axis_x", base::kLargestNumber);
    g.axis_z = group.number("axis_z", base::kLargestNumber);
    g.tilt_deg = group.read_array<double>("tilt_deg");
    if (group.has_attribute("alignment_json") || group.has("alignment_json"))
      info.alignment_json = group.text("alignment_json");
    const auto roi = group.read_array<std::int64_t>("roi");
    require(roi.size() == 4, "its region of interest has no four corners");
    info.roi = {roi[0], roi[1], roi[2], roi[3]};
    require(g.width > 0 && g.height > 0 && g.width <= kFar && g.height <= kFar && g.thickness > 0 &&
                (g.hand == 1 || g.hand == -1) &&
                std::all_of(g.tilt_deg.begin(), g.tilt_deg.end(),
                            [](double angle) { return std::abs(angle) < 90; }),
            "its geometry makes no sense");
    require(0 <= info.roi.x0 && info.roi.x0 < info.roi.x1 && info.roi.x1 <= g.width &&
                0 <= info.roi.y0 && info.roi.y0 < info.roi.y1 && info.roi.y1 <= g.height,
            "its region of interest is not inside the view");
  }

  field::Quadtree read_tree(const StoredGroup& group) const {
    field::RootGrid roots;
    roots.x0 = group.integer("x0");
    roots.y0 = group.integer("y0");
    roots.cell_size = group.integer("cell_size");
    roots.columns = small_integer(group.integer("columns"));
    roots.rows = small_integer(group.integer("rows"));
    std::vector<field::QuadtreeNode> nodes(group.array_size("node_x0"));
    const auto read = [&](const char* name, auto&& set) {
      Integers column(nodes.size());
      group.read_array<std::int64_t>(name, column);
      for (std::size_t i = 0; i < nodes.size(); ++i) set(nodes[i], column[i]);
    };
    using Node = field::QuadtreeNode&;
    read("node_x0", [](Node n, std::int64_t v) { n.square.x0 = v; });
    read("node_y0", [](Node n, std::int64_t v) { n.square.y0 = v; });
    read("node_size", [](Node n, std::int64_t v) { n.square.size = v; });
    read("node_level", [&](Node n, std::int64_t v) { n.level = small_integer(v); });
    read("node_is_margin", [](Node n, std::int64_t v) {
      n.region = v != 0 ? field::Region::kMargin : field::Region::kInterest;
    });
    read("node_parent", [&](Node n, std::int64_t v) { n.parent = small_integer(v); });
    read("node_first_child", [&](Node n, std::int64_t v) { n.first_child = small_integer(v); });
    return field::Quadtree(roots, std::move(nodes));
  }

  // Refuses more vertices than twice those of the finest field, an eighth of a pixel apart.
  void require_possible_sides(const field::Quadtree& tree, double thickness,
                              const std::vector<field::LeafShape>& shapes) const {
    constexpr std::int64_t kMostAPixel = 16;
    const double most_along_z = kMostAPixel * std::max(thickness, 1.0) + 2;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      const std::int64_t side = tree.leaf(static_cast<int>(i)).square.size;
      require(std::max(shapes[i].nx, shapes[i].ny) <= kMostAPixel * side + 2 &&
                  shapes[i].nz <= most_along_z,
              "a leaf has an impossible shape");
    }
  }

  // Reads the leaves of a tree, whose nodes the file names as well.
  std::vector<field::LeafShape> read_shapes(const StoredGroup& group, const field::Quadtree& tree,
                                            double thickness, int fewest = 2) const {
    std::vector<field::LeafShape> shapes(static_cast<std::size_t>(tree.num_leaves()));
    Integers nodes(shapes.size());
    group.read_array<std::int64_t>("node", nodes);
    require(std::ranges::equal(nodes, tree.leaves()), "its leaves are not those of its tree");
    const auto read = [&](const char* name, int field::LeafShape::*member, std::int64_t min) {
      Integers column(shapes.size());
      group.read_array<std::int64_t>(name, column);
      for (std::size_t i = 0; i < shapes.size(); ++i) {
        require(column[i] >= min && column[i] <= field::LeafShape::kMaxVertices,
                "a leaf has an impossible shape");
        shapes[i].*member = static_cast<int>(column[i]);
      }
    };
    read("nx", &field::LeafShape::nx, fewest);
    read("ny", &field::LeafShape::ny, fewest);
    read("nz", &field::LeafShape::nz, 2);
    read("rank_x", &field::LeafShape::rank_x, 0);
    read("rank_y", &field::LeafShape::rank_y, 0);
    read("rank_z", &field::LeafShape::rank_z, 0);
    require_possible_sides(tree, thickness, shapes);
    return shapes;
  }

  // Counts leaf by leaf, since the sum of all leaves could wrap.
  void require_enough_parameters(FieldKind kind, const std::vector<field::LeafShape>& shapes,
                                 std::size_t stored) const {
    std::size_t left = stored;
    for (const field::LeafShape& shape : shapes) {
      const std::size_t needed = field::count_parameters(kind, {shape});
      require(needed <= left, "its leaves need more parameters than it holds");
      left -= needed;
    }
  }

  // The index of the leaves' parameters follows from their shapes.
  void require_offsets(const StoredGroup& leaves, const field::Field& field) const {
    Integers offsets(static_cast<std::size_t>(field.tree().num_leaves()) + 1);
    leaves.read_array<std::int64_t>("offset", offsets);
    for (int i = 0; i <= field.tree().num_leaves(); ++i)
      require(offsets[static_cast<std::size_t>(i)] == static_cast<std::int64_t>(field.offset(i)),
              "the index of its parameters is wrong");
  }

  double read_thickness(const StoredGroup& group) const {
    const double thickness = group.number("thickness", {0, base::kLargestNumber});
    require(thickness > 0, "its thickness is no usable number");
    return thickness;
  }

  // Calls what makes the field. Its errors may not name the file yet.
  void make_room(const std::function<void()>& make) const {
    try {
      name_file_in_faults(make);
    } catch (const std::bad_alloc&) {
      throw Error(fmt::format("'{}' holds more parameters than there is memory for", path_));
    }
  }

  void read_decoder(const StoredGroup& group, field::Field& field) const {
    field.bias = static_cast<float>(group.number("bias", base::kLargestNumber));
    // 0: no activation. It divides, so a number just above 0 makes densities infinite.
    constexpr double kSmallestBeta = 1e-6, kLargestBeta = 1e6;
    const double beta = group.number("softplus_beta", {0, kLargestBeta});
    if (beta != 0 && beta < kSmallestBeta)
      fail(fmt::format("its softplus_beta of {:g} is neither 0 nor from {:g} to {:g}", beta,
                       kSmallestBeta, kLargestBeta));
    field.activation.beta = static_cast<float>(beta);
  }

  std::unique_ptr<field::Field> read_field(const StoredGroup& group,
                                           const ChooseLeaves& choose) const {
    std::unique_ptr<field::Field> field;
    std::vector<int> kept;
    const double thickness = read_thickness(group);
    make_room([&] {
      field::Quadtree tree = read_tree(group.group("tree"));
      if (choose) kept = choose(tree);
      auto shapes = read_shapes(group.group("leaves"), tree, thickness);
      const std::string name = group.text("kind");
      const auto kind = base::enum_named<FieldKind>(name);
      if (!kind) fail(fmt::format("there is no field '{}'", name));
      require_enough_parameters(*kind, shapes, group.array_size("parameters"));
      if (!choose) group.require_room("parameters");
      field = field::make_field(*kind, std::move(tree), thickness, std::move(shapes));
    });
    read_decoder(group, *field);
    require_offsets(group.group("leaves"), *field);
    if (choose) {
      field->keep_only(kept);
      require(group.array_size("parameters") == field->num_parameters(),
              "its parameters are not those of its leaves");
      group.read_floats("parameters", KeptCopy(*field, field->parameters()));
    } else {
      group.read_array<float>("parameters", field->parameters());
    }
    require_plausible_parameters(*field, fmt::format("'{}' is a damaged model", path_));
    return field;
  }

  // Codes hold densities themselves, of which nothing else is made.
  void require_densities_in_codes(const StoredGroup& group) const {
    require(group.text("kind") == base::name_of(FieldKind::kVm), "its codes are of no field 'vm'");
    for (const char* name : {"bias", "softplus_beta"})
      require(group.number(name, base::kLargestNumber) == 0.0,
              "it has codes and a bias or a softplus_beta, which codes do not have");
  }

  void read_compact_field(const StoredGroup& group, const ChooseLeaves& choose,
                          std::size_t most_decoded_bytes, Model& model) const {
    std::vector<int> kept;
    require_densities_in_codes(group);
    make_room([&] {
      compact::CodedField coded{read_tree(group.group("tree")), read_thickness(group), {}};
      if (choose) kept = choose(coded.tree);
      coded.codes = read_codes(group, coded.tree, coded.thickness);
      coded.file = path_;
      const std::size_t bytes = compact::decoded_bytes(coded.codes.shapes, base::thread_count());
      require(bytes < compact::kNoMemoryHolds, "its leaves need more numbers than any file holds");
      if (bytes <= most_decoded_bytes) {
        constexpr std::size_t kSmall = std::size_t{1} << 24;
        if (bytes > kSmall)
          base::require_memory(bytes, fmt::format("'{}'", path_).c_str(),
                               "use a machine with more, or another copy");
        model.field = compact::decode_field(coded);
      }
      model.coded = std::move(coded);
    });
    if (!model.field) return;
    if (choose) model.field->keep_only(kept);
    require_plausible_parameters(*model.field, fmt::format("'{}' is a damaged model", path_));
  }

  compact::LeafCodes read_codes(const StoredGroup& field, const field::Quadtree& tree,
                                double thickness) const {
    const StoredGroup group = field.group("code");
    const int num_leaves = tree.num_leaves();
    compact::LeafCodes codes{.step = group.read_array<double>("step"),
                             .face_weight = group.read_array<double>("face_weight"),
                             .shapes = read_shapes(field.group("leaves"), tree, thickness, 1),
                             .offset = group.read_array<std::int64_t>("offset"),
                             .bytes = group.read_array<std::uint8_t>("bytes")};
    require(std::ranges::all_of(codes.shapes, compact::has_possible_ranks),
            "a leaf has more components than vertices");
    const auto num_bands = tree.roots().rows;
    require(
        std::ssize(codes.step) == num_bands &&
            std::ranges::all_of(codes.step, [](double s) { return s == 0 || kSteps.contains(s); }),
        "its steps are no usable numbers");
    require(std::ssize(codes.face_weight) == num_bands &&
                std::ranges::all_of(codes.face_weight, [](double w) { return w >= 0 && w <= 0.5; }),
            "the weights of its faces are no usable numbers");
    require(std::ssize(codes.offset) == num_leaves + 1 && codes.offset.front() == 0 &&
                std::ranges::is_sorted(codes.offset) &&
                codes.offset.back() == std::ssize(codes.bytes),
            "the index of its codes is wrong");
    for (int leaf = 0; leaf < num_leaves; ++leaf)
      require(codes.code(leaf).empty() ||
                  codes.step[static_cast<std::size_t>(tree.band_of_leaf(leaf))] > 0,
              "a band of leaves with codes has a step of 0");
    return codes;
  }

  template <typename T>
  static std::map<std::string, std::vector<T>> read_arrays(const StoredGroup& group) {
    std::map<std::string, std::vector<T>> arrays;
    for (const std::string& name : group.names()) arrays[name] = group.read_array<T>(name);
    return arrays;
  }

  std::string path_;
  io::Hdf5Reader file_;
};

}  // namespace

Model load_model(const std::filesystem::path& path, TrainingState* training) {
  return ModelReader(path).read(training, {});
}

Model load_undecoded(const std::filesystem::path& path, TrainingState* training) {
  return ModelReader(path).read(training, {}, /*most_decoded_bytes=*/0);
}

Model load_decoded_up_to(const std::filesystem::path& path, std::size_t most_bytes) {
  return ModelReader(path).read(nullptr, {}, most_bytes);
}

ModelOutline load_outline(const std::filesystem::path& path) {
  return ModelReader(path).read_outline();
}

Model load_part(const std::filesystem::path& path, const ChooseLeaves& choose) {
  return ModelReader(path).read(nullptr, choose);
}

TrainingState load_training(const std::filesystem::path& path) {
  return ModelReader(path).read_training(/*with_floats=*/false);
}

void load_floats(const std::filesystem::path& path, const std::string& name,
                 const field::Field& field, std::span<float> values) {
  ModelReader(path).read_floats(name, field, values);
}

ModelInfo model_info(const measurement::Measurement& series, Contrast contrast) {
  ModelInfo info;
  info.geometry = series.geometry;
  info.roi = series.roi;
  info.x_tilt_deg = series.x_tilt_deg;
  info.pixel_size_A = series.pixel_size_A;
  info.density_unit = series.unit;
  info.is_dark = contrast == Contrast::kDark;
  return info;
}

}  // namespace tomofield::output
