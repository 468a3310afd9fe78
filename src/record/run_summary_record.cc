#include "record/run_summary_record.h"

#include <nlohmann/json.hpp>

#include "base/plausible.h"
#include "io/json.h"
#include "tomofield/error.h"

namespace tomofield::record {
namespace {

using nlohmann::json;

// Returns a number under a key, or nothing if there is none.
std::optional<double> number_at(const json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number()) return std::nullopt;
  return found->get<double>();
}

RunSummary summary_of(const json& metrics) {
  RunSummary summary;
  summary.num_parameters = number_at(metrics, "parameters");
  if (const auto held_out = metrics.find("held_out"); held_out != metrics.end())
    summary.held_out_error = number_at(*held_out, "error");
  const json verdict = metrics.value("verdict", json::object());
  summary.verdict = verdict.value("line", "");
  for (const json& warning : verdict.value("warnings", json::array()))
    summary.warnings.push_back(warning.at("message").get<std::string>());
  return summary;
}

}  // namespace

RunSummary read_summary(const std::filesystem::path& file) {
  return io::read_record(
      file,
      [](const json& document) {
        const json& metrics = document.at("metrics");
        if (!metrics.is_object()) throw Error("its 'metrics' are no object");
        return summary_of(metrics);
      },
      [](const std::string& why) { return why; });
}

}  // namespace tomofield::record
