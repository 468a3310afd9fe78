// Reconstructs a folder of eTomo, AreTomo, RELION 5, Warp or SerialEM as the command line does:
//   reconstruct_project TS_01/ tomogram.mrc
#include <tomofield/error.h>
#include <tomofield/project.h>
#include <tomofield/reconstruct.h>

#include <iostream>

int main(int argc, char** argv) try {
  if (argc != 3) throw tomofield::Error("usage: reconstruct_project FOLDER OUTPUT");
  tomofield::Project project = tomofield::open_project({.path = argv[1]});
  project.options.run.output = argv[2];
  tomofield::reconstruct(tomofield::TiltSeries::from_files(project.files), project.options);
} catch (const tomofield::Error& error) {
  std::cerr << error.what() << '\n';
  return 2;
}
