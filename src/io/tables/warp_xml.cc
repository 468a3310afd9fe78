#include <fmt/format.h>
#include <strings.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <pugixml.hpp>
#include <string>
#include <utility>
#include <vector>

#include "io/tables/text_lines.h"
#include "io/tables/view_table.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

// Warp's XML file of a tilt series. Elements hold one value a line, one line a view.
class WarpXml {
 public:
  explicit WarpXml(const std::filesystem::path& path) : path_(path) {
    const std::string bytes = read_small_file(path);  // may be UTF-16
    const pugi::xml_parse_result result = document_.load_buffer(bytes.data(), bytes.size());
    if (!result) {
      throw Error(fmt::format("'{}' is no XML file, or a damaged one: {} at byte {}", path.string(),
                              result.description(), result.offset));
    }
    root_ = document_.child("TiltSeries");
    if (!root_ || !root_.child("Angles")) {
      throw Error(
          fmt::format("'{}' has no <TiltSeries> with <Angles>, so it is no tilt series of "
                      "Warp (frame series have XML files too)",
                      path.string()));
    }
  }

  // Returns the lines of an element, or none if there is no such element.
  std::vector<std::string> lines(const char* element) const {
    std::vector<std::string> found;
    const std::string_view text = root_.child(element).text().get();
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t end = std::min(text.find('\n', at), text.size());
      const std::string_view line = trim(text.substr(at, end - at));
      if (!line.empty()) found.emplace_back(line);
      at = end + 1;
    }
    return found;
  }

  // Returns one number a view: zeros if there is no such element.
  std::vector<double> numbers(const char* element, std::size_t num_views, double largest) const {
    const std::vector<std::string> text = lines(element);
    if (text.empty()) return std::vector<double>(num_views, 0.0);
    require_count(element, text.size(), num_views);
    std::vector<double> values;
    for (const std::string& line : text) values.push_back(parse(element, line, largest));
    return values;
  }

  void require_count(const char* element, std::size_t count, std::size_t num_views) const {
    if (count == num_views) return;
    throw Error(fmt::format("'{}': <{}> has {} values but <Angles> has {}", path_.string(), element,
                            count, num_views));
  }

  // Parses a flag, in upper or lower case.
  bool parse_flag(std::string_view text, std::string_view what) const {
    const std::string word(text);
    const bool is_true = strcasecmp(word.c_str(), "true") == 0;
    if (is_true || strcasecmp(word.c_str(), "false") == 0) return is_true;
    throw Error(fmt::format("'{}': '{}' in {} is neither True nor False: correct it",
                            path_.string(), quote(text), what));
  }

  // Returns an attribute of the series, or 0.
  double attribute(const char* name) const {
    const char* const text = root_.attribute(name).value();
    return *text == '\0' ? 0.0 : parse(name, text, base::kLargestAngle_deg);
  }

  // Returns the hand of the defocus. Warp adds the height z = X sin(angle) of a point to the
  // defocus, or −X sin(angle) if AreAnglesInverted is set (TiltSeries.cs, GetPositionInAllTilts).
  // Its angles are minus those of a view table.
  std::optional<int> defocus_hand() const {
    const std::string_view inverted = root_.attribute("AreAnglesInverted").value();
    if (inverted.empty()) return std::nullopt;
    return parse_flag(inverted, "AreAnglesInverted") ? 1 : -1;
  }

  // Returns the sizes "x, y, z" in an attribute. Nothing if it is not there, as in older versions,
  // or if all are 0, as before anything was reconstructed.
  std::optional<std::vector<double>> dimensions_A(const char* name, std::size_t count) const {
    std::string_view text = root_.attribute(name).value();
    if (trim(text).empty()) return std::nullopt;
    std::vector<double> sizes_A;
    for (bool is_last = false; !is_last;) {
      const std::size_t comma = std::min(text.find(','), text.size());
      sizes_A.push_back(parse(name, text.substr(0, comma), base::kLargestPosition_px));
      is_last = comma == text.size();
      text.remove_prefix(std::min(comma + 1, text.size()));
    }
    const auto is_unknown = [](double size_A) { return size_A == 0.0; };
    if (sizes_A.size() == count && std::ranges::all_of(sizes_A, is_unknown)) return std::nullopt;
    if (sizes_A.size() == count && std::ranges::min(sizes_A) > 0.0) return sizes_A;
    throw Error(
        fmt::format("'{}': '{}' in {} are not {} sizes above 0 Å: correct them, or remove "
                    "the attribute",
                    path_.string(), quote(root_.attribute(name).value()), name, count));
  }

  // The movements along an axis: the mean of each view, and the largest distance of a node from it.
  struct Movements {
    std::vector<double> means;
    double largest_rest = 0.0;
  };

  // Returns the movements of a grid, whose outer nodes lie on the edges of the views. Nothing if it
  // has some other number of views.
  std::optional<Movements> movements_of_grid(const char* name, std::size_t num_views) const {
    if (is_zero(name)) return Movements{std::vector<double>(num_views, 0.0)};
    const auto depth =
        static_cast<std::size_t>(std::max(root_.child(name).attribute("Depth").as_int(1), 0));
    if (depth != 1 && depth != num_views) return std::nullopt;
    const std::vector<GridNode> nodes = nodes_of_grid(name);
    std::vector<double> sums(depth), weights(depth);
    for (const GridNode& node : nodes) {
      sums[node.layer] += node.weight * node.value;
      weights[node.layer] += node.weight;
    }
    if (std::ranges::any_of(weights, [](double weight) { return !(weight > 0.0); }))
      return std::nullopt;
    Movements found;
    for (std::size_t view = 0; view < num_views; ++view) {
      const std::size_t layer = depth == 1 ? 0 : view;
      found.means.push_back(sums[layer] / weights[layer]);
    }
    for (const GridNode& node : nodes)
      found.largest_rest = std::max(found.largest_rest,
                                    std::fabs(node.value - sums[node.layer] / weights[node.layer]));
    return found;
  }

  // Returns a value of each view from a grid. Nothing if there is no such grid, or if it varies
  // within a view or has some other number of views.
  std::optional<std::vector<double>> values_of_grid(const char* name, std::size_t num_views) const {
    const pugi::xml_node grid = root_.child(name);
    const auto nodes = static_cast<std::size_t>(
        std::distance(grid.children("Node").begin(), grid.children("Node").end()));
    const bool is_rigid = grid.attribute("Width").as_int(1) == 1 &&
                          grid.attribute("Height").as_int(1) == 1 &&
                          (nodes == 1 || nodes == num_views);
    if (!is_rigid) return std::nullopt;
    std::vector<double> values(num_views);
    for (const pugi::xml_node node : grid.children("Node")) {
      const double value = parse(name, node.attribute("Value").value(), base::kLargestPosition_px);
      if (nodes == 1) return std::vector<double>(num_views, value);
      const auto view = parse_integer(node.attribute("Z").value());
      if (!view || *view < 0 || static_cast<std::size_t>(*view) >= num_views) return std::nullopt;
      values[static_cast<std::size_t>(*view)] = value;
    }
    return values;
  }

  // Returns a parameter of the element CTF.
  std::optional<double> ctf_parameter(const char* name) const {
    const pugi::xml_node found = root_.child("CTF").find_child_by_attribute("Param", "Name", name);
    return found ? std::optional(parse(name, found.attribute("Value").value(), 1e6)) : std::nullopt;
  }

  bool is_zero(const char* grid) const { return is_zero_grid(root_.child(grid)); }

 private:
  // A node of a grid: its layer, its value, and its share in the mean of the layer.
  struct GridNode {
    std::size_t layer;
    double value, weight;
  };

  std::vector<GridNode> nodes_of_grid(const char* name) const {
    const pugi::xml_node grid = root_.child(name);
    std::vector<GridNode> nodes;
    for (const pugi::xml_node node : grid.children("Node")) {
      const auto place = [&](const char* axis, const char* side) {
        const int count = grid.attribute(side).as_int(1);
        const auto index = parse_integer(node.attribute(axis).value()).value_or(0);
        if (index >= 0 && index < count) return std::pair{static_cast<int>(index), count};
        throw Error(fmt::format("'{}': a node of {} has {} {}, and there are {}", path_.string(),
                                name, axis, index, count));
      };
      const double value = parse(name, node.attribute("Value").value(), base::kLargestPosition_px);
      nodes.push_back({static_cast<std::size_t>(place("Z", "Depth").first), value,
                       weight_of_node(place("X", "Width")) * weight_of_node(place("Y", "Height"))});
    }
    return nodes;
  }

  // Returns the share of a node in the mean along a side: outer nodes count half.
  static double weight_of_node(const std::pair<int, int>& place) {
    const auto [index, count] = place;
    return count > 1 && (index == 0 || index == count - 1) ? 0.5 : 1.0;
  }

  double parse(const char* name, std::string_view text, double largest) const {
    if (const auto value = parse_number(trim(text), largest)) return *value;
    throw Error(fmt::format("'{}': '{}' in {} is not a number from -{} to {}", path_.string(),
                            quote(text), name, largest, largest));
  }
  static bool is_zero_grid(const pugi::xml_node& grid) {
    for (const pugi::xml_node node : grid.children("Node")) {
      const auto value = parse_number(trim(node.attribute("Value").value()));
      if (!value || *value != 0.0) return false;
    }
    return true;
  }

  std::filesystem::path path_;
  pugi::xml_document document_;
  pugi::xml_node root_;
};

// Subtracts the shifts that Warp refined beside the offsets of the axis, as Warp does: the mean of
// each view.
void apply_movements(const WarpXml& xml, ViewTable& table) {
  const auto along_x = xml.movements_of_grid("GridMovementX", table.views.size());
  const auto along_y = xml.movements_of_grid("GridMovementY", table.views.size());
  if (!along_x || !along_y) {
    table.not_applied.emplace_back(
        fmt::format("GridMovementX and GridMovementY are not applied: they are not of {} views",
                    table.views.size()));
    return;
  }
  for (std::size_t i = 0; i < table.views.size(); ++i) {
    table.views[i].shift_x_A -= along_x->means[i];
    table.views[i].shift_y_A -= along_y->means[i];
  }
  const double rest_A = std::max(along_x->largest_rest, along_y->largest_rest);
  if (rest_A > 0.0) {
    table.not_applied.emplace_back(
        fmt::format("of GridMovementX and GridMovementY the mean of each view is applied; what "
                    "varies within the views, by up to {:.3g} Å, is not",
                    rest_A));
  }
}

// Sets the defocus of the views, as Warp's ts_ctf found it: the mean of both directions in µm,
// their difference, the direction of the first, and the phase shift in units of π (CTF.cs). The
// grid of the mean is zero before ts_ctf ran.
void set_defocus(const WarpXml& xml, ViewTable& table) {
  constexpr double kAngstroms_in_um = 1e4, kHalfTurn_deg = 180.0;
  const std::size_t num_views = table.views.size();
  const auto means_um = xml.values_of_grid("GridCTF", num_views);
  if (!means_um || xml.is_zero("GridCTF")) return;
  const std::vector<double> zeros(num_views);
  const auto differences_um = xml.values_of_grid("GridCTFDefocusDelta", num_views).value_or(zeros);
  const auto angles_deg = xml.values_of_grid("GridCTFDefocusAngle", num_views).value_or(zeros);
  const auto phases = xml.values_of_grid("GridCTFPhase", num_views).value_or(zeros);
  for (std::size_t i = 0; i < num_views; ++i) {
    table.views[i].defocus = {kAngstroms_in_um * ((*means_um)[i] + differences_um[i] / 2),
                              kAngstroms_in_um * ((*means_um)[i] - differences_um[i] / 2),
                              angles_deg[i], kHalfTurn_deg * phases[i]};
  }
}

// The size of pixels is that of the images. One that is stated here must be possible, and square.
void check_pixels(const WarpXml& xml, ViewTable& table) {
  const auto size_A = xml.ctf_parameter("PixelSize");
  if (size_A && !base::is_plausible_pixel_size(*size_A))
    throw Error(
        fmt::format("'{}': a PixelSize of {} Å is none: correct it", table.file.string(), *size_A));
  for (const char* name : {"PixelSizeDelta", "PixelSizeDeltaPercent"})
    if (xml.ctf_parameter(name).value_or(0.0) != 0.0)
      table.not_applied.emplace_back(fmt::format("{}, pixels that are not square", name));
}

}  // namespace

// The geometry is that of read_warp_tomostar(). LevelAngleX turns the specimen about x before it is
// tilted, LevelAngleY adds to the angles.
ViewTable read_warp_xml(const std::filesystem::path& path) {
  const WarpXml xml(path);
  const std::size_t num_views = xml.lines("Angles").size();
  const auto angles = xml.numbers("Angles", num_views, base::kLargestAngle_deg);
  const auto axes = xml.numbers("AxisAngle", num_views, base::kLargestAngle_deg);
  const auto offsets_x = xml.numbers("AxisOffsetX", num_views, base::kLargestPosition_px);
  const auto offsets_y = xml.numbers("AxisOffsetY", num_views, base::kLargestPosition_px);
  const auto doses = xml.numbers("Dose", num_views, kLargestDose);
  const auto movies = xml.lines("MoviePath");
  const auto flags = xml.lines("UseTilt");
  xml.require_count("MoviePath", movies.size(), num_views);
  if (!flags.empty()) xml.require_count("UseTilt", flags.size(), num_views);

  ViewTable table{path, CentreRule::kHalfSize, true, {}, {}, {}};
  const double level_x_deg = xml.attribute("LevelAngleX");
  const double level_y_deg = xml.attribute("LevelAngleY");
  for (std::size_t i = 0; i < num_views; ++i) {
    ListedView view;
    view.image = movies[i];
    view.is_used =
        flags.empty() || xml.parse_flag(flags[i], fmt::format("<UseTilt> of view {}", i + 1));
    view.tilt_deg = -(angles[i] + level_y_deg);
    view.x_tilt_deg = level_x_deg;
    view.rotation_deg = axes[i];
    view.shift_x_A = offsets_x[i];
    view.shift_y_A = offsets_y[i];
    if (doses[i] < 0.0)
      throw Error(
          fmt::format("'{}': the dose {} of view {} is negative", path.string(), doses[i], i + 1));
    view.dose_before = doses[i];
    table.views.push_back(std::move(view));
  }
  if (const auto sizes_A = xml.dimensions_A("VolumeDimensionsAngstrom", 3))
    table.thickness_A = sizes_A->back();
  xml.dimensions_A("ImageDimensionsAngstrom", 2);  // throws Error for sizes that cannot be
  apply_movements(xml, table);
  set_defocus(xml, table);
  table.optics = {xml.ctf_parameter("Voltage"), xml.ctf_parameter("Cs"),
                  xml.ctf_parameter("Amplitude")};
  table.defocus_hand = xml.defocus_hand();
  check_pixels(xml, table);
  for (const char* grid : {"GridVolumeWarpX", "GridVolumeWarpY", "GridVolumeWarpZ"})
    if (!xml.is_zero(grid))
      table.not_applied.emplace_back(fmt::format("{}, a deformation of the specimen", grid));
  return table;
}

}  // namespace tomofield::io
