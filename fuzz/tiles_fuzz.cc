#include <filesystem>
#include <fstream>

#include "checkpoint/finished_tiles.h"
#include "hdf5_input.h"
#include "output/output_paths.h"

// The tiles that a run with --budget has finished, with right checksums.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tomofield;
  static const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("tiles_fuzz_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  options::ReconstructOptions options;
  options.run.output = folder / "run.mrc";
  options.run.resume = true;
  options.field.budget = "0.1dB";
  measurement::Measurement series;
  series.roi = {0, 0, 64, 128};
  series.geometry.thickness = 21.5;  // that of the seeds
  checkpoint::FitOrigin origin;
  origin.fingerprint = "the fingerprint";
  std::ofstream(output::output_paths(options.run.output).tiles, std::ios::binary)
      << fuzz::with_right_checksums(data, size);
  fuzz::refuse_or([&] {
    const checkpoint::FinishedTiles tiles(options, series, origin);
    tiles.report();
    tiles.mean_of(&checkpoint::FinishedTile::residual);
  });
  return 0;
}
