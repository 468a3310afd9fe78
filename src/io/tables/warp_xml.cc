#include <fmt/format.h>
#include <strings.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <pugixml.hpp>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/tables/text_lines.h"
#include "io/tables/unknown_entries.h"
#include "io/tables/view_table.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

// Finds an attribute that comes twice in its element. The parser would take the first one.
struct TwiceStated : pugi::xml_tree_walker {
  std::string attribute;  // empty: none

  bool for_each(pugi::xml_node& node) override {
    std::set<std::string_view> names;
    for (const pugi::xml_attribute& found : node.attributes())
      if (!names.insert(found.name()).second)
        attribute = fmt::format("{} of <{}>", found.name(), node.name());
    return attribute.empty();
  }
};

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
    TwiceStated twice;
    document_.traverse(twice);
    if (!twice.attribute.empty()) fail_twice(twice.attribute);
    root_ = document_.child("TiltSeries");
    if (root_.next_sibling("TiltSeries")) fail_twice("<TiltSeries>");
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
    const std::string_view text = child(element).text().get();
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

  // Tells whether the images are stretched: MagnificationCorrection is a matrix "1, 0, 0, 1".
  bool is_stretched() const {
    const std::vector<double> matrix = list("MagnificationCorrection", base::kLargestNumber);
    return !matrix.empty() && matrix != std::vector<double>{1, 0, 0, 1};
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
    const std::vector<double> sizes_A = list(name, base::kLargestPosition_px);
    if (sizes_A.empty()) return std::nullopt;
    const auto is_unknown = [](double size_A) { return size_A == 0.0; };
    if (sizes_A.size() == count && std::ranges::all_of(sizes_A, is_unknown)) return std::nullopt;
    if (sizes_A.size() == count && std::ranges::min(sizes_A) > 0.0) return sizes_A;
    throw Error(
        fmt::format("'{}': '{}' in {} are not {} sizes above 0 Å: correct them, or remove "
                    "the attribute",
                    path_.string(), quote(root_.attribute(name).value()), name, count));
  }

  // Holds what a grid says of the views: the mean of each, and the largest distance of a node from
  // it.
  struct ValuesOfViews {
    std::vector<double> means;
    double largest_rest = 0.0;
  };

  // Returns the values of a grid, whose outer nodes lie on the edges of the views. Nothing if it
  // has some other number of views. Zeros if there is no such grid.
  std::optional<ValuesOfViews> values_of_grid(const char* name, std::size_t num_views) const {
    if (is_all(name, 0.0)) return ValuesOfViews{std::vector<double>(num_views, 0.0)};
    const Grid grid = read_grid(name);
    const std::size_t depth = grid.depth;
    if (depth != 1 && depth != num_views) return std::nullopt;
    std::vector<double> sums(depth), weights(depth);
    for (const GridNode& node : grid.nodes) {
      sums[node.layer] += node.weight * node.value;
      weights[node.layer] += node.weight;
    }
    ValuesOfViews found;
    for (std::size_t view = 0; view < num_views; ++view) {
      const std::size_t layer = depth == 1 ? 0 : view;
      found.means.push_back(sums[layer] / weights[layer]);
    }
    for (const GridNode& node : grid.nodes)
      found.largest_rest = std::max(found.largest_rest,
                                    std::fabs(node.value - sums[node.layer] / weights[node.layer]));
    return found;
  }

  // Returns a parameter of the element CTF.
  std::optional<double> ctf_parameter(const char* name) const {
    const auto is_named = [&](const pugi::xml_node& param) {
      return std::string_view(param.attribute("Name").value()) == name;
    };
    const auto params = child("CTF").children("Param");
    const auto found = std::find_if(params.begin(), params.end(), is_named);
    if (found == params.end()) return std::nullopt;
    if (std::find_if(std::next(found), params.end(), is_named) != params.end())
      fail_twice(fmt::format("the parameter {} of <CTF>", name));
    return parse(name, found->attribute("Value").value(), 1e6);
  }

  // Tells whether a parameter of the element CTF is a list of numbers that are not all 0.
  bool is_ctf_list_set(std::string_view name) const {
    for (const pugi::xml_node param : child("CTF").children("Param"))
      if (param.attribute("Name").value() == name)
        return std::string_view(param.attribute("Value").value()).find_first_of("123456789") !=
               std::string_view::npos;
    return false;
  }

  // Returns true if all nodes of a grid have one value, or if there is no such grid.
  bool is_all(const char* grid, double value) const {
    return std::ranges::all_of(child(grid).children("Node"), [&](const pugi::xml_node& node) {
      const auto found = parse_number(trim(node.attribute("Value").value()));
      return found && *found == value;
    });
  }

  // Returns the names of all grids.
  std::set<std::string> grids() const {
    std::set<std::string> names;
    for (const pugi::xml_node node : root_.children())
      if (const std::string name = node.name(); name.starts_with("Grid")) names.insert(name);
    return names;
  }

  // Tells whether the user took the series out of Warp's selection.
  bool is_unselected() const {
    const std::string_view flag = root_.attribute("UnselectManual").value();
    return !flag.empty() && flag != "null" && parse_flag(flag, "UnselectManual");
  }

  // Returns the attributes of the series and its elements but grids that nothing here knows.
  std::vector<std::string> unknown_entries() const {
    std::vector<std::string> unknown;
    for (const pugi::xml_attribute& attribute : root_.attributes())
      if (!is_known(kKnownAttributes, attribute.name()) && is_not_zero(attribute.value()))
        unknown.emplace_back(attribute.name());
    for (const pugi::xml_node& node : root_.children()) {
      const std::string_view name = node.name();
      if (name.empty() || name.starts_with("Grid") || name.starts_with("Options")) continue;
      if (!is_known(kKnownElements, name)) unknown.push_back(fmt::format("<{}>", name));
    }
    std::ranges::sort(unknown);
    unknown.erase(std::unique(unknown.begin(), unknown.end()), unknown.end());
    return unknown;
  }

 private:
  // These are read, or hold what Warp keeps of its own fits and choices (TiltSeries.cs, SaveMeta).
  static constexpr std::array<std::string_view, 13> kKnownAttributes{"AreAnglesInverted",
                                                                     "LevelAngleX",
                                                                     "LevelAngleY",
                                                                     "MagnificationCorrection",
                                                                     "VolumeDimensionsAngstrom",
                                                                     "ImageDimensionsAngstrom",
                                                                     "UnselectManual",
                                                                     "UnselectFilter",
                                                                     "DataDirectory",
                                                                     "PlaneNormal",
                                                                     "Bfactor",
                                                                     "Weight",
                                                                     "CTFResolutionEstimate"};
  static constexpr std::array<std::string_view, 14> kKnownElements{"Angles",
                                                                   "Dose",
                                                                   "UseTilt",
                                                                   "AxisAngle",
                                                                   "AxisOffsetX",
                                                                   "AxisOffsetY",
                                                                   "CTF",
                                                                   "FOVFraction",
                                                                   "MoviePath",
                                                                   "TiltPS1D",
                                                                   "PS1D",
                                                                   "TiltSimulatedScale",
                                                                   "SimulatedScale",
                                                                   "SimulatedBackground"};

  static bool is_known(std::span<const std::string_view> known, std::string_view name) {
    return std::ranges::find(known, name) != known.end();
  }

  // A node of a grid: its layer, its value, and its share in the mean of the layer.
  struct GridNode {
    std::size_t layer;
    double value, weight;
  };
  struct Grid {
    std::size_t depth;
    std::vector<GridNode> nodes;
  };

  // Returns the numbers "x, y, z" of an attribute; none if it is not there, or empty.
  std::vector<double> list(const char* name, double largest) const {
    std::string_view text = root_.attribute(name).value();
    if (trim(text).empty()) return {};
    std::vector<double> numbers;
    for (bool is_last = false; !is_last;) {
      const std::size_t comma = std::min(text.find(','), text.size());
      numbers.push_back(parse(name, text.substr(0, comma), largest));
      is_last = comma == text.size();
      text.remove_prefix(std::min(comma + 1, text.size()));
    }
    return numbers;
  }

  [[noreturn]] void fail_twice(const std::string& what) const {
    throw Error(fmt::format("'{}': {} comes twice: leave one out", path_.string(), what));
  }

  // Returns an element of the series, which may not be there.
  pugi::xml_node child(const char* name) const {
    const pugi::xml_node found = root_.child(name);
    if (found.next_sibling(name)) fail_twice(fmt::format("<{}>", name));
    return found;
  }

  // Returns the number of a grid's nodes along a side. A side that is not stated has one.
  std::int64_t side_of(const pugi::xml_node& grid, const char* side, std::int64_t unstated) const {
    const std::string_view text = grid.attribute(side).value();
    if (text.empty()) return unstated;
    const auto count = parse_integer(text);
    if (count && *count >= 1 && *count <= kMostNodes) return *count;
    throw Error(fmt::format("'{}': {}=\"{}\" of {} is not a number of nodes: correct it",
                            path_.string(), side, quote(text), grid.name()));
  }

  // Reads a grid, each of whose places has one node.
  Grid read_grid(const char* name) const {
    const pugi::xml_node grid = child(name);
    const auto nodes = grid.children("Node");
    const std::int64_t num_nodes = std::distance(nodes.begin(), nodes.end());
    const std::int64_t width = side_of(grid, "Width", 1), height = side_of(grid, "Height", 1);
    const std::int64_t depth =
        side_of(grid, "Depth", std::max<std::int64_t>(1, num_nodes / (width * height)));
    std::set<std::array<std::int64_t, 3>> places;
    Grid found{.depth = static_cast<std::size_t>(depth), .nodes = {}};
    for (const pugi::xml_node node : nodes) {
      const auto place = [&](const char* axis, std::int64_t count) {
        const std::string_view text = node.attribute(axis).value();
        const auto index = text.empty() ? std::optional<std::int64_t>(0) : parse_integer(text);
        if (index && *index >= 0 && *index < count) return *index;
        throw Error(fmt::format("'{}': a node of {} has {}=\"{}\", and there are {}",
                                path_.string(), name, axis, quote(text), count));
      };
      const std::int64_t x = place("X", width), y = place("Y", height), z = place("Z", depth);
      if (!places.insert({x, y, z}).second)
        fail_twice(fmt::format("the node X={} Y={} Z={} of {}", x, y, z, name));
      const double value = parse(name, node.attribute("Value").value(), base::kLargestPosition_px);
      found.nodes.push_back({static_cast<std::size_t>(z), value,
                             weight_of_node(x, width) * weight_of_node(y, height)});
    }
    if (num_nodes == width * height * depth) return found;
    throw Error(fmt::format("'{}': {} has {} nodes, and {} × {} × {} are stated: correct it",
                            path_.string(), name, num_nodes, width, height, depth));
  }

  // Returns the share of a node in the mean along a side: outer nodes count half.
  static double weight_of_node(std::int64_t index, std::int64_t count) {
    return count > 1 && (index == 0 || index == count - 1) ? 0.5 : 1.0;
  }

  double parse(const char* name, std::string_view text, double largest) const {
    if (const auto value = parse_number(trim(text), largest)) return *value;
    throw Error(fmt::format("'{}': '{}' in {} is not a number from -{} to {}", path_.string(),
                            quote(text), name, largest, largest));
  }

  static constexpr std::int64_t kMostNodes = 100000;  // along a side
  std::filesystem::path path_;
  pugi::xml_document document_;
  pugi::xml_node root_;
};

// Reads a grid that is to give one value to each of some views. Notes what is left out if it varies
// within views. Returns nothing, with a note, if it has some other number of views.
std::optional<std::vector<double>> means_of_grid(const WarpXml& xml, const char* name,
                                                 std::string_view unit, std::size_t num_views,
                                                 std::vector<std::string>& not_applied) {
  const auto found = xml.values_of_grid(name, num_views);
  if (!found) {
    not_applied.push_back(fmt::format("{} of some other number of views than {}", name, num_views));
    return std::nullopt;
  }
  if (found->largest_rest > 0.0)
    not_applied.push_back(
        fmt::format("differences of {} from its mean in a view, by up to {:.3g}{}", name,
                    found->largest_rest, unit));
  return found->means;
}

// Subtracts the shifts that Warp refined beside the offsets of the axis, as Warp does: the mean of
// each view.
void apply_movements(const WarpXml& xml, ViewTable& table) {
  const auto means = [&](const char* name) {
    return means_of_grid(xml, name, " Å", table.views.size(), table.not_applied);
  };
  const auto along_x = means("GridMovementX"), along_y = means("GridMovementY");
  if (!along_x || !along_y) return;
  for (std::size_t i = 0; i < table.views.size(); ++i) {
    table.views[i].shift_x_A -= (*along_x)[i];
    table.views[i].shift_y_A -= (*along_y)[i];
  }
}

// Sets the defocus of the views, as Warp's ts_ctf found it: the mean of both directions in µm,
// their difference, the direction of the first, and the phase shift in units of π (CTF.cs). The
// grid of the mean is zero before ts_ctf ran.
void set_defocus(const WarpXml& xml, ViewTable& table) {
  constexpr double kAngstroms_in_um = 1e4, kHalfTurn_deg = 180.0;
  if (xml.is_all("GridCTF", 0.0)) return;
  const auto means = [&](const char* name, std::string_view unit) {
    return means_of_grid(xml, name, unit, table.views.size(), table.ctf_not_applied);
  };
  const auto means_um = means("GridCTF", " µm"), phases = means("GridCTFPhase", " π");
  const auto differences_um = means("GridCTFDefocusDelta", " µm");
  const auto angles_deg = means("GridCTFDefocusAngle", "°");
  if (!means_um || !differences_um || !angles_deg || !phases) return;
  for (std::size_t i = 0; i < table.views.size(); ++i) {
    for (const double angle_deg : {(*angles_deg)[i], kHalfTurn_deg * (*phases)[i]})
      if (!base::is_plausible(angle_deg, base::kLargestAngle_deg))
        throw Error(
            fmt::format("'{}': the direction of the defocus (in degrees) or the phase shift "
                        "(in units of π) of view {} stands for {:g}°: correct it",
                        table.file.string(), i + 1, angle_deg));
    table.views[i].defocus = {kAngstroms_in_um * ((*means_um)[i] + (*differences_um)[i] / 2),
                              kAngstroms_in_um * ((*means_um)[i] - (*differences_um)[i] / 2),
                              (*angles_deg)[i], kHalfTurn_deg * (*phases)[i]};
  }
}

// Notes the grids that are not read. Weights are 1 and all others 0 where nothing was refined.
void note_other_grids(const WarpXml& xml, ViewTable& table) {
  constexpr std::array<std::string_view, 6> kRead{
      "GridMovementX",       "GridMovementY",       "GridCTF",
      "GridCTFDefocusDelta", "GridCTFDefocusAngle", "GridCTFPhase"};
  for (const std::string& grid : xml.grids()) {
    if (std::ranges::find(kRead, grid) != kRead.end()) continue;
    if (xml.is_all(grid.c_str(), grid.ends_with("Weights") ? 1.0 : 0.0)) continue;
    const bool is_warp = grid.starts_with("GridVolumeWarp");
    table.not_applied.emplace_back(grid + (is_warp ? ", a deformation of the specimen" : ""));
  }
}

// The size of pixels is that of the images. One that is stated here must be possible, and square.
void check_pixels(const WarpXml& xml, ViewTable& table) {
  const auto size_A = xml.ctf_parameter("PixelSize");
  if (size_A && !base::is_plausible_pixel_size(*size_A))
    throw Error(
        fmt::format("'{}': a PixelSize of {} Å is none: correct it", table.file.string(), *size_A));
  table.optics.pixel_size_A = size_A;
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
  if (const auto sizes_A = xml.dimensions_A("ImageDimensionsAngstrom", 2))
    table.image_size_A = {sizes_A->front(), sizes_A->back()};
  apply_movements(xml, table);
  set_defocus(xml, table);
  table.optics = {xml.ctf_parameter("Voltage"), xml.ctf_parameter("Cs"),
                  xml.ctf_parameter("Amplitude")};
  table.defocus_hand = xml.defocus_hand();
  check_pixels(xml, table);
  note_other_grids(xml, table);
  for (const char* name : {"BeamTilt", "BeamTilt2", "ZernikeCoeffsOdd", "ZernikeCoeffsEven"})
    if (has_defocus(table) && xml.is_ctf_list_set(name))
      table.ctf_not_applied.emplace_back(fmt::format("aberrations beside the defocus ({})", name));
  if (xml.is_stretched())
    table.not_applied.emplace_back("a MagnificationCorrection, which stretches the images");
  if (xml.is_unselected())
    table.remarks.emplace_back("the series is not selected in Warp (UnselectManual)");
  if (const auto remark = remark_on_unknown(xml.unknown_entries()))
    table.remarks.push_back(*remark);
  return table;
}

}  // namespace tomofield::io
