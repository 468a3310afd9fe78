#include "fuzz_input.h"
#include "io/tables/alignment_files.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const tomofield::fuzz::InputFile file(data, size);
  tomofield::fuzz::refuse_or(
      [&] { tomofield::io::read_number_column(file.path(), "a tilt angle"); });
  return 0;
}
