#include "checkpoint/checkpoint.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "scratch_directory.h"
#include "small_fit.h"
#include "tomofield/error.h"

namespace tomofield::checkpoint {
namespace {

using testing::message_of;

constexpr const char* kFingerprint = testing::SmallFit::kFingerprint;

// Makes fits of a small series and keeps them in a file.
class Checkpoint : public ::testing::Test {
 protected:
  std::unique_ptr<fit::Fit> make_fit() const { return series_.make(); }
  // Returns a fit that was stopped after some steps.
  std::unique_ptr<fit::Fit> stopped_fit(std::int64_t steps) const {
    return stopped_fit(steps, series_.field());
  }
  std::unique_ptr<fit::Fit> stopped_fit(std::int64_t steps, const FieldOptions& field) const {
    auto fit = series_.make(field);
    fit->run([&](const fit::Fit& f) { return f.progress().step != steps; });
    EXPECT_EQ(fit->progress().step, steps);
    return fit;
  }
  static std::vector<float> parameters(const fit::Fit& fit) {
    return {fit.field().parameters().begin(), fit.field().parameters().end()};
  }
  static tune::TunedFit tuned() {
    const tune::TrialSettings chosen{Penalty::kSmooth, 2.5, 8, 20};
    return {.settings = chosen,
            .trials = {{chosen, {1.25, {1.0, 1.5}}, 3.0}},
            .predicted_views = {4, 12}};
  }

  testing::SmallFit series_;
  testing::ScratchDirectory scratch_;
  std::filesystem::path file_ = scratch_ / "fit.h5";
};

TEST_F(Checkpoint, RestoresTheSameBitsAndGoesOnToTheSameBits) {
  const auto whole = make_fit();
  whole->run([](const fit::Fit&) { return true; });
  // In the first epoch, between two, in the second, and after the noise of the views was fitted.
  for (const std::int64_t steps : {1, 4, 7, 10}) {
    const auto stopped = stopped_fit(steps);
    save_checkpoint(file_, *stopped, series_.info(), {.fingerprint = kFingerprint, .tuned = {}});
    const auto restored = make_fit();
    restore_fit(file_, kFingerprint, *restored);
    EXPECT_EQ(restored->progress().step, steps);
    EXPECT_EQ(parameters(*restored), parameters(*stopped));
    EXPECT_EQ(restored->progress().data_loss, stopped->progress().data_loss);
    restored->run([](const fit::Fit&) { return true; });
    EXPECT_EQ(parameters(*restored), parameters(*whole)) << steps;
    EXPECT_EQ(restored->progress().data_loss, whole->progress().data_loss);
  }
}

TEST_F(Checkpoint, AFinishedModelNeedsNoOptimiserState) {
  const auto whole = make_fit();
  whole->run([](const fit::Fit&) { return true; });
  save_fit(file_, *whole, series_.info(), progress_state(*whole, {kFingerprint, {}}));
  const auto restored = make_fit();
  restore_fit(file_, kFingerprint, *restored);
  EXPECT_TRUE(restored->is_done());
  EXPECT_EQ(parameters(*restored), parameters(*whole));
}

TEST_F(Checkpoint, AModelBetweenTwoStepsIsNone) {
  const auto stopped = stopped_fit(5);
  save_fit(file_, *stopped, series_.info(), progress_state(*stopped, {kFingerprint, {}}));
  const auto restored = make_fit();
  const std::string message =
      message_of<Error>([&] { restore_fit(file_, kFingerprint, *restored); });
  EXPECT_NE(message.find(file_.string()), std::string::npos) << message;
}

TEST_F(Checkpoint, AnotherFingerprintIsRefusedAndWhatDiffersIsNamed) {
  const auto stopped = stopped_fit(2);
  save_checkpoint(file_, *stopped, series_.info(), {.fingerprint = kFingerprint, .tuned = {}});
  const auto complaint = [&](const std::string& fingerprint) {
    const auto fit = make_fit();
    const auto before = parameters(*fit);
    const std::string message = message_of<Error>([&] { restore_fit(file_, fingerprint, *fit); });
    EXPECT_EQ(parameters(*fit), before) << "a refused checkpoint leaves the fit as it is";
    return message;
  };
  const std::string seed = complaint(R"({"fit":{"seed":2},"rays":12})");
  EXPECT_NE(seed.find(file_.string()), std::string::npos) << seed;
  EXPECT_NE(seed.find("--seed"), std::string::npos) << seed;
  EXPECT_EQ(seed.find("the tilt series"), std::string::npos) << seed;
  const std::string rays = complaint(R"({"fit":{"seed":1},"rays":13})");
  EXPECT_NE(rays.find("the tilt series"), std::string::npos) << rays;
  EXPECT_EQ(rays.find("--seed"), std::string::npos) << rays;
}

TEST_F(Checkpoint, KeepsWhatTheOptionsWereChosenBy) {
  const auto stopped = stopped_fit(2);
  save_checkpoint(file_, *stopped, series_.info(), {.fingerprint = kFingerprint, .tuned = {}});
  EXPECT_FALSE(stored_choice(file_).has_value());
  save_checkpoint(file_, *stopped, series_.info(), {.fingerprint = kFingerprint, .tuned = tuned()});
  const auto stored = stored_choice(file_);
  ASSERT_TRUE(stored.has_value());
  EXPECT_EQ(stored->settings, tuned().settings);
  EXPECT_EQ(stored->predicted_views, tuned().predicted_views);
  ASSERT_EQ(stored->trials.size(), 1u);
  EXPECT_EQ(stored->trials[0].settings, tuned().trials[0].settings);
  EXPECT_EQ(stored->trials[0].score.view_error, tuned().trials[0].score.view_error);
}

TEST_F(Checkpoint, TheSameFitGivesTheSameBytesWheneverItIsMade) {
  tune::Tuned slower = tuned();
  slower.trials[0].seconds = 99;
  const auto stopped = stopped_fit(2);
  save_checkpoint(file_, *stopped, series_.info(), {kFingerprint, tuned()});
  save_checkpoint(scratch_ / "again.h5", *stopped, series_.info(), {kFingerprint, slower});
  EXPECT_EQ(testing::read_whole_file(file_), testing::read_whole_file(scratch_ / "again.h5"));
}

// Saves a checkpoint after seven steps with one change of its state, and returns why it is refused.
template <typename Change>
std::string refusal_after(const fit::Fit& stopped, fit::Fit& restored,
                          const output::ModelInfo& info, const std::filesystem::path& file,
                          Change&& change) {
  save_checkpoint(file, stopped, info, {.fingerprint = kFingerprint, .tuned = {}});
  output::TrainingState state;
  const output::Model model = output::load_model(file, &state);
  change(state);
  output::save_model(file, model, &state);
  return message_of<Error>([&] { restore_fit(file, kFingerprint, restored); });
}

TEST_F(Checkpoint, AStateThatTheSeriesAndTheOptionsCannotHaveIsRefused) {
  const auto stopped = stopped_fit(7);
  using State = output::TrainingState;
  const double nan = std::nan("");
  const std::vector<std::function<void(State&)>> changes = {
      [](State& s) { s.integers["step"] = {}; },
      [](State& s) { s.integers["step"] = {-1}; },
      [](State& s) { s.integers["step"] = {1 << 30}; },
      [](State& s) { s.integers["step"] = {1}; },  // with the loss of an epoch
      [](State& s) {
        s.integers["step"] = {7, 7};
      },
      [](State& s) { s.doubles["views"].pop_back(); },
      [](State& s) { s.doubles["views"].resize(3); },
      [&](State& s) { s.doubles["views"][0] = nan; },
      [](State& s) { s.doubles["views"][2] = 0; },
      [](State& s) { s.doubles["views"][0] = 0; },  // the scale of the first view
      [](State& s) { s.doubles["views"][0] = -1; },
      [](State& s) { s.doubles["views"][0] = 1e30; },
      [](State& s) { s.doubles["views"][1] = 1e300; },
      [](State& s) { s.doubles["epoch_sums"].resize(6); },
      [&](State& s) { s.doubles["epoch_sums"][1] = nan; },
      [&](State& s) { s.doubles["epoch_sums"][6] = nan; },  // the limited squares of the first view
      [](State& s) { s.doubles["data_loss"].clear(); },
      [](State& s) { std::ranges::fill(s.doubles["data_loss"], 1e300); },
      [](State& s) { std::ranges::fill(s.doubles["data_loss"], std::nan("")); },
      [](State& s) { s.doubles["view_residual"].resize(1); },
      [](State& s) { s.doubles["view_residual"].assign(s.doubles["view_residual"].size(), -1); },
      [](State& s) { s.doubles["held_out_error"] = {1}; },
      [](State& s) { s.integers["tree_updates"] = {}; },
      [](State& s) {
        s.integers["tree_updates"] = {0, 1, 2, 3, -1};
      },
      [](State& s) {
        s.integers["tree_updates"] = {0, 1, 2, 3, std::int64_t{1} << 62};
      },
      [](State& s) { s.doubles["tree_errors"] = {1}; },
      [](State& s) {
        s.integers["tree_updates"] = {0, 1, 2, 3, 0};
        s.doubles["tree_errors"] = {1, 1};
      },
      [](State& s) { s.integers["leaf_steps"].pop_back(); },
      [](State& s) { s.integers["leaf_steps"][0] = -1; },
      [](State& s) { s.integers["leaf_steps"][0] = 8; },
      [](State& s) { s.integers["bias_steps"] = {8}; },
      [](State& s) { s.doubles["bias_moments"] = {1}; },
      [](State& s) {
        s.doubles["bias_moments"] = {0, -1};
      },
      [](State& s) { s.floats["adam_m"].pop_back(); },
      [](State& s) { s.floats["adam_v"][1] = -1; },
      [](State& s) { s.floats["adam_m"][1] = std::nanf(""); },
      [](State& s) { s.floats.erase("adam_v"); },
  };
  EXPECT_EQ(refusal_after(*stopped, *make_fit(), series_.info(), file_, [](State&) {}), "");
  for (std::size_t i = 0; i < changes.size(); ++i) {
    const std::string said =
        refusal_after(*stopped, *make_fit(), series_.info(), file_, changes[i]);
    EXPECT_NE(said.find(file_.string()), std::string::npos) << "change " << i << ": " << said;
  }
}

TEST_F(Checkpoint, AFieldOfOtherLeavesIsRefused) {
  const auto stopped = stopped_fit(7);
  const auto refusal = [&](const fit::Fit& other) {
    save_checkpoint(file_, other, series_.info(), {.fingerprint = kFingerprint, .tuned = {}});
    const auto restored = make_fit();
    return message_of<Error>([&] { restore_fit(file_, kFingerprint, *restored); });
  };
  EXPECT_EQ(refusal(*stopped), "");
  FieldOptions large = series_.field(), rich = series_.field(), grid = series_.field();
  large.leaf_size = 32;
  rich.rank = 3;
  grid.kind = FieldKind::kGrid;
  EXPECT_NE(refusal(*stopped_fit(7, large)).find("root cells"), std::string::npos);
  EXPECT_NE(refusal(*stopped_fit(7, rich)).find("ranks"), std::string::npos);
  EXPECT_NE(refusal(*stopped_fit(7, grid)).find("field"), std::string::npos);
  // A leaf that has been split.
  const field::Field& whole = stopped->field();
  const auto of_large = stopped_fit(7, large);
  field::Quadtree split = of_large->field().tree();
  split.split(0);
  std::vector<field::LeafShape> shapes(static_cast<std::size_t>(split.num_leaves()),
                                       of_large->field().shape(0));
  output::Model model;
  static_cast<output::ModelInfo&>(model) = series_.info();
  model.field = field::make_field(whole.kind(), split, whole.thickness(), std::move(shapes));
  const output::TrainingState state = progress_state(*of_large, {kFingerprint, {}});
  output::save_model(file_, model, &state);
  const auto restored = series_.make(large);
  const std::string said = message_of<Error>([&] { restore_fit(file_, kFingerprint, *restored); });
  EXPECT_NE(said.find("leaves"), std::string::npos) << said;
}

TEST_F(Checkpoint, ATornFileIsRefused) {
  const auto stopped = stopped_fit(2);
  save_checkpoint(file_, *stopped, series_.info(), {.fingerprint = kFingerprint, .tuned = {}});
  std::filesystem::resize_file(file_, std::filesystem::file_size(file_) / 2);
  const auto fit = make_fit();
  const std::string message = message_of<Error>([&] { restore_fit(file_, kFingerprint, *fit); });
  EXPECT_NE(message.find(file_.string()), std::string::npos) << message;
}

}  // namespace
}  // namespace tomofield::checkpoint
