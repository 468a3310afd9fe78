#include "realign/alignment_origin_record.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "io/json.h"
#include "pixel_stack.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::realign {
namespace {

using nlohmann::json;

constexpr int kNumViews = 15;

// Writes and reads the record of an alignment of a small series.
class AlignmentRecord : public ::testing::Test {
 protected:
  AlignmentRecord() {
    write_series(scratch_.path(), 0);
    record_ = alignment::to_json(alignment::make_record(
        alignment_origin(run()), tilt_series::PlannedSeries(run().input()), found(), 1.5));
    io::write_json(file_, record_);
  }

  static void write_series(const std::filesystem::path& folder, float change,
                           int num_views = kNumViews) {
    testing::write_stack(folder / "series.mrc", 32, 24, num_views,
                         [&](std::int64_t x, std::int64_t y, std::int64_t z) {
                           return testing::some_value(x, y, z) + (z == 0 ? change : 0);
                         });
    std::ofstream tilts(folder / "series.tlt");
    for (int view = 0; view < num_views; ++view) tilts << 8 * view - 56 << '\n';
  }

  options::ReconstructOptions run() const { return run_of(scratch_.path(), options_); }

  static options::ReconstructOptions run_of(const std::filesystem::path& folder,
                                            const Options& options) {
    SeriesFiles files;
    files.stack = folder / "series.mrc";
    files.tlt = folder / "series.tlt";
    return options::run_options(files, options);
  }

  static Options some_options() {
    Options options;
    options.views.contrast = Contrast::kBright;
    options.specimen.thickness = 16;
    options.run.align = Alignment::kRefine;
    return options;
  }

  // Returns an alignment with shifts and local motion, which leaves the third view out.
  static alignment::Alignment found() {
    alignment::Alignment made;
    made.is_accepted = true;
    made.held_out = {.before = 0.5, .after = 0.4, .gain = {.mean = 0.1, .error = 0.01}};
    made.local =
        alignment::LocalTrial{.held_out = made.held_out, .steps_px = {0.1}, .is_accepted = true};
    made.joint.agreement.resize(kNumViews);
    made.unaligned = {2};
    for (int view = 0; view < kNumViews; ++view) {
      geometry::ViewWarp motion{.width_px = 32, .height_px = 24};
      motion.nodes[7] = {0.25, -0.5};
      made.corrections.push_back({.shift_x_px = 0.5 * view,
                                  .shift_y_px = -0.25,
                                  .rotation_rad = 0.0,
                                  .log_magnification = 0.125,
                                  .tilt_deg = 0.5,
                                  .local = motion});
    }
    return made;
  }

  static std::vector<std::int64_t> all_sections() {
    std::vector<std::int64_t> sections(kNumViews);
    std::iota(sections.begin(), sections.end(), 0);
    return sections;
  }

  // Returns why a run does not resume from the record, or "" if it does.
  std::string refusal(const options::ReconstructOptions& options) const {
    const alignment::AlignmentOrigin origin = alignment_origin(options);
    return testing::message_of<Error>(
        [&] { read_alignment_record(file_, origin, all_sections()); });
  }

  testing::ScratchDirectory scratch_;
  const std::filesystem::path file_ = scratch_ / "TS_align.json";
  const Options options_ = some_options();
  json record_;
};

TEST_F(AlignmentRecord, IsReadAsItWasWritten) {
  options::ReconstructOptions options = run();
  const alignment::AlignmentRecord read =
      read_alignment_record(file_, alignment_origin(options), all_sections());
  EXPECT_EQ(alignment::to_json(read), record_);
  apply_alignment(read, options);
  EXPECT_EQ(options.corrections, found().corrections);
  EXPECT_EQ(options.left_out, (std::vector<std::int64_t>{2}));
}

TEST_F(AlignmentRecord, HasAllViewsOfTheSeries) {
  for (const int view : {0, 5, kNumViews - 1}) {
    json cut = record_;
    cut["views"].erase(static_cast<std::size_t>(view));
    io::write_json(file_, cut);
    EXPECT_NE(refusal(run()).find("its 14 views are not the 15 of the series"), std::string::npos)
        << refusal(run());
  }
}

TEST_F(AlignmentRecord, HasAPoseThatCanBe) {
  const auto refusal_of = [&](const char* key, double number) {
    record_["pose"] = {{"pitch_deg", 3.0},     {"pitch_error_deg", 0.5},
                       {"x_tilt_deg", -2.0},   {"x_tilt_error_deg", 0.5},
                       {"thickness_px", 20.0}, {"thickness_error_px", 2.0}};
    record_["pose"][key] = number;
    io::write_json(file_, record_);
    return refusal(run());
  };
  EXPECT_EQ(refusal_of("pitch_deg", 6.0), "");
  for (const auto& [key, number] :
       std::vector<std::pair<const char*, double>>{{"pitch_deg", -5e8},
                                                   {"pitch_deg", 91},
                                                   {"x_tilt_deg", -91},
                                                   {"pitch_error_deg", -0.1},
                                                   {"thickness_px", 0},
                                                   {"thickness_px", -20},
                                                   {"thickness_px", 1e9},
                                                   {"x_tilt_error_deg", -1}})
    EXPECT_NE(refusal_of(key, number).find(key), std::string::npos) << key << " " << number;
}

TEST_F(AlignmentRecord, IsOfOneSeries) {
  const testing::ScratchDirectory other;
  write_series(other.path(), 0);
  EXPECT_EQ(refusal(run_of(other.path(), options_)), "");  // a copy
  write_series(other.path(), 3);
  EXPECT_NE(refusal(run_of(other.path(), options_)).find("images"), std::string::npos);
  write_series(other.path(), 0, kNumViews + 2);
  const std::string longer = refusal(run_of(other.path(), options_));
  for (const char* word : {"15 sections", "17 sections", "TS_align.json", "--overwrite"})
    EXPECT_NE(longer.find(word), std::string::npos) << word << " in " << longer;
  write_series(other.path(), 0);
  std::ofstream(other / "series.tlt", std::ios::app) << "\n";
  EXPECT_NE(refusal(run_of(other.path(), options_)), "");
}

TEST_F(AlignmentRecord, IsOfTheOptionsThatItDependsOn) {
  const auto refusal_with = [&](const auto& change) {
    Options options = options_;
    change(options);
    return refusal(run_of(scratch_.path(), options));
  };
  for (const std::string& message :
       {refusal_with([](Options& options) { options.run.align = Alignment::kFull; }),
        refusal_with([](Options& options) { options.field.with_margin = false; }),
        refusal_with([](Options& options) { options.field.vertex_spacing = 2; }),
        refusal_with([](Options& options) { options.specimen.thickness = 20; }),
        refusal_with([](Options& options) { options.fit.seed = 2; })})
    EXPECT_NE(message.find("other options"), std::string::npos) << message;
  EXPECT_EQ(refusal_with([](Options& options) { options.fit.epochs = 3; }), "");
  EXPECT_EQ(refusal_with([](Options& options) { options.field.vertex_spacing = 0.5; }), "");
}

TEST_F(AlignmentRecord, KnowsThatNoneIsNoFile) {
  options::ReconstructOptions options = run();
  options.files.ctf = "none";
  EXPECT_FALSE(alignment_origin(options).files.contains("ctf"));
  options.files.ctf = scratch_.write("series.defocus", "1 1 0 0 3000 2\n");
  EXPECT_TRUE(alignment_origin(options).files.contains("ctf"));
}

TEST_F(AlignmentRecord, IsRefusedIfItIsDamaged) {
  const auto refuse = [&](const std::string& text, const std::string& word) {
    std::ofstream(file_) << text;
    const std::string message = refusal(run());
    for (const std::string& part : {file_.string(), std::string("--overwrite"), word})
      EXPECT_NE(message.find(part), std::string::npos) << part << " in " << message;
  };
  const std::string whole = io::json_text(record_);
  refuse("", "");
  refuse(whole.substr(0, whole.size() / 2), "");
  refuse("[1, 2]", "series");
  for (const auto& part : record_.items()) {
    json damaged = record_;
    damaged.erase(part.key());
    refuse(io::json_text(damaged), "");
  }
  const auto refuse_change = [&](const char* pointer, const json& value, const char* word) {
    json damaged = record_;
    damaged[json::json_pointer(pointer)] = value;
    refuse(io::json_text(damaged), word);
  };
  refuse_change("/views/0/section", 0, "section");
  refuse_change("/views/0/section", kNumViews + 1, "section");
  refuse_change("/views/1/section", 1, "section");
  refuse_change("/views/3/shift_px/1", nullptr, "shift_px");
  refuse_change("/views/3/shift_px", json::array({1}), "shift_px");
  refuse_change("/views/3/rotation_deg", "1", "rotation_deg");
  refuse_change("/views/3/tilt_change_deg", 360, "tilt_change_deg");
  refuse_change("/views/3/tilt_deg", 200, "tilt_deg");
  refuse_change("/views/3/log_magnification", 3, "log_magnification");
  refuse_change("/views/3/left_out", 1, "left_out");
  refuse_change("/views/3/local_px/4/4/1", nullptr, "local_px");
  refuse_change("/views/3/local_px/4", json::array({0}), "local_px");
  refuse_change("/local/size_px/0", 0, "size_px");
  refuse_change("/local/accepted", false, "local");
  refuse_change("/gain/standard_error", nullptr, "standard_error");
  refuse_change("/views", json::object(), "views");
  refuse_change("/series/sections", nullptr, "sections");
}

TEST_F(AlignmentRecord, IsNotAwaitedFromAPipe) {
  std::filesystem::remove(file_);
  ASSERT_EQ(mkfifo(file_.c_str(), 0600), 0);
  EXPECT_NE(refusal(run()).find(file_.string()), std::string::npos);
}

}  // namespace
}  // namespace tomofield::realign
