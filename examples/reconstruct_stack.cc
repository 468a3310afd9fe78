// Reconstructs the series of ./demo as the command line does:
//   reconstruct_stack tilt_series.mrc tilt_series.tlt 75 tomogram.mrc
#include <tomofield/error.h>
#include <tomofield/reconstruct.h>

#include <cstdlib>
#include <iostream>

int main(int argc, char** argv) try {
  if (argc != 5) throw tomofield::Error("usage: reconstruct_stack STACK TLT THICKNESS OUTPUT");
  tomofield::SeriesFiles files;
  files.stack = argv[1];
  files.tlt = argv[2];
  tomofield::Options options;
  options.specimen.thickness = std::atof(argv[3]);
  options.views.contrast = tomofield::Contrast::kBright;
  options.field.with_margin = false;  // the specimen ends inside the field of view
  options.run.output = argv[4];
  const auto show = [](const tomofield::Progress& progress) {
    std::cerr << '\r' << static_cast<int>(100 * progress.fraction_done) << " %" << std::flush;
    return true;  // false stops the reconstruction
  };
  tomofield::reconstruct(tomofield::TiltSeries::from_files(files), options, show);
} catch (const tomofield::Error& error) {
  std::cerr << error.what() << '\n';
  return 2;
}
