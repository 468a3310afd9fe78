#include "batch/state_record.h"

#include <chrono>
#include <cstdint>
#include <optional>

#include "base/plausible.h"
#include "io/json.h"
#include "tomofield/error.h"

namespace tomofield::batch {

using nlohmann::json;
namespace fs = std::filesystem;

std::optional<std::int64_t> checkpoint_time_ns(const Job& job) {
  const auto written = last_progress(job.output);
  return written ? std::optional(written->time_since_epoch() / std::chrono::nanoseconds(1))
                 : std::nullopt;
}

bool continues(const State& before, const Job& job) {
  return can_resume(job.output) &&
         (!job.replaces ||
          (has_begun(before) && checkpoint_time_ns(job) > before.old_checkpoint_ns));
}

fs::path log_folder(const fs::path& folder) { return folder / "logs"; }

fs::path log_of(const fs::path& folder, const Job& job) {
  return log_folder(folder) / (job.name + ".log");
}

fs::path state_file_of(const fs::path& folder, const Job& job) {
  return log_folder(folder) / (job.name + ".state.json");
}

namespace {

std::optional<std::int64_t> time_at(const json& state, const char* key) {
  if (state.at(key).is_null()) return std::nullopt;
  return io::integer_at(state, key, INT64_MIN, INT64_MAX);
}

std::optional<State> find_state(const fs::path& file) {
  try {
    const json state = io::read_json(file);
    const auto progress = base::enum_named<Progress>(state.at("progress").get<std::string>());
    if (!progress) return std::nullopt;
    return State{
        .progress = *progress,
        .reason = state.at("reason").get<std::string>(),
        .costs = {.core_seconds = io::number_at(state, "core_seconds", 0, base::kLargestNumber),
                  .wall_seconds = io::number_at(state, "wall_seconds", 0, base::kLargestNumber),
                  .peak_bytes = io::integer_at(state, "peak_bytes", 0, INT64_MAX)},
        .old_checkpoint_ns = time_at(state, "old_checkpoint_ns")};
  } catch (const json::exception&) {
    return std::nullopt;
  } catch (const Error&) {
    return std::nullopt;
  }
}

}  // namespace

bool has_state(const fs::path& folder, const Job& job) {
  return find_state(state_file_of(folder, job)).has_value();
}

State read_state(const fs::path& folder, const Job& job) {
  return find_state(state_file_of(folder, job)).value_or(State{});
}

void write_state(const fs::path& folder, const Job& job, const State& state) {
  const auto& old = state.old_checkpoint_ns;
  io::write_json(state_file_of(folder, job), {{"progress", base::name_of(state.progress)},
                                              {"reason", state.reason},
                                              {"core_seconds", state.costs.core_seconds},
                                              {"wall_seconds", state.costs.wall_seconds},
                                              {"peak_bytes", state.costs.peak_bytes},
                                              {"old_checkpoint_ns", old ? json(*old) : json()}});
}

}  // namespace tomofield::batch
