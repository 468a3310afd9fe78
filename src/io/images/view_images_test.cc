#include "io/images/view_images.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "expect_parts.h"
#include "io/images/image_stack.h"
#include "io/images/mrc.h"
#include "pixel_stack.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using testing::expect_parts;
using testing::message_of;
using testing::ScratchDirectory;
using testing::write_stack;

// Writes a stack whose pixels are 100 times the section plus `base`.
std::filesystem::path stack(const std::filesystem::path& path, std::int64_t num_sections,
                            float base, std::int64_t width = 4) {
  std::filesystem::create_directories(path.parent_path());
  return write_stack(path, width, 3, num_sections,
                     [=](std::int64_t, std::int64_t, std::int64_t section) {
                       return base + 100.0f * static_cast<float>(section);
                     });
}

TEST(ViewImages, HaveTheNamesOfRelion) {
  EXPECT_EQ(parse_image_name("d/a.mrc").file, "d/a.mrc");
  EXPECT_EQ(parse_image_name("d/a.mrc").section, std::nullopt);
  EXPECT_EQ(parse_image_name("000012@d/s.mrcs").file, "d/s.mrcs");
  EXPECT_EQ(parse_image_name("000012@d/s.mrcs").section, 11);
  EXPECT_EQ(parse_image_name("000012@d/s.st:mrc").file, "d/s.st");
  EXPECT_EQ(parse_image_name("d/s.st:mrcs").file, "d/s.st");
  for (const char* bad : {"0@s.mrc", "-1@s.mrc", "x@s.mrc", "@s.mrc"})
    expect_parts(message_of<Error>([&] { parse_image_name(bad); }), {bad, "000001@"});
}

TEST(ViewImages, AreFoundFromTheProjectsFolder) {
  const ScratchDirectory scratch;
  stack(scratch / "Motion/a.mrc", 1, 1.0f);
  std::filesystem::create_directories(scratch / "Tomograms/job009");
  const auto list = scratch / "Tomograms/job009/TS.star";
  EXPECT_EQ(find_listed_file("Motion/a.mrc", list), scratch / "Motion/a.mrc");
  expect_parts(message_of<Error>([&] { find_listed_file("Motion/b.mrc", list); }),
               {"TS.star", "Motion/b.mrc", "project's folder"});
}

// Makes a folder the current one for as long as it lives.
class Inside {
 public:
  explicit Inside(const std::filesystem::path& folder) { std::filesystem::current_path(folder); }
  ~Inside() { std::filesystem::current_path(before_); }
  Inside(const Inside&) = delete;
  Inside& operator=(const Inside&) = delete;

 private:
  std::filesystem::path before_ = std::filesystem::current_path();
};

// Projects name their files alike.
TEST(ViewImages, AreThoseOfTheTablesProjectAndOfNoOther) {
  const ScratchDirectory scratch;
  const std::string table =
      "data_t\nloop_\n_rlnMicrographName #1\n_rlnTomoYTilt #2\n_rlnTomoZRot #3\n"
      "_rlnTomoXShiftAngst #4\n_rlnTomoYShiftAngst #5\nMotion/a.mrc 0 0 0 0\nMotion/b.mrc 3 0 0 "
      "0\n";
  for (const char* project : {"A", "B", "A/backup"}) {
    for (const char* name : {"Motion/a.mrc", "Motion/b.mrc"})
      stack(scratch / project / name, 1, 1.0f);
    std::filesystem::create_directories(scratch / project / "Tomograms/job009");
    scratch.write(std::string(project) + "/Tomograms/job009/TS.star", table);
  }
  const std::filesystem::path list = "Tomograms/job009/TS.star";
  const auto images = [](const std::filesystem::path& file) {
    std::vector<std::filesystem::path> files;
    for (const ImageInFile& image : find_view_images(read_view_table(file)))
      files.push_back(std::filesystem::absolute(image.file).lexically_normal());
    return files;
  };
  const auto images_of = [&](const char* project) {
    return std::vector<std::filesystem::path>{scratch / project / "Motion/a.mrc",
                                              scratch / project / "Motion/b.mrc"};
  };
  const Inside inside(scratch / "B");
  EXPECT_EQ(images(list), images_of("B"));
  EXPECT_EQ(find_listed_file("Motion/a.mrc", list), "Motion/a.mrc") << "relative, as the list";
  for (const auto& of_a : {scratch / "A" / list, "../A" / list})
    EXPECT_EQ(images(of_a), images_of("A"));
  EXPECT_EQ(images(scratch / "A/backup" / list), images_of("A/backup"));
  std::filesystem::remove(scratch / "A/Motion/b.mrc");
  expect_parts(message_of<Error>([&] { images(scratch / "A" / list); }),
               {"TS.star', row 2", "Motion/b.mrc", "is not in", "/A'"});
  // A table that was copied out of its project is used from the project's folder.
  std::filesystem::create_directories(scratch / "copies");
  EXPECT_EQ(images(scratch.write("copies/TS.star", table)), images_of("B"));
}

TEST(ViewImages, OfAProjectThatWasMovedAreAllInTheNewPlace) {
  const ScratchDirectory scratch;
  const auto table = [&](const std::string& folder) {
    return "data_t\nloop_\n_rlnMicrographName #1\n_rlnTomoYTilt #2\n_rlnTomoZRot #3\n"
           "_rlnTomoXShiftAngst #4\n_rlnTomoYShiftAngst #5\n" +
           folder + "/Motion/a.mrc 0 0 0 0\n" + folder + "/Motion/b.mrc 3 0 0 0\n";
  };
  for (const char* name : {"Motion/a.mrc", "Motion/b.mrc"}) stack(scratch / "new" / name, 1, 1.0f);
  const auto list = scratch.write("new/TS.star", table((scratch / "old").string()));
  const auto first = [&] { return find_view_images(read_view_table(list)).front().file; };
  EXPECT_EQ(first(), scratch / "new/Motion/a.mrc");
  stack(scratch / "old/Motion/b.mrc", 1, 2.0f);
  expect_parts(message_of<Error>([&] { first(); }), {"TS.star", "row 2", "row 1", "of one place"});
  stack(scratch / "old/Motion/a.mrc", 1, 2.0f);
  EXPECT_EQ(first(), scratch / "old/Motion/a.mrc");
}

TEST(ViewImages, WhoseTiltAxesDifferSaySo) {
  const ScratchDirectory scratch;
  const auto image = [&](const char* name, const char* axis) {
    MrcSpec spec{.nx = 4, .ny = 3, .nz = 1, .mode = MrcMode::kInt16, .labels = {}};
    spec.labels = {std::string("Tilt axis angle = ") + axis + ", binning = 1"};
    MrcWriter(scratch / name, spec).close();
    return ImageInFile{.file = scratch / name, .section = {}};
  };
  const auto difference = [&](const char* second) {
    return fmt::format(
        "{}", fmt::join(image_stack_of_files({image("a.mrc", "85.3"), image("b.mrc", second)},
                                             "the images")
                            ->header()
                            .differences,
                        "; "));
  };
  EXPECT_EQ(difference("85"), "");
  expect_parts(difference("12"), {"a tilt axis in degrees of 12 in", "b.mrc", "85.3"});
}

TEST(ViewImages, AreNotTheSameOneForTwoViews) {
  const ScratchDirectory scratch;
  stack(scratch / "d/s.mrc", 3, 1.0f);
  std::filesystem::create_symlink("s.mrc", scratch / "d/link.mrc");
  const std::filesystem::path file = scratch / "d/s.mrc";
  const auto refusal = [&](const ImageInFile& second) {
    return message_of<Error>([&] {
      image_stack_of_files({{.file = file, .section = 1}, second}, "the images");
    });
  };
  EXPECT_EQ(refusal({.file = file, .section = 2}), "");
  for (const char* spelling : {"d/s.mrc", "d/../d/s.mrc", "d/./s.mrc", "d/link.mrc"})
    expect_parts(refusal({.file = scratch / spelling, .section = 1}),
                 {"the images", "views 1 and 2", "same image"});
}

TEST(ViewImages, MayBeSectionsOfAStack) {
  const ScratchDirectory scratch;
  stack(scratch / "s.mrc", 3, 2.0f);
  const std::string head =
      "data_t\nloop_\n_rlnMicrographName #1\n_rlnTomoYTilt #2\n_rlnTomoZRot #3\n"
      "_rlnTomoXShiftAngst #4\n_rlnTomoYShiftAngst #5\n";
  const auto images =
      open_image_stack(scratch.write("t.star", head + "3@s.mrc 0 0 0 0\n1@s.mrc 3 0 0 0\n"));
  EXPECT_EQ(images->header().nz, 2);
  std::vector<float> image(12);
  images->read_section(0, image);
  EXPECT_EQ(image[0], 202.0f);
  // A table that names itself would never end.
  expect_parts(message_of<Error>([&] {
                 open_image_stack(scratch.write("self.star", head + "self.star 0 0 0 0\n"));
               }),
               {"self.star", "row 1", "no file of images"});
}

TEST(ViewImages, OfWarpAreTheAveragesBesideTheMovies) {
  const ScratchDirectory scratch;
  stack(scratch / "frames/average/a.mrc", 1, 1.0f);
  stack(scratch / "frames/average/even/a.mrc", 1, 2.0f);
  std::filesystem::create_directories(scratch / "tomostar");
  const auto tomostar =
      scratch.write("tomostar/a.tomostar",
                    "data_\nloop_\n_wrpMovieName #1\n_wrpAngleTilt #2\n../frames/a.eer 3\n");
  const auto first_pixel = [&](const std::string& frames) {
    std::vector<float> image(12);
    open_image_stack(frames + tomostar.string())->read_section(0, image);
    return image[0];
  };
  EXPECT_EQ(first_pixel(""), 1.0f);
  EXPECT_EQ(first_pixel("even@"), 2.0f);
  // The current folder may be that of another project.
  const std::filesystem::path before = std::filesystem::current_path();
  stack(scratch / "other/frames/average/a.mrc", 1, 3.0f);
  std::filesystem::create_directories(scratch / "other/tomostar");
  std::filesystem::current_path(scratch / "other/tomostar");
  EXPECT_EQ(first_pixel(""), 1.0f);
  std::filesystem::current_path(before);
  expect_parts(message_of<Error>([&] { first_pixel("odd@"); }),
               {"a.tomostar", "row 1", "average/odd/a.mrc", "--out_average_halves"});
}

}  // namespace
}  // namespace tomofield::io
