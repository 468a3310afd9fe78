// Measures the speed of the slab kernels on one core: bench_kernels OUTPUT.json [ROUNDS [TARGET]].
#include <fmt/core.h>
#include <hwy/targets.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/version.h"
#include "bench/cases.h"
#include "bench/machine.h"
#include "bench/measure.h"

namespace tomofield::bench {
namespace {

std::vector<Case> all_cases() {
  std::vector<Case> cases;
  for (const auto& some : {load_bound_cases(), projection_cases(), step_cases(),
                           field_cases(FieldKind::kVm), field_cases(FieldKind::kGrid)}) {
    cases.insert(cases.end(), some.begin(), some.end());
  }
  return cases;
}

// Reports the timings of one SIMD target and the ratios that follow from them.
class TargetReport {
 public:
  TargetReport(const std::vector<Case>& cases, const std::vector<Timing>& timings,
               std::int64_t target)
      : cases_(cases), target_(target) {
    for (const Timing& t : timings)
      if (t.target == target) timings_.push_back(&t);
  }

  nlohmann::json json() const {
    nlohmann::json rows = nlohmann::json::array();
    for (const Timing* t : timings_) {
      const Case& c = cases_[t->which];
      rows.push_back({{"name", c.name},
                      {"median_s", t->median()},
                      {"minimum_s", t->minimum()},
                      {"seconds", t->seconds},
                      {"nominal_updates", c.updates},
                      {"updates_done", c.done},
                      {"flops", c.flops},
                      {"bytes", c.bytes}});
    }
    return {{"target", hwy::TargetName(target_)}, {"cases", rows}, {"ratios", ratios()}};
  }

  void print() const {
    fmt::print(
        "\n### {}\n\n| case | median ms | minimum ms | 10⁹ updates/s nominal (done) | GFLOP/s | "
        "GB/s |\n"
        "|-|-|-|-|-|-|\n",
        hwy::TargetName(target_));
    for (const Timing* t : timings_) {
      const Case& c = cases_[t->which];
      const double per_ns = 1e-9 / t->median();
      const std::string updates =
          c.updates > 0 ? fmt::format("{:.2f} ({:.2f})", c.updates * per_ns, c.done * per_ns) : "";
      fmt::print("| {} | {:.3f} | {:.3f} | {} | {:.1f} | {:.1f} |\n", c.name, 1e3 * t->median(),
                 1e3 * t->minimum(), updates, c.flops * per_ns, c.bytes * per_ns);
    }
    fmt::print("\n");
    const nlohmann::json figures = ratios();
    for (const auto& [name, value] : figures.items())
      fmt::print("- {}: {:.2f}\n", name, value.get<double>());
  }

 private:
  const Timing& timing(const std::string& name) const {
    for (const Timing* t : timings_)
      if (cases_[t->which].name == name) return *t;
    throw std::logic_error("no case " + name);
  }

  // Returns the summed median seconds of all cases whose name starts with `prefix`.
  double seconds_of(const std::string& prefix) const {
    double sum = 0.0;
    for (const Timing* t : timings_)
      if (cases_[t->which].name.starts_with(prefix)) sum += t->median();
    return sum;
  }

  nlohmann::json ratios() const {
    const double both = timing(kForward).median() + timing(kAdjoint).median();
    const Case& forward = cases_[timing(kForward).which];
    const Case& load = cases_[timing(kLoadL1).which];
    const double done_per_s = 2 * forward.done / both;
    const double of_pair = timing(kStepForward).median() + timing(kStepAdjoint).median();
    const double projection = of_pair / kSlabsTogether, other = seconds_of("step: ") - of_pair;
    return {{"forward + adjoint, 10⁹ nominal updates/s", 2e-9 * forward.updates / both},
            {"forward + adjoint, 10⁹ updates done/s", 1e-9 * done_per_s},
            {"of the L1 load bound", done_per_s * timing(kLoadL1).median() / load.done},
            {"of the L2 load bound", done_per_s * timing(kLoadL2).median() / load.done},
            {"vm: rest of a step / its projection", (other + seconds_of("vm: ")) / projection},
            {"grid: rest of a step / its projection", (other + seconds_of("grid: ")) / projection}};
  }

  const std::vector<Case>& cases_;
  std::int64_t target_;
  std::vector<const Timing*> timings_;
};

int run(const std::string& output, int rounds, const std::string& only_target) {
  std::vector<std::int64_t> targets;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    const std::string name = hwy::TargetName(target);
    if (only_target.empty() ? name != "SCALAR" && name != "EMU128" : name == only_target)
      targets.push_back(target);
  }
  const std::vector<Case> cases = all_cases();
  const std::vector<Timing> timings = measure(cases, targets, rounds);
  nlohmann::json report = {{"commit", base::source_commit()},
                           {"compiler", __VERSION__},
                           {"cpu", cpu_model()},
                           {"rounds", rounds},
                           {"targets", nlohmann::json::array()}};
  fmt::print("{} · commit {} · {} rounds\n", cpu_model(), base::source_commit(), rounds);
  for (const std::int64_t target : targets) {
    const TargetReport target_report(cases, timings, target);
    target_report.print();
    report["targets"].push_back(target_report.json());
  }
  std::ofstream file(output);
  file << report.dump(1) << "\n";
  return file.good() ? 0 : 1;
}

}  // namespace
}  // namespace tomofield::bench

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  const bool has_option =
      std::any_of(arguments.begin(), arguments.end(),
                  [](const std::string& word) { return word.starts_with("-"); });
  if (arguments.empty() || arguments.size() > 3 || has_option) {
    fmt::print(stderr, "usage: bench_kernels OUTPUT.json [ROUNDS [TARGET]]\n");
    return 2;
  }
  return tomofield::bench::run(argv[1], argc > 2 ? std::atoi(argv[2]) : 25,
                               argc > 3 ? argv[3] : "");
}
