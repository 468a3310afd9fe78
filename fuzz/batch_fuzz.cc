#include <filesystem>
#include <string>

#include "batch/choice.h"
#include "batch/job.h"
#include "fuzz_input.h"
#include "record/plan_record.h"
#include "tune/trial_record.h"

// The JSON files between a batch and its jobs: plans, the list of jobs, votes, and the choice.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tomofield;
  static const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("batch_fuzz_" + std::to_string(::getpid()));
  const fuzz::InputFile file(data, size);
  std::filesystem::create_directories(folder);
  std::filesystem::remove(folder / "choice.json");
  std::filesystem::create_symlink(file.path(), folder / "choice.json");
  fuzz::refuse_or([&] { record::read_plan(file.path()); });
  fuzz::refuse_or([&] { batch::read_jobs(file.path()); });
  fuzz::refuse_or([&] { tune::read_choice(file.path()); });
  fuzz::refuse_or([&] { batch::read_choice(folder); });
  return 0;
}
