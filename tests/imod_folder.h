#pragma once

#include <fmt/format.h>

#include <map>
#include <string>
#include <vector>

#include "expect_parts.h"
#include "pixel_stack.h"
#include "projects/project.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::testing {

using projects::Project;
using projects::read_project;
using Values = std::map<std::string, std::string>;

/// An eTomo folder of a raw stack of 40 × 60 pixels whose tilt axis lies along X: aligned views
/// have 60 × 40 pixels.
class ImodFolder {
 public:
  ImodFolder() {
    write_stack(folder / "TS.st", 40, 60, 5, some_value);
    std::string transforms;
    for (int i = 0; i < 5; ++i) transforms += "-0.17 -0.98 0.98 -0.17 3 4\n";
    folder.write("TS.xf", transforms);
    folder.write("TS.xtilt", "0\n0\n0\n0\n0\n");
  }

  // Writes tilt.com, as eTomo lays it out, with more entries.
  void write_tilt(const std::string& entries) const {
    folder.write("tilt.com",
                 "$setenv IMOD_OUTPUT_FORMAT MRC\n$tilt -StandardInput\nInputProjections "
                 "TS_ali.mrc\nOutputFile TS_full_rec.mrc\nTILTFILE TS.tlt\n" +
                     entries + "ActionIfGPUFails 1,2\n$if (-e ./savework) ./savework\n");
  }
  void write_newst(const std::string& entries) const {
    folder.write("newst.com",
                 "$setenv IMOD_OUTPUT_FORMAT MRC\n$newstack -StandardInput\nAntialiasFilter\t-1\n"
                 "InputFile\tTS.st\nOutputFile\tTS_ali.mrc\nTransformFile\tTS.xf\n" +
                     entries + "#DistortionField\t.idf\n$if (-e ./savework) ./savework\n");
  }
  Project read(const std::vector<std::string>& ignored = {}) const {
    return *read_project({.path = folder.path(), .ignored = ignored});
  }
  // Returns the values of the settings by their options.
  Values values(const std::vector<std::string>& ignored = {}) const {
    Values found;
    const Project project = read(ignored);
    for (const auto& setting : project.settings()) found[setting.option] = setting.value;
    return found;
  }
  // Returns the warnings, a line each.
  std::string warnings(const std::vector<std::string>& ignored = {}) const {
    return fmt::format("{}", fmt::join(read(ignored).warnings(), "\n"));
  }
  std::string refusal(const std::vector<std::string>& ignored = {}) const {
    return message_of<Error>([&] { read(ignored); });
  }

  ScratchDirectory folder;
};

}  // namespace tomofield::testing
