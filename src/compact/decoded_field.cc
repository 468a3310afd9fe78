#include "compact/decoded_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/check.h"
#include "base/plausible.h"
#include "base/threads/parallel.h"
#include "compact/leaf_code.h"
#include "compact/quantise.h"
#include "tomofield/error.h"

namespace tomofield::compact {
namespace {

using field::Field;
using field::LeafShape;

// Names the two vertices of an axis around a position, and the weight of the upper one. Positions
// beyond the last of n vertices are moved to it.
struct Taps {
  int lower, upper;
  float fraction;
  Taps(double vertex, int n) {
    const double clamped = std::clamp(vertex, 0.0, static_cast<double>(n - 1));
    lower = static_cast<int>(clamped);
    upper = std::min(lower + 1, n - 1);
    fraction = static_cast<float>(clamped - lower);
  }
};

float between(float low, float high, float fraction) { return low + fraction * (high - low); }

// Returns the position of a leaf's vertex in the plane.
std::array<double, 2> position(const Field& field, const std::vector<LeafShape>& shapes, int leaf,
                               int i, int j) {
  const LeafShape& own = shapes[static_cast<std::size_t>(leaf)];
  const field::Square& square = field.tree().leaf(leaf).square;
  const auto size = static_cast<double>(square.size);
  return {static_cast<double>(square.x0) + size * i / own.nx + field::kPixelCentre,
          static_cast<double>(square.y0) + size * j / own.ny + field::kPixelCentre};
}

// Returns the index of a vertex among all parameters.
std::size_t vertex(const Field& field, int leaf, int i, int k, int j) {
  const LeafShape& s = field.shape(leaf);
  return field.offset(leaf) + (static_cast<std::size_t>(i) * s.nz + k) * s.ny + j;
}

// Two neighbouring columns of vertices of different leaves.
struct Neighbours {
  int leaf, i, j, other, other_i, other_j;
};

// Calls body(Neighbours) for the columns on both sides of the upper face of a leaf along x or y.
// Columns of other spacing than the leaf's are left out, and so are those of leaves one vertex
// wide.
template <typename Body>
void for_each_neighbours(const Field& field, const std::vector<LeafShape>& shapes, int leaf,
                         bool along_x, const Body& body) {
  const LeafShape& own = shapes[static_cast<std::size_t>(leaf)];
  if (own.nx < 2 || own.ny < 2) return;
  const std::int64_t size = field.tree().leaf(leaf).square.size;
  for (int n = 0; n < (along_x ? own.ny : own.nx); ++n) {
    const auto [x, y] = position(field, shapes, leaf, along_x ? own.nx : n, along_x ? n : own.ny);
    const int other = field.tree().find_leaf(x, y);
    if (other < 0) continue;
    const LeafShape& s = shapes[static_cast<std::size_t>(other)];
    const std::int64_t other_size = field.tree().leaf(other).square.size;
    const bool is_alike = s.nx > 1 && s.ny > 1 && s.nz == own.nz &&
                          s.nx * size == own.nx * other_size && s.ny * size == own.ny * other_size;
    if (!is_alike) continue;
    body(Neighbours{.leaf = leaf,
                    .i = along_x ? own.nx - 1 : n,
                    .j = along_x ? n : own.ny - 1,
                    .other = other,
                    .other_i = static_cast<int>(std::lround(field.vertex_x(other, x))),
                    .other_j = static_cast<int>(std::lround(field.vertex_y(other, y)))});
  }
}

// Moves the vertices on both sides of faces towards each other. A leaf changes its own last columns
// and the first ones of its neighbours, which no other leaf changes along the same axis.
void soften_faces(Field& field, const LeafCodes& codes) {
  if (std::ranges::all_of(codes.face_weight, [](double weight) { return weight == 0; })) return;
  const auto weight_of = [&](int leaf) {
    return codes.face_weight[static_cast<std::size_t>(field.tree().band_of_leaf(leaf))];
  };
  for (const bool along_x : {true, false}) {
    base::parallel_for("soften faces", std::ssize(codes.shapes), [&](std::int64_t leaf) {
      for_each_neighbours(
          field, codes.shapes, static_cast<int>(leaf), along_x, [&](const Neighbours& at) {
            const auto weight = static_cast<float>((weight_of(at.leaf) + weight_of(at.other)) / 2);
            for (int k = 0; k < field.shape(at.leaf).nz; ++k) {
              float& a = field.parameters()[vertex(field, at.leaf, at.i, k, at.j)];
              float& b = field.parameters()[vertex(field, at.other, at.other_i, k, at.other_j)];
              const float move = weight * (b - a);
              a += move;
              b -= move;
            }
          });
    });
  }
}

// Fills the upper faces of leaves whose other vertices are known.
class UpperFaces {
 public:
  UpperFaces(Field& field, const std::vector<LeafShape>& shapes) : field_(field), shapes_(shapes) {}

  void fill(int leaf) const {
    const LeafShape& own = shapes_[static_cast<std::size_t>(leaf)];
    if (own == kNoLeaf) return;
    for (int i = 0; i <= own.nx; ++i) {
      for (int j = i == own.nx ? 0 : own.ny; j <= own.ny; ++j) fill_column(leaf, i, j);
    }
  }

 private:
  // Fills the vertices above a point of the plane.
  void fill_column(int leaf, int i, int j) const {
    const LeafShape& own = shapes_[static_cast<std::size_t>(leaf)];
    const auto [x, y] = position(field_, shapes_, leaf, i, j);
    int from = field_.tree().find_leaf(x, y);
    if (from < 0 || shapes_[static_cast<std::size_t>(from)] == kNoLeaf) from = leaf;
    const LeafShape& other = shapes_[static_cast<std::size_t>(from)];
    const Taps at_x(field_.vertex_x(from, x), other.nx), at_y(field_.vertex_y(from, y), other.ny);
    const auto value = [&](int column, int z, int row) {
      return field_.parameters()[vertex(field_, from, column, z, row)];
    };
    const auto in_plane = [&](int z) {
      const auto at_column = [&](int column) {
        return between(value(column, z, at_y.lower), value(column, z, at_y.upper), at_y.fraction);
      };
      return between(at_column(at_x.lower), at_column(at_x.upper), at_x.fraction);
    };
    for (int k = 0; k < own.nz; ++k) {
      const Taps at_z(static_cast<double>(k) * (other.nz - 1) / (own.nz - 1), other.nz);
      field_.parameters()[vertex(field_, leaf, i, k, j)] =
          between(in_plane(at_z.lower), in_plane(at_z.upper), at_z.fraction);
    }
  }

  Field& field_;
  const std::vector<LeafShape>& shapes_;
};

// Returns the densities of a field above a point of the plane.
std::vector<float> column(const Field& field, const std::array<double, 2>& at,
                          const std::vector<double>& z) {
  const std::vector<double> x(z.size(), at[0]), y(z.size(), at[1]);
  std::vector<float> densities(z.size());
  field.point_densities(field.tree().find_leaf(at[0], at[1]), {x, y, z}, densities);
  return densities;
}

// Returns the sum of absolute differences.
double distance(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += static_cast<double>(std::abs(a[i] - b[i]));
  return sum;
}

// Returns whether a point of the plane, which is a vertex, is in a region.
bool is_inside(const std::array<double, 2>& at, const Rectangle& region) {
  const auto is_between = [](double position, std::int64_t low, std::int64_t high) {
    const double corner = position - field::kPixelCentre;
    return corner >= static_cast<double>(low) && corner < static_cast<double>(high);
  };
  return is_between(at[0], region.x0, region.x1) && is_between(at[1], region.y0, region.y1);
}

// Returns the densities of a leaf [x, z, y] but those of its upper faces.
FloatMatrix densities_of(const LeafCodes& codes, int leaf, const field::Quadtree& tree) {
  const LeafShape& own = codes.shapes[static_cast<std::size_t>(leaf)];
  const double step = codes.step[static_cast<std::size_t>(tree.band_of_leaf(leaf))];
  FloatMatrix values =
      values_of(dequantised_modes(decode(codes.code(leaf), own), step), own.nx, own.ny, own.nz);
  if (values.allFinite() && base::is_plausible(static_cast<double>(values.cwiseAbs().maxCoeff())))
    return values;
  throw DamagedCode("the code of a leaf stands for numbers that are no densities");
}

// Writes the densities of a leaf but those of its upper faces.
void decode_leaf(const LeafCodes& codes, int leaf, Field& field) {
  const LeafShape& own = codes.shapes[static_cast<std::size_t>(leaf)];
  const FloatMatrix values = densities_of(codes, leaf, field.tree());
  const LeafShape& s = field.shape(leaf);
  float* to = field.parameters().data() + field.offset(leaf);
  for (int i = 0; i < own.nx; ++i) {
    for (int k = 0; k < own.nz; ++k, to += s.ny)
      std::copy_n(values.row(i).data() + static_cast<std::ptrdiff_t>(k) * own.ny, own.ny, to);
  }
}

// Returns the mean absolute difference of the neighbouring columns of different leaves over that of
// neighbours in the middle of a leaf, or 0 if the latter do not differ. The places are those of the
// leaves of `decoded`; the densities are those of `field`. Pairs that are not wholly in the region
// of interest are left out, because only `decoded` is empty beyond it.
double face_jump(const Field& field, const Field& decoded, const std::vector<LeafShape>& shapes,
                 const Rectangle& roi) {
  struct Sums {
    double across = 0, inside = 0;
  };
  std::vector<Sums> sums(shapes.size());
  base::parallel_for("measure faces", std::ssize(sums), [&](std::int64_t i) {
    const int leaf = static_cast<int>(i);
    const LeafShape& own = shapes[static_cast<std::size_t>(i)];
    std::vector<double> z;
    for (int k = 0; k < own.nz; ++k)
      z.push_back(field::kPixelCentre +
                  field::vertex_height(decoded.thickness()) * k / (own.nz - 1));
    for (const bool along_x : {true, false}) {
      for_each_neighbours(decoded, shapes, leaf, along_x, [&](const Neighbours& at) {
        const int x = along_x ? own.nx / 2 : at.i, y = along_x ? at.j : own.ny / 2;
        const std::array<std::array<double, 2>, 4> places = {
            position(decoded, shapes, leaf, at.i, at.j),
            position(decoded, shapes, at.other, at.other_i, at.other_j),
            position(decoded, shapes, leaf, x, y),
            position(decoded, shapes, leaf, along_x ? x - 1 : x, along_x ? y : y - 1)};
        if (!std::ranges::all_of(places, [&](const auto& p) { return is_inside(p, roi); })) return;
        const auto difference = [&](std::size_t a, std::size_t b) {
          return distance(column(field, places[a], z), column(field, places[b], z));
        };
        Sums& sum = sums[static_cast<std::size_t>(i)];
        sum.across += difference(0, 1);
        sum.inside += difference(2, 3);
      });
    }
  });
  Sums all;
  for (const Sums& sum : sums) {
    all.across += sum.across;
    all.inside += sum.inside;
  }
  return all.inside > 0 ? all.across / all.inside : 0;
}

}  // namespace

void require_sound(const CodedField& coded) {
  base::parallel_for("check leaves", coded.tree.num_leaves(), [&](std::int64_t leaf) {
    densities_of(coded.codes, static_cast<int>(leaf), coded.tree);
  });
}

std::unique_ptr<Field> decode_field(const CodedField& coded) {
  const LeafCodes& codes = coded.codes;
  const int num_leaves = coded.tree.num_leaves();
  TOMOFIELD_CHECK(std::ssize(codes.shapes) == num_leaves, "one shape a leaf");
  std::vector<LeafShape> shapes;
  std::ranges::transform(codes.shapes, std::back_inserter(shapes), with_upper_faces);
  auto field = field::make_field(FieldKind::kGrid, coded.tree, coded.thickness, std::move(shapes));
  base::parallel_for("decode leaves", num_leaves,
                     [&](std::int64_t i) { decode_leaf(codes, static_cast<int>(i), *field); });
  soften_faces(*field, codes);
  const UpperFaces faces(*field, codes.shapes);
  base::parallel_for("fill upper faces", num_leaves,
                     [&](std::int64_t i) { faces.fill(static_cast<int>(i)); });
  return field;
}

double matching_face_weight(const Field& decoded, const LeafCodes& codes, const Field& original,
                            const Rectangle& roi) {
  const double of_decoded = face_jump(decoded, decoded, codes.shapes, roi);
  const double of_original = face_jump(original, decoded, codes.shapes, roi);
  // A weight w leaves the part 1 - 2 w of a difference across a face.
  return of_decoded > of_original ? (1 - of_original / of_decoded) / 2 : 0;
}

}  // namespace tomofield::compact
