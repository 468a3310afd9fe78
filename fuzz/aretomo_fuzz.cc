#include "fuzz_input.h"
#include "io/tables/alignment_files.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const tomofield::fuzz::InputFile file(data, size);
  tomofield::fuzz::refuse_or([&] {
    const auto alignment = tomofield::io::read_aretomo_alignment(file.path());
    const auto num_rows = static_cast<std::int64_t>(alignment.rows.size());
    const auto num_dark = static_cast<std::int64_t>(alignment.dark_sections.size());
    for (const std::int64_t sections : {num_rows, num_rows + num_dark}) {
      tomofield::fuzz::refuse_or([&] {
        tomofield::io::assign_aretomo_sections(alignment, file.path(), sections, "stack.mrc");
      });
    }
  });
  return 0;
}
