#include "alignment_seed.h"
#include "fuzz_input.h"
#include "options/run_options.h"
#include "realign/alignment_origin.h"
#include "report/alignment_plot.h"

// The record of an alignment, from which a run resumes, and what the run makes of it.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tomofield;
  const fuzz::InputFile file(data, size);
  fuzz::refuse_or([&] {
    options::ReconstructOptions options;
    realign::apply_alignment(realign::read_alignment_record(file.path(), fuzz::alignment_origin()),
                             options);
    report::alignment_curves(*options.alignment);
  });
  return 0;
}
