#include <nlohmann/json.hpp>

#include "fuzz_input.h"
#include "io/json.h"
#include "tune/trial_file.h"
#include "tune/trial_record.h"
#include "tune/tuning.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tomofield;
  const fuzz::InputFile file(data, size);
  const tune::TrialSettings settings{Penalty::kSmooth, 5, 12, 30};
  fuzz::refuse_or([&] {
    const tune::TrialFile trials(file.path(), "{}", /*reuse=*/true);
    trials.find(settings);
  });
  fuzz::refuse_or([&] {  // the tuning in a checkpoint
    try {
      tune::tuned_from(io::read_json(file.path()));
    } catch (const nlohmann::json::exception&) {
    }
  });
  return 0;
}
