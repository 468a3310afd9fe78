#include "reconstruct/run_files.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "expect_parts.h"
#include "options/run_options.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::reconstruction {
namespace {

Options good_options() {
  Options options;
  options.specimen.thickness = 100;
  return options;
}

TEST(OutputsOfTiles, ReplaceNoOtherModel) {
  const testing::ScratchDirectory scratch;
  const std::filesystem::path model = scratch / "TS_tiles.h5";  // of -o TS_tiles.mrc
  std::ofstream(model) << "a model";
  Options options = good_options();
  options.run.output = scratch / "TS.mrc";
  check_options(options::run_options({}, options));
  options.field.budget = "0.1dB";
  const auto message = [&](const SeriesFiles& files) {
    return testing::message_of<Error>([&] { check_options(options::run_options(files, options)); });
  };
  EXPECT_NE(message({}).find(model.string() + "' exists"), std::string::npos);
  SeriesFiles files;
  files.stack = model;
  options.run.overwrite = true;
  EXPECT_NE(message(files).find("would replace the input"), std::string::npos);
  check_options(options::run_options({}, options));
  options.run.overwrite = false;
  options.field.tile_rows = 0;
  check_options(options::run_options({}, options));
}

TEST(OutputsOfTiles, AreLocked) {
  const testing::ScratchDirectory scratch;
  Options options = good_options();
  options.run.output = scratch / "TS.mrc";
  options.field.budget = "0.1dB";
  const auto locks = claim_outputs(options::run_options({}, options));
  EXPECT_TRUE(std::filesystem::exists(scratch / ".TS_tiles.h5.tomofield-lock"));
}

}  // namespace
}  // namespace tomofield::reconstruction
