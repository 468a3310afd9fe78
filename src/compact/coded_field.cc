#include "compact/coded_field.h"

#include <algorithm>
#include <functional>
#include <numeric>

#include "base/check.h"
#include "base/plausible.h"
#include "compact/leaf_code.h"
#include "field/tree/quadtree_bands.h"

namespace tomofield::compact {
namespace {

std::size_t num_factors(const field::LeafShape& shape) {
  return field::count_parameters(FieldKind::kVm, {shape});
}

std::size_t num_vertices(const field::LeafShape& shape) {
  return field::count_parameters(FieldKind::kGrid, {with_upper_faces(shape)});
}

// Returns the bytes that decode_leaf() (decoded_field.cc) holds beside the field: of each factor a
// whole number, a float and its copy as a mode, which are more than the whole number and its packed
// bytes before; and of each vertex a float.
std::size_t bytes_while_decoding(const field::LeafShape& shape) {
  return num_factors(shape) * 3 * sizeof(float) + num_vertices(shape) * sizeof(float);
}

}  // namespace

std::size_t LeafCodes::num_parameters() const {
  return field::count_parameters(FieldKind::kVm, shapes);
}

std::span<const std::uint8_t> LeafCodes::code(int leaf) const {
  const auto at = static_cast<std::size_t>(leaf);
  const auto first = static_cast<std::size_t>(offset[at]);
  return std::span(bytes).subspan(first, static_cast<std::size_t>(offset[at + 1]) - first);
}

field::LeafShape with_upper_faces(const field::LeafShape& shape) {
  return {.nx = shape.nx + 1, .ny = shape.ny + 1, .nz = shape.nz};
}

bool has_possible_ranks(const field::LeafShape& shape) {
  const auto is_possible = [](std::int64_t rank, std::int64_t n, std::int64_t m, std::int64_t k) {
    return rank <= n && rank <= m * k;
  };
  return is_possible(shape.rank_x, shape.nx, shape.ny, shape.nz) &&
         is_possible(shape.rank_y, shape.ny, shape.nx, shape.nz) &&
         is_possible(shape.rank_z, shape.nz, shape.nx, shape.ny);
}

std::size_t decoded_bytes(const std::vector<field::LeafShape>& shapes, int num_threads) {
  constexpr std::int64_t kMost = std::int64_t{1} << 40;
  base::CheckedSize numbers = 0;
  std::size_t vertices = 0;
  std::vector<std::size_t> while_decoding;
  for (const field::LeafShape& shape : shapes) {
    numbers = numbers + num_factors(shape) + num_vertices(shape);
    if (!numbers.find(kMost)) return kNoMemoryHolds;
    vertices += num_vertices(shape);
    while_decoding.push_back(bytes_while_decoding(shape));
  }
  const auto at_once = std::min(while_decoding.size(), static_cast<std::size_t>(num_threads));
  std::ranges::partial_sort(while_decoding, while_decoding.begin() + std::ptrdiff_t(at_once),
                            std::greater());
  return std::accumulate(while_decoding.begin(), while_decoding.begin() + std::ptrdiff_t(at_once),
                         vertices * sizeof(float));
}

bool is_joinable(const CodedField& lower, const CodedField& upper) {
  return lower.thickness == upper.thickness && field::is_joinable(lower.tree, upper.tree);
}

void append(CodedField& lower, const CodedField& upper) {
  TOMOFIELD_CHECK(is_joinable(lower, upper), "bands of one field");
  lower.tree = field::joined(lower.tree, upper.tree);
  LeafCodes& to = lower.codes;
  const LeafCodes& from = upper.codes;
  const std::int64_t first = std::ssize(to.bytes);
  to.step.insert(to.step.end(), from.step.begin(), from.step.end());
  to.face_weight.insert(to.face_weight.end(), from.face_weight.begin(), from.face_weight.end());
  to.shapes.insert(to.shapes.end(), from.shapes.begin(), from.shapes.end());
  for (std::size_t i = 1; i < from.offset.size(); ++i) to.offset.push_back(first + from.offset[i]);
  to.bytes.insert(to.bytes.end(), from.bytes.begin(), from.bytes.end());
}

CodedField some_bands(const CodedField& field, base::Range bands) {
  const auto part = [](const auto& all, base::Range range) {
    return std::vector(all.begin() + range.begin, all.begin() + range.end);
  };
  const base::Range leaves = field::leaves_of_bands(field.tree, bands);
  const LeafCodes& all = field.codes;
  CodedField some{.tree = field::some_bands(field.tree, bands),
                  .thickness = field.thickness,
                  .codes = {.step = part(all.step, bands),
                            .face_weight = part(all.face_weight, bands),
                            .shapes = part(all.shapes, leaves),
                            .offset = part(all.offset, {leaves.begin, leaves.end + 1}),
                            .bytes = {}},
                  .file = field.file};
  std::vector<std::int64_t>& offset = some.codes.offset;
  some.codes.bytes.assign(all.bytes.begin() + offset.front(), all.bytes.begin() + offset.back());
  const std::int64_t first = offset.front();
  for (std::int64_t& at : offset) at -= first;
  return some;
}

}  // namespace tomofield::compact
