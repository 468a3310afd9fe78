#include "fit/options.h"

#include <fmt/format.h>

#include <cmath>

#include "fit/integer_program.h"
#include "kernels/lanes.h"
#include "tomofield/error.h"

namespace tomofield::fit {
namespace {

// Collects sentences about options; written so that NaN is a fault.
class Faults {
 public:
  void require_between(const char* option, double value, double low, double high) {
    if (value >= low && value <= high) return;
    found_.push_back(fmt::format("{} must be from {} to {}, not {}", option, low, high, value));
  }
  void require_not_negative(const char* option, double value) {
    if (value >= 0 && std::isfinite(value)) return;
    found_.push_back(fmt::format("{} must be 0 or more, not {:g}", option, value));
  }
  void require_positive(const char* option, double value) {
    if (value > 0 && std::isfinite(value)) return;
    found_.push_back(fmt::format("{} must be above 0, not {:g}", option, value));
  }
  void require_one_of(const char* option, const std::string& value, const char* first,
                      const char* second) {
    if (value == first || value == second) return;
    found_.push_back(fmt::format("{} must be {} or {}, not '{}'", option, first, second, value));
  }
  void add(std::string_view fault) { found_.emplace_back(fault); }
  std::vector<std::string> take() { return std::move(found_); }

 private:
  std::vector<std::string> found_;
};

constexpr double kMost = 1e9;  // of a count

}  // namespace

std::vector<std::string> FieldOptions::faults() const {
  constexpr int kLargestLeaf = 4096;
  Faults faults;
  if (tree == TreeKind::kAdaptive && !can_solve_integer_programs()) {
    faults.add(
        "--tree adaptive needs COIN-OR CBC, and this tomofield was built without it: take --tree "
        "uniform, or build tomofield with -DTOMOFIELD_WITH_CBC=ON");
  }
  faults.require_between("--leaf-budget", leaf_budget, 0, kMost);
  if (leaf_budget > 0 && tree == TreeKind::kUniform)
    faults.add("--leaf-budget is for --tree adaptive alone");
  if (leaf_size < kernels::kLanes || leaf_size > kLargestLeaf || leaf_size % kernels::kLanes != 0) {
    faults.add(fmt::format("--leaf-size must be a multiple of {} up to {}, not {}", kernels::kLanes,
                           kLargestLeaf, leaf_size));
  }
  faults.require_between("--vertex-spacing", vertex_spacing, 0.25, 64);
  faults.require_between("--margin-spacing", margin_spacing, 1, 64);
  faults.require_between("--rank", rank, 1, 256);
  faults.require_between("the margin's rank", margin_rank, 1, 256);
  faults.require_positive("the sharpness of softplus", sharpness);
  faults.require_positive("the initial scale", initial_scale);
  return faults.take();
}

std::vector<std::string> FitOptions::faults() const {
  Faults faults;
  faults.require_between("--epochs", epochs, 1, kMost);
  faults.require_between("--vertex-epochs", vertex_epochs, 0, kMost);
  if (vertex_epochs > 0 && engine == Engine::kRay)
    faults.add("--vertex-epochs needs --engine slab: with rays factors are fitted from the start");
  faults.require_between("--coarse-epochs", coarse_epochs, 0, kMost);
  faults.require_between("--coarse-bin", coarse_bin, 2, 64);
  faults.require_between("--subsets", subsets, 1, kMost);
  faults.require_between("--ray-samples", ray_samples, 0, 1 << 20);
  faults.require_between("--rays-per-step", static_cast<double>(rays_per_step), 0, kMost);
  faults.require_positive("--learning-rate", learning_rate);
  faults.require_between("the final learning rate's part of the first", final_rate, 1e-6, 1);
  faults.require_not_negative("--tv", density_variation);
  if (hold_out != 0) faults.require_between("--hold-out", hold_out, 2, kMost);
  faults.require_between("--early-stop", patience, 0, kMost);
  if (patience > 0 && hold_out == 0)
    faults.add("--early-stop watches views that --hold-out keeps from the fit: give that as well");
  if (hold_out > 0 && engine == Engine::kRay)
    faults.add("--hold-out predicts aligned views: it needs --engine slab");
  faults.require_not_negative("--tv-factors", factor_variation);
  faults.require_not_negative("--bcc", boundary);
  faults.require_not_negative("--ifp", fourier);
  faults.require_positive("the concavity", concavity);
  faults.require_positive("the gradient floor", gradient_floor);
  return faults.take();
}

}  // namespace tomofield::fit
