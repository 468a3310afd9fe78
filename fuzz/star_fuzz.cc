#include "fuzz_input.h"
#include "io/tables/relion_star.h"
#include "io/tables/star_file.h"
#include "io/tables/view_table.h"

// A STAR file is read as each of the tables that it may be, and written again.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tomofield;
  const fuzz::InputFile file(data, size);
  fuzz::refuse_or([&] { io::read_relion_views(file.path()); });
  fuzz::refuse_or([&] { io::read_warp_tomostar(file.path()); });
  fuzz::refuse_or([&] { io::star_file_text(io::read_relion_tomograms(file.path()).table); });
  return 0;
}
