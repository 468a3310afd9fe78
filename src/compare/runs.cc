#include "compare/runs.h"

#include <fmt/format.h>

#include <string>

namespace tomofield::compare {
namespace {

const char* suffix_of(Purpose purpose) {
  switch (purpose) {
    case Purpose::kVolume:
      return "";
    case Purpose::kOddViews:
      return ".odd";
    case Purpose::kEvenViews:
      return ".even";
    case Purpose::kHeldOutViews:
      return ".held_out";
  }
  return "";
}

// 1-based sections that are left out: the user's, and every other one of the rest.
std::string excluded(Purpose purpose, const CompareOptions& options,
                     const tilt_series::TiltSeries& series) {
  std::string sections = options.input.exclude;
  if (purpose != Purpose::kOddViews && purpose != Purpose::kEvenViews) return sections;
  const std::size_t first = purpose == Purpose::kOddViews ? 1 : 0;
  for (std::size_t v = first; v < series.views().size(); v += 2)
    sections += fmt::format("{}{}", sections.empty() ? "" : ",", series.views()[v].section + 1);
  return sections;
}

}  // namespace

PlannedRuns plan_runs(const CompareOptions& options, const tilt_series::TiltSeries& series) {
  PlannedRuns plan{{Purpose::kVolume}, {}};
  if (options.halves)
    plan.purposes.insert(plan.purposes.end(), {Purpose::kOddViews, Purpose::kEvenViews});
  if (options.hold_out > 0) plan.purposes.push_back(Purpose::kHeldOutViews);
  for (const Purpose purpose : plan.purposes) {
    const std::string exclude = excluded(purpose, options, series);
    for (const Method& method : options.methods) {
      Run run{method.name + suffix_of(purpose), method, method.arguments};
      run.command.insert(run.command.end(), options.series_words.begin(),
                         options.series_words.end());
      if (!exclude.empty()) run.command.insert(run.command.end(), {"--exclude", exclude});
      if (purpose == Purpose::kHeldOutViews)
        run.command.insert(run.command.end(), {"--hold-out", std::to_string(options.hold_out)});
      // Anew for every purpose: settings that were chosen on all views have seen those held out.
      if (options.tune && method.tunes) run.command.push_back("--tune");
      plan.runs.push_back(std::move(run));
    }
  }
  return plan;
}

}  // namespace tomofield::compare
