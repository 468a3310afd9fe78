#include <vector>

#include "fuzz_input.h"
#include "io/images/mrc.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const tomofield::fuzz::InputFile file(data, size);
  tomofield::fuzz::refuse_or([&] {
    const tomofield::io::MrcReader reader(file.path());
    const auto& header = reader.header();
    std::vector<float> section(static_cast<std::size_t>(header.nx * header.ny));
    reader.read_section(0, section);
    reader.read_section(header.nz - 1, section);
  });
  return 0;
}
