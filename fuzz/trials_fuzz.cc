#include <nlohmann/json.hpp>

#include "fuzz_input.h"
#include "io/json_numbers.h"
#include "reconstruct/tuning.h"
#include "selection/trial_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tomofield;
  const fuzz::InputFile file(data, size);
  const reconstruction::TrialSettings settings{Penalty::kSmooth, 5, 12, 30};
  fuzz::refuse_or([&] {
    const selection::TrialFile trials(file.path(), "{}", /*reuse=*/true);
    const auto found = trials.find(reconstruction::settings_json(settings));
    if (found) reconstruction::trial_from(*found);
  });
  fuzz::refuse_or([&] {  // the tuning in a checkpoint
    try {
      reconstruction::tuned_from(io::read_json(file.path()));
    } catch (const nlohmann::json::exception&) {
    }
  });
  return 0;
}
