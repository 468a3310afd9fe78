#include "batch/choice.h"
#include "batch/job.h"
#include "fuzz_input.h"

// The JSON files between a batch and its jobs: plans, the list of jobs, and votes.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tomofield;
  const fuzz::InputFile file(data, size);
  fuzz::refuse_or([&] { batch::read_plan(file.path()); });
  fuzz::refuse_or([&] { batch::read_jobs(file.path()); });
  fuzz::refuse_or([&] { batch::read_vote(batch::Job(), file.path()); });
  return 0;
}
