#include "fit/halo.h"

#include <algorithm>
#include <cmath>

#include "prior/answer.h"

namespace tomofield::fit {
namespace {

using base::Range;

// Calls body(first parameter, length, place in the packed buffer) for the runs in order.
template <typename Body>
void for_each_run(const std::vector<field::ParameterRuns>& all, const Body& body) {
  std::size_t packed = 0;
  for (const field::ParameterRuns& runs : all) {
    for (std::size_t r = 0; r < runs.repeats; ++r, packed += runs.count)
      body(runs.first + r * runs.stride, runs.count, packed);
  }
}

}  // namespace

HaloLeaves halo_leaves(const field::Quadtree& tree, const measurement::RowShare& share,
                       std::int64_t rows) {
  const field::RootGrid& roots = tree.roots();
  const std::int64_t first = roots.y0 + share.bands.begin * roots.cell_size;
  const std::int64_t end = roots.y0 + share.bands.end * roots.cell_size;
  HaloLeaves leaves;
  if (share.bands.begin > 0) {
    leaves.before = tree.leaves_across(first - rows, first);
    leaves.own_first = tree.leaves_across(first, first + share.rows_by_previous + rows);
  }
  if (share.bands.end < roots.rows) {
    leaves.own_last = tree.leaves_across(end - rows, end);
    leaves.after = tree.leaves_across(end, end + share.rows_for_next + rows);
  }
  return leaves;
}

std::vector<int> needed_leaves(const field::Quadtree& tree, const measurement::RowShare& share,
                               std::int64_t rows) {
  const Range own = field::leaves_of_bands(tree, share.bands);
  const HaloLeaves halo = halo_leaves(tree, share, rows);
  std::vector<int> leaves = halo.before;
  for (int leaf = own.begin; leaf < own.end; ++leaf) leaves.push_back(leaf);
  leaves.insert(leaves.end(), halo.after.begin(), halo.after.end());
  return leaves;
}

std::int64_t rows_beyond(Prior prior) { return prior == Prior::kLearned ? prior::kRowsBeyond : 1; }

// Returns the parameters that densities between two y depend on.
Halo::Part Halo::part(const field::Field& field, const std::vector<int>& leaves, double low,
                      double high) {
  Part part;
  std::size_t size = 0;
  for (const int leaf : leaves) {
    const field::Square& square = field.tree().leaf(leaf).square;
    const auto within = [&](double y) {
      return std::clamp(y, static_cast<double>(square.y0) + field::kPixelCentre,
                        static_cast<double>(square.y1()) + field::kPixelCentre);
    };
    for (field::ParameterRuns runs : field.parameters_between(leaf, within(low), within(high))) {
      runs.first += field.offset(leaf);
      size += runs.size();
      part.runs.push_back(runs);
    }
  }
  part.packed.resize(size);
  return part;
}

Halo::Halo(const field::Field& field, const measurement::RowShare& share, double reach,
           const distributed::Communicator& processes)
    : processes_(processes) {
  const HaloLeaves leaves =
      halo_leaves(field.tree(), share, static_cast<std::int64_t>(std::ceil(reach)));
  const field::RootGrid& roots = field.tree().roots();
  const auto boundary = [&](int band) {
    return static_cast<double>(roots.y0 + band * roots.cell_size);
  };
  const double first = boundary(share.bands.begin), end = boundary(share.bands.end);
  const auto from = [&](double face) { return face - reach; };
  const auto to = [&](double face, std::int64_t rows) {
    return face + std::max(field::kPixelCentre, static_cast<double>(rows) + reach);
  };
  to_before_ = part(field, leaves.own_first, first, to(first, share.rows_by_previous));
  to_after_ = part(field, leaves.own_last, from(end), end + field::kPixelCentre);
  from_before_ = part(field, leaves.before, from(first), first + field::kPixelCentre);
  from_after_ = part(field, leaves.after, end, to(end, share.rows_for_next));
}

distributed::Communicator::Halo Halo::pack(std::span<const float> parameters) {
  for (Part* part : {&to_before_, &to_after_}) {
    for_each_run(part->runs, [&](std::size_t at, std::size_t count, std::size_t packed) {
      std::copy_n(parameters.data() + at, count, part->packed.data() + packed);
    });
  }
  return {to_before_.packed, to_after_.packed, from_before_.packed, from_after_.packed};
}

void Halo::unpack(std::span<float> parameters) const {
  for (const Part* part : {&from_before_, &from_after_}) {
    for_each_run(part->runs, [&](std::size_t at, std::size_t count, std::size_t packed) {
      std::copy_n(part->packed.data() + packed, count, parameters.data() + at);
    });
  }
}

void Halo::refresh(std::span<float> parameters) {
  processes_.exchange(pack(parameters));
  unpack(parameters);
}

}  // namespace tomofield::fit
