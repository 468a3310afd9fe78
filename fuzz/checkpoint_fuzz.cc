#include "base/threads/parallel.h"
#include "checkpoint/checkpoint.h"
#include "hdf5_input.h"
#include "small_fit.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tomofield;
  static const testing::SmallFit* const series = [] {
    base::set_thread_count(1);
    return new testing::SmallFit();
  }();
  static fit::Fit* const fit = series->make().release();
  const std::string bytes = fuzz::with_right_checksums(data, size);
  const fuzz::InputFile file(bytes.data(), bytes.size());
  fuzz::refuse_or([&] { checkpoint::stored_choice(file.path()); });
  fuzz::refuse_or([&] {
    checkpoint::restore_fit(file.path(), testing::SmallFit::kFingerprint, *fit);
    // A step from any state that was accepted must be possible.
    fit->run([](const fit::Fit&) { return false; });
  });
  return 0;
}
