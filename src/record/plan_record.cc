#include "record/plan_record.h"

#include <fmt/format.h>

#include "base/plausible.h"
#include "base/utf8.h"
#include "io/json.h"

namespace tomofield::record {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr std::int64_t kMostOfAnything = std::int64_t{1} << 60;
constexpr std::int64_t kMostThreads = 1 << 20;
constexpr std::int64_t kMostTrials = 1 << 20;
constexpr double kMostSamples = 1e30;

// Reads a file that a planned run has written. Mistakes in it are errors that name the file.
template <typename Read>
auto read_plan_file(const fs::path& file, const Read& read) {
  return io::read_record(file, read, [&](const std::string& why) {
    return fmt::format("'{}' is not the plan of a run: {}", file.string(), why);
  });
}

std::vector<std::string> texts_of(const std::vector<fs::path>& files) {
  std::vector<std::string> texts;
  for (const fs::path& file : files) texts.push_back(file.string());
  return texts;
}

std::vector<fs::path> files_at(const json& object, const char* key) {
  const auto names = object.at(key).get<std::vector<std::string>>();
  return {names.begin(), names.end()};
}

std::int64_t count_at(const json& object, const char* key) {
  return io::integer_at(object, key, 0, kMostOfAnything);
}

std::array<std::int64_t, 2> size_at(const json& object, const char* key) {
  const std::vector<double> size =
      io::numbers_at(object, key, 0, static_cast<double>(kMostOfAnything));
  if (size.size() != 2) throw Error(fmt::format("'{}' is no width and height", key));
  return {static_cast<std::int64_t>(size[0]), static_cast<std::int64_t>(size[1])};
}

PlanRecord plan_from(const json& plan) {
  PlanRecord read{.stack = plan.at("stack").get<std::string>(),
                  .num_views = count_at(plan, "views"),
                  .view_size_px = size_at(plan, "view_size_px"),
                  .pixel_size_A = io::number_at(plan, "pixel_size_A", 0, base::kLargestNumber),
                  .num_parameters = count_at(plan, "parameters"),
                  .num_trials = static_cast<int>(io::integer_at(plan, "trials", 0, kMostTrials)),
                  .open_variation = plan.at("open_variation").get<bool>(),
                  .open_spike_rank = plan.at("open_spike_rank").get<bool>(),
                  .open_prior = plan.at("open_prior").get<bool>(),
                  .num_steps = count_at(plan, "steps"),
                  .num_threads = io::integer_at(plan, "threads", 1, kMostThreads),
                  .memory_bytes = count_at(plan, "memory_bytes"),
                  .memory_bytes_of_one_thread = count_at(plan, "memory_bytes_of_one_thread"),
                  .core_seconds = {},
                  .sample_steps = io::number_at(plan, "sample_steps", 0, kMostSamples),
                  .result_bytes = count_at(plan, "result_bytes"),
                  .disk_bytes = count_at(plan, "disk_bytes"),
                  .inputs = files_at(plan, "inputs"),
                  .results = files_at(plan, "results"),
                  .relion_tomogram = plan.at("relion_tomogram").get<std::string>()};
  if (!plan.at("core_seconds").is_null())
    read.core_seconds = io::number_at(plan, "core_seconds", 0, base::kLargestNumber);
  return read;
}

}  // namespace

void write_plan(const fs::path& file, const PlanRecord& plan) {
  io::write_json(file, {{"tomofield", TOMOFIELD_VERSION},
                        {"stack", base::utf8_text(plan.stack)},
                        {"views", plan.num_views},
                        {"view_size_px", plan.view_size_px},
                        {"pixel_size_A", plan.pixel_size_A},
                        {"parameters", plan.num_parameters},
                        {"trials", plan.num_trials},
                        {"open_variation", plan.open_variation},
                        {"open_spike_rank", plan.open_spike_rank},
                        {"open_prior", plan.open_prior},
                        {"steps", plan.num_steps},
                        {"threads", plan.num_threads},
                        {"memory_bytes", plan.memory_bytes},
                        {"memory_bytes_of_one_thread", plan.memory_bytes_of_one_thread},
                        {"core_seconds", plan.core_seconds ? json(*plan.core_seconds) : json()},
                        {"sample_steps", plan.sample_steps},
                        {"result_bytes", plan.result_bytes},
                        {"disk_bytes", plan.disk_bytes},
                        {"inputs", texts_of(plan.inputs)},
                        {"results", texts_of(plan.results)},
                        {"relion_tomogram", base::utf8_text(plan.relion_tomogram)}});
}

PlanRecord read_plan(const fs::path& file) { return read_plan_file(file, plan_from); }

void write_planned_volume(const fs::path& file, const PlannedVolume& volume) {
  io::write_json(file, {{"grid", {{"size", volume.grid.size}, {"voxel_A", volume.grid.voxel_A}}},
                        {"files", texts_of(volume.files)}});
}

PlannedVolume read_planned_volume(const fs::path& file) {
  return read_plan_file(file, [](const json& document) {
    const json& grid = document.at("grid");
    const auto size = grid.at("size").get<std::vector<std::int64_t>>();
    if (size.size() != 3) throw Error("'size' is not that of a volume");
    return PlannedVolume{
        {{size[0], size[1], size[2]}, io::number_at(grid, "voxel_A", 0, base::kLargestNumber)},
        files_at(document, "files")};
  });
}

}  // namespace tomofield::record
