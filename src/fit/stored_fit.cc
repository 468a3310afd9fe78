// Checks whether a stored fit can be continued (Fit::fault_of).

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "fit/fit.h"

namespace tomofield::fit {
namespace {

bool are_finite(std::initializer_list<double> values) {
  return std::ranges::all_of(values, [](double value) { return std::isfinite(value); });
}

// The fit keeps scales near 1, and offsets in units of the contrast.
bool is_sound(const measurement::ViewModel& view) {
  constexpr double kLargestScale = 1e4, kLargestOffset = 1e9;
  return view.scale >= 1 / kLargestScale && view.scale <= kLargestScale &&
         std::fabs(view.offset) <= kLargestOffset && view.weight > 0 &&
         std::isfinite(view.weight) && view.largest_residual > 0;
}

bool is_sound(const measurement::ViewSums& sums) {
  return are_finite({sums.n, sums.p, sums.b, sums.pp, sums.pb, sums.bb, sums.limited_squares}) &&
         sums.n >= 0;
}

template <typename Items>
bool are_sound(const Items& items) {
  return std::ranges::all_of(items, [](const auto& item) { return is_sound(item); });
}

bool are_equal(const field::QuadtreeNode& a, const field::QuadtreeNode& b) {
  return a.square == b.square && a.region == b.region && a.first_child == b.first_child;
}

// Says whether both trees have the same root cells.
bool have_same_roots(const field::Quadtree& a, const field::Quadtree& b) {
  if (a.roots() != b.roots()) return false;
  const std::ptrdiff_t num_roots = std::ptrdiff_t{a.roots().columns} * a.roots().rows;
  return std::equal(a.nodes().begin(), a.nodes().begin() + num_roots, b.nodes().begin(),
                    [](const auto& x, const auto& y) { return x.region == y.region; });
}

}  // namespace

std::string Fit::fault_of(const field::Quadtree& tree) const {
  const field::Quadtree& own = domain_.tree;
  if (!have_same_roots(tree, own)) return "its root cells are not those of this series";
  if (may_change_tree_) return {};
  return std::ranges::equal(tree.nodes(), own.nodes(), are_equal)
             ? ""
             : "its leaves are not those of these options";
}

std::string Fit::fault_of(const Progress& progress, const field::Field& field) const {
  const std::string of_tree = fault_of(field.tree());
  if (!of_tree.empty()) return of_tree;
  if (progress.step < 0 || progress.step > num_steps())
    return fmt::format("it is at step {} of {}", progress.step, num_steps());
  const Stage& stage = stage_at(progress.step);
  if (field.kind() != stage.field_kind || field.thickness() != field_->thickness() ||
      field.activation.beta != field_->activation.beta)
    return "its field is not that of this stage of the fit";
  for (int leaf = 0; leaf < field.tree().num_leaves(); ++leaf)
    if (field.shape(leaf) != domain_.shape_in(field.tree().leaf(leaf).region, stage.bin))
      return fmt::format("leaf {} has other vertices or ranks than this stage of the fit", leaf);

  const std::size_t num_views = progress_.views.size();
  if (progress.views.size() != num_views || !are_sound(progress.views))
    return fmt::format("it has no usable scales of {} views", num_views);
  if (progress.epoch_sums.size() != num_views || !are_sound(progress.epoch_sums))
    return fmt::format("it has no usable sums of {} views", num_views);
  const auto epochs_done = static_cast<std::size_t>(progress.step / steps_per_epoch());
  if (progress.data_loss.size() != epochs_done)
    return fmt::format("it has the losses of {} of {} epochs", progress.data_loss.size(),
                       epochs_done);
  constexpr double kLargestResidual = 1e30;
  const auto is_residual = [](double r) { return r >= 0 && r <= kLargestResidual; };
  if (!std::ranges::all_of(progress.data_loss, is_residual))
    return fmt::format("it has no usable losses of {} epochs", epochs_done);
  if (progress.view_residual.size() != (epochs_done > 0 ? num_views : 0) ||
      !std::ranges::all_of(progress.view_residual, is_residual))
    return fmt::format("it has no usable residuals of {} views", num_views);
  const std::size_t num_scores = measurement_.held_out.empty() ? 0 : epochs_done;
  if (progress.held_out_error.size() != num_scores)
    return fmt::format("it has the held-out errors of {} of {} epochs",
                       progress.held_out_error.size(), num_scores);
  if (progress.tree.updates.size() > (may_change_tree_ ? epochs_done : 0))
    return fmt::format("its tree was updated {} times", progress.tree.updates.size());
  return {};
}

}  // namespace tomofield::fit
