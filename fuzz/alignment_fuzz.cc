#include <cstdlib>
#include <nlohmann/json.hpp>

#include "align/alignment_record.h"
#include "fuzz_input.h"
#include "io/json.h"
#include "options/run_options.h"
#include "realign/alignment_origin_record.h"
#include "report/alignment_plot.h"

// The record of an alignment, from which a run resumes, and what the run makes of it. What is
// written of it is read as it was.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tomofield;
  const fuzz::InputFile file(data, size);
  fuzz::refuse_or([&] {
    const alignment::AlignmentRecord record = alignment::record_from(io::read_json(file.path()));
    const nlohmann::json written = alignment::to_json(record);
    if (alignment::to_json(alignment::record_from(written)) != written) std::abort();
    options::ReconstructOptions options;
    realign::apply_alignment(record, options);
    report::alignment_curves(record);
  });
  return 0;
}
