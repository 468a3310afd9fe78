#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <thread>

#include "base/random.h"
#include "io/images/mrc.h"
#include "pixel_stack.h"
#include "scratch_directory.h"
#include "simulate/project_phantom.h"
#include "tomofield/error.h"
#include "tomofield/messages.h"
#include "tomofield/reconstruct.h"

namespace tomofield {
namespace {

using testing::message_of;
using testing::ScratchDirectory;

// Two spheres, 13 noisy views of 32 × 20 pixels of 5 Å.
ViewImages spheres() {
  ViewImages images{.values = {}, .width = 32, .height = 20, .tilt_deg = {}, .pixel_size_A = 5.0};
  const std::vector<simulate::Ellipsoid> bodies{simulate::make_sphere({-4.2, -3.1, 1.3}, 5.1, 1.0),
                                                simulate::make_sphere({6.3, 3.4, -1.2}, 3.2, 0.8)};
  base::Random random(5);
  for (double tilt = -60; tilt <= 60; tilt += 10) {
    images.tilt_deg.push_back(tilt);
    for (const double value :
         simulate::project_ellipsoids(bodies, {.width = 32, .height = 20, .tilt_deg = tilt}))
      images.values.push_back(static_cast<float>(value + 0.2 * random.normal()));
  }
  return images;
}

// Writes the same images as files.
SeriesFiles write_files(const ViewImages& images, const ScratchDirectory& scratch) {
  SeriesFiles files;
  files.stack = testing::write_stack(
      scratch / "s.mrc", images.width, images.height, std::ssize(images.tilt_deg),
      [&](std::int64_t x, std::int64_t y, std::int64_t z) {
        return images.values[static_cast<std::size_t>((z * images.height + y) * images.width + x)];
      },
      images.pixel_size_A);
  std::string angles;
  for (const double tilt : images.tilt_deg) angles += std::to_string(tilt) + "\n";
  files.tlt = scratch.write("s.tlt", angles);
  return files;
}

Options quick_options() {
  Options options;
  options.views.contrast = Contrast::kBright;
  options.specimen.thickness = 16;
  options.field.leaf_size = 16;
  options.field.rank = 4;
  options.fit.epochs = 3;
  options.fit.coarse_epochs = 2;
  options.fit.penalty = Penalty::kConcave;
  options.fit.fit_view_scale = false;
  return options;
}

std::vector<float> read_volume(const std::filesystem::path& path) {
  const io::MrcReader file(path);
  const auto section = static_cast<std::size_t>(file.header().nx * file.header().ny);
  std::vector<float> values(section * static_cast<std::size_t>(file.header().nz));
  for (std::int64_t z = 0; z < file.header().nz; ++z)
    file.read_section(z, std::span(values).subspan(static_cast<std::size_t>(z) * section, section));
  return values;
}

TEST(PublicReconstruct, ArraysAndFilesGiveTheSameBits) {
  const ScratchDirectory scratch;
  const ViewImages images = spheres();
  Options options = quick_options();
  options.fit.hold_out = 6;
  int num_reports = 0;
  double last = 0;
  const Reconstruction in_memory =
      reconstruct(TiltSeries::from_images(images), options, [&](const Progress& progress) {
        ++num_reports;
        EXPECT_GE(progress.fraction_done, last);
        last = progress.fraction_done;
        return true;
      });
  EXPECT_GT(num_reports, 5);
  EXPECT_EQ(last, 1.0);
  EXPECT_EQ(scratch.num_files(), 0u);

  const SeriesFiles files = write_files(images, scratch);
  options.run.output = scratch / "tomogram.mrc";
  const Reconstruction on_disk = reconstruct(TiltSeries::from_files(files), options);
  ASSERT_TRUE(in_memory.is_finished && on_disk.is_finished);
  ASSERT_TRUE(in_memory.tomogram && in_memory.model && on_disk.model);
  EXPECT_FALSE(on_disk.tomogram);
  EXPECT_EQ(in_memory.tomogram->size, (std::array<std::int64_t, 3>{32, 20, 16}));
  EXPECT_EQ(in_memory.tomogram->voxel_size_A, 5.0);
  const std::vector<float> written = read_volume(options.run.output);
  EXPECT_EQ(in_memory.tomogram->values, written);
  EXPECT_EQ(in_memory.model->sample(in_memory.model->region()), written);
  EXPECT_EQ(on_disk.model->sample(on_disk.model->region()), written);
  EXPECT_EQ(Model(scratch / "tomogram.h5").sample(on_disk.model->region()), written);
  EXPECT_EQ(testing::read_whole_file(scratch / "tomogram.json"), on_disk.metrics);
  EXPECT_EQ(nlohmann::json::parse(in_memory.metrics)["options"]["fit"],
            nlohmann::json::parse(on_disk.metrics)["options"]["fit"]);
}

TEST(PublicReconstruct, InvertsTheTomogramAlone) {
  const TiltSeries series = TiltSeries::from_images(spheres());
  Options options = quick_options();
  const Reconstruction usual = reconstruct(series, options);
  options.volume.invert = true;
  const Reconstruction inverted = reconstruct(series, options);
  for (std::size_t i = 0; i < usual.tomogram->values.size(); ++i)
    ASSERT_EQ(inverted.tomogram->values[i], -usual.tomogram->values[i]);
  EXPECT_EQ(inverted.model->sample(inverted.model->region()), usual.tomogram->values);
}

TEST(PublicReconstruct, TunesInMemory) {
  Options options = quick_options();
  options.fit.tune = true;
  bool has_trials = false;
  const Reconstruction made =
      reconstruct(TiltSeries::from_images(spheres()), options, [&](const Progress& progress) {
        has_trials = has_trials || progress.is_trial;
        return true;
      });
  EXPECT_TRUE(made.is_finished && has_trials);
  EXPECT_NE(made.metrics.find("\"predicted_views\""), std::string::npos);
}

TEST(PublicReconstruct, TheCallbackStopsARunWhichResumes) {
  const ScratchDirectory scratch;
  const TiltSeries series = TiltSeries::from_images(spheres());
  Options options = quick_options();
  const std::vector<float> whole = reconstruct(series, options).tomogram->values;
  const auto stop = [](const Progress& progress) { return progress.fraction_done < 0.5; };
  const Reconstruction stopped = reconstruct(series, options, stop);
  EXPECT_FALSE(stopped.is_finished || stopped.tomogram || stopped.model);

  options.run.output = scratch / "tomogram.mrc";
  EXPECT_FALSE(reconstruct(series, options, stop).is_finished);
  EXPECT_TRUE(std::filesystem::exists(scratch / "tomogram.h5"));
  EXPECT_FALSE(std::filesystem::exists(scratch / "tomogram.mrc"));
  options.run.resume = true;
  double first = 0;
  const Reconstruction resumed = reconstruct(series, options, [&](const Progress& progress) {
    if (first == 0) first = progress.fraction_done;
    return true;
  });
  EXPECT_TRUE(resumed.is_finished);
  EXPECT_GT(first, 0.5);
  EXPECT_EQ(read_volume(options.run.output), whole);
}

TEST(PublicReconstruct, AnExceptionOfTheCallbackLeavesACheckpoint) {
  const ScratchDirectory scratch;
  const TiltSeries series = TiltSeries::from_images(spheres());
  Options options = quick_options();
  options.run.output = scratch / "tomogram.mrc";
  int calls_after = 0;
  const auto fail = [&, has_failed = false](const Progress& progress) mutable {
    calls_after += has_failed ? 1 : 0;
    if (progress.fraction_done < 0.5) return true;
    has_failed = true;
    throw std::domain_error("of the callback");
  };
  EXPECT_EQ(message_of<std::domain_error>([&] { reconstruct(series, options, fail); }),
            "of the callback");
  EXPECT_EQ(calls_after, 0);
  EXPECT_TRUE(std::filesystem::exists(scratch / "tomogram.h5"));
  EXPECT_FALSE(std::filesystem::exists(scratch / "tomogram.mrc"));
  options.run.resume = true;
  EXPECT_TRUE(reconstruct(series, options).is_finished);
}

TEST(PublicReconstruct, AStopAtTheEndOfTheFitOfAllDataComesInTheFirstHalf) {
  const ScratchDirectory scratch;
  const TiltSeries series = TiltSeries::from_images(spheres());
  Options options = quick_options();
  options.fit.split_tilts = true;
  const auto is_of_all = [](const Progress& progress) {
    return progress.detail.starts_with("all data");
  };
  int reports = 0, seen = 0;
  options.run.output = scratch / "whole.mrc";
  reconstruct(series, options, [&](const Progress& progress) {
    reports += is_of_all(progress) ? 1 : 0;
    return true;
  });
  ASSERT_GT(reports, 0);
  options.run.output = scratch / "stopped.mrc";
  const Reconstruction stopped = reconstruct(series, options, [&](const Progress& progress) {
    seen += is_of_all(progress) ? 1 : 0;
    return seen < reports;
  });
  EXPECT_FALSE(stopped.is_finished);
  EXPECT_TRUE(std::filesystem::exists(scratch / "stopped_EVN.h5"));
}

TEST(PublicReconstruct, AnExceptionOfTheCallbackLeavesIt) {
  const TiltSeries series = TiltSeries::from_images(spheres());
  const auto fail = [](const Progress&) -> bool { throw std::runtime_error("of the callback"); };
  EXPECT_EQ(message_of<std::runtime_error>([&] { reconstruct(series, quick_options(), fail); }),
            "of the callback");
  EXPECT_TRUE(reconstruct(series, quick_options()).is_finished);
}

TEST(PublicReconstruct, ACallbackCannotStartAnother) {
  const TiltSeries series = TiltSeries::from_images(spheres());
  const auto nested = [&](const Progress&) {
    return reconstruct(series, quick_options()).is_finished;
  };
  const std::string message =
      message_of<Error>([&] { reconstruct(series, quick_options(), nested); });
  EXPECT_NE(message.find("callback"), std::string::npos) << message;
}

TEST(PublicReconstruct, HandsItsMessagesOver) {
  ViewImages images = spheres();
  images.values[17] = std::nanf("");
  std::vector<std::string> infos, warnings;
  set_message_handler([&](MessageKind kind, std::string_view text) {
    (kind == MessageKind::kWarning ? warnings : infos).emplace_back(text);
  });
  reconstruct(TiltSeries::from_images(images), quick_options());
  set_message_handler({});
  EXPECT_FALSE(infos.empty());
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("1 NaN"), std::string::npos) << warnings[0];
  reconstruct(TiltSeries::from_images(images), quick_options());
  EXPECT_EQ(warnings.size(), 1u);
}

TEST(PublicReconstruct, RunsInAnyThreadWithTheSameBits) {
  const TiltSeries series = TiltSeries::from_images(spheres());
  const std::vector<float> here = reconstruct(series, quick_options()).tomogram->values;
  std::vector<std::vector<float>> there(2);
  std::vector<std::thread> threads;
  for (std::vector<float>& values : there)
    threads.emplace_back([&] { values = reconstruct(series, quick_options()).tomogram->values; });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(there[0], here);
  EXPECT_EQ(there[1], here);
}

TEST(PublicReconstruct, ResolvedOptionsGiveTheSameBits) {
  Options options;
  options.specimen.thickness = 16;
  options.views.contrast = Contrast::kBright;
  options.fit.epochs = 4;
  const Options resolved = resolve_options(options);
  EXPECT_EQ(resolved.fit.epochs, 4);
  EXPECT_EQ(resolved.field.leaf_size, 64);
  EXPECT_EQ(resolved.field.activation, Activation::kSoftplus);
  EXPECT_TRUE(resolved.fit.fit_view_scale.is_open());  // trials choose it
  EXPECT_TRUE(resolved.fit.penalty.is_open());
  EXPECT_TRUE(resolved.fit.density_variation.is_open());
  EXPECT_EQ(resolved.fit.epochs.origin(), Origin::kGiven);
  EXPECT_EQ(resolved.fit.learning_rate.origin(), Origin::kDerived);
  const TiltSeries series = TiltSeries::from_images(spheres());
  EXPECT_EQ(reconstruct(series, options).tomogram->values,
            reconstruct(series, resolved).tomogram->values);
  options.fit.penalty = Penalty::kSmooth;
  options.views.contrast = Contrast::kDark;
  const Options dark = resolve_options(options);
  EXPECT_EQ(dark.fit.density_variation, 5.0);
  EXPECT_EQ(dark.field.activation, Activation::kIdentity);
  EXPECT_TRUE(dark.fit.fit_view_scale.is_open());
}

TEST(PublicReconstruct, RefusesWhatCannotBeUsed) {
  const TiltSeries series = TiltSeries::from_images(spheres());
  const auto refusal = [&](const Options& options) {
    return message_of<Error>([&] { reconstruct(series, options); });
  };
  Options options = quick_options();
  options.specimen.thickness = 0;
  EXPECT_NE(refusal(options).find("thickness"), std::string::npos);
  ViewImages of_unknown_size = spheres();
  of_unknown_size.pixel_size_A = 0;
  EXPECT_NE(message_of<Error>([&] {
              reconstruct(TiltSeries::from_images(of_unknown_size), quick_options());
            }).find("have no pixel size: give it in Å with --pixel-size"),
            std::string::npos);
  options = quick_options();
  options.run.resume = true;
  EXPECT_NE(refusal(options).find("resume"), std::string::npos);
  options = quick_options();
  options.run.output = "/nonexistent/tomogram.mrc";
  EXPECT_NE(refusal(options).find("/nonexistent"), std::string::npos);
  SeriesFiles files;
  files.stack = "absent.mrc";
  EXPECT_NE(message_of<Error>([&] {
              reconstruct(TiltSeries::from_files(files), quick_options());
            }).find("absent.mrc"),
            std::string::npos);
}

}  // namespace
}  // namespace tomofield
