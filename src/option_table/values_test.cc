#include "option_table/values.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::option_table {
namespace {

// The addresses of all members. A member that is added does not compile here until it is named.
std::vector<const void*> members_of(const Choices& choices) {
  const auto& [stack, tlt, xf, xtilt, aln, mdoc, mask, fiducials, even, odd, ctf, mtf] =
      choices.files;
  const auto& [tilt_offset, x_axis_tilt, tilt_axis, exclude, ignore, bin, angpix, pixel_size,
               contrast, take_log, log_base, black_level, bead_diameter, fixed_pattern, defocus,
               phase_flipped, defocus_hand, voltage, spherical_aberration, amplitude_contrast,
               dose_per_tilt, dose_weighted, thickness, roi, hand, axis_x, axis_z, shift_z,
               with_margin, field, leaf_size, tree, leaf_budget, vertex_spacing, rank, activation,
               margin_spacing, budget, tile_rows, epochs, vertex_epochs, coarse_epochs, coarse_bin,
               subsets, engine, ray_samples, rays_per_step, learning_rate, density_variation,
               factor_variation, penalty, denoise, prior, boundary, fourier, fourier_ring,
               spike_rank, fit_noise, noise_model, fit_view_scale, hold_out, tune, patience, seed,
               align, split_tilts, denoising_halves, voxel_type, axes, invert, zarr, output,
               overwrite, resume, checkpoint_minutes, alignment_json] = choices.options;
  return {&stack,
          &tlt,
          &xf,
          &xtilt,
          &aln,
          &mdoc,
          &mask,
          &fiducials,
          &even,
          &odd,
          &ctf,
          &mtf,
          &tilt_offset,
          &x_axis_tilt,
          &tilt_axis,
          &exclude,
          &ignore,
          &bin,
          &angpix,
          &pixel_size,
          &contrast,
          &take_log,
          &log_base,
          &black_level,
          &bead_diameter,
          &fixed_pattern,
          &defocus,
          &phase_flipped,
          &defocus_hand,
          &voltage,
          &spherical_aberration,
          &amplitude_contrast,
          &dose_per_tilt,
          &dose_weighted,
          &thickness,
          &roi,
          &hand,
          &axis_x,
          &axis_z,
          &shift_z,
          &with_margin,
          &field,
          &leaf_size,
          &tree,
          &leaf_budget,
          &vertex_spacing,
          &rank,
          &activation,
          &margin_spacing,
          &budget,
          &tile_rows,
          &epochs,
          &vertex_epochs,
          &coarse_epochs,
          &coarse_bin,
          &subsets,
          &engine,
          &ray_samples,
          &rays_per_step,
          &learning_rate,
          &density_variation,
          &factor_variation,
          &penalty,
          &denoise,
          &prior,
          &boundary,
          &fourier,
          &fourier_ring,
          &spike_rank,
          &fit_noise,
          &noise_model,
          &fit_view_scale,
          &hold_out,
          &tune,
          &patience,
          &seed,
          &align,
          &split_tilts,
          &denoising_halves,
          &voxel_type,
          &axes,
          &invert,
          &zarr,
          &output,
          &overwrite,
          &resume,
          &checkpoint_minutes,
          &alignment_json};
}

const void* address_of(const Row& row, const Choices& choices) {
  return visit_value(row, choices.files, choices.options,
                     [](const auto& value) -> const void* { return &value; });
}

TEST(OptionTable, HasEveryMemberOnce) {
  const Choices choices;
  std::multiset<const void*> in_table;
  for (const Row& row : all_rows()) in_table.insert(address_of(row, choices));
  const std::vector<const void*> members = members_of(choices);
  EXPECT_EQ(in_table, std::multiset<const void*>(members.begin(), members.end()));
}

TEST(OptionTable, KeysAndFlagsNameOneOption) {
  std::set<std::string_view> keys;
  std::map<std::string_view, int> rows_of_flag;
  for (const Row& row : all_rows()) {
    EXPECT_TRUE(keys.insert(row.key).second) << row.key;
    ++rows_of_flag[row.flag];
    EXPECT_EQ(&row_of(row.key), &row);
    EXPECT_FALSE(row.help.empty()) << row.key;
  }
  for (const auto& [flag, rows] : rows_of_flag) EXPECT_EQ(rows, flag == "--center" ? 2 : 1) << flag;
  EXPECT_EQ(flag_of("running.output"), "--output");
  EXPECT_EQ(flag_of("no.such"), "");
}

TEST(OptionTable, AutomaticDefaultsAreDescribed) {
  const Choices choices;
  for (const Row& row : all_rows()) {
    const bool is_chosen = !text_of(row, choices).has_value();
    const bool is_file = label_of(row) == "FILE" || row.key == "input.stack";
    const bool is_text = row.key == "input.exclude" || row.key == "input.ignore" ||
                         row.key == "field.budget";  // empty: nothing is done
    EXPECT_EQ(!row.automatic.empty(), is_chosen && !is_file && !is_text) << row.key;
  }
}

// Choices of which every member differs from its default.
Choices unusual_choices() {
  const std::map<std::string_view, const char*> texts{{"specimen.roi", "1,-2,30,40"},
                                                      {"specimen.hand", "-1"},
                                                      {"volume.mode", "12"},
                                                      {"fit.fit_view_scale", "off"},
                                                      {"fit.seed", "18446744073709551615"}};
  Choices choices;
  const Choices defaults;
  for (const Row& row : all_rows()) {
    const std::string default_text = text_of(row, defaults).value_or("");
    std::string label = label_of(row);
    std::string text =
        label == "N" || label == "NUMBER" || label == "FACTOR" || label == "X[,Z]" ? "37" : "word";
    if (is_flag(row)) text = default_text == "true" ? "false" : "true";
    if (label.find('|') != label.npos) text = label.substr(label.rfind('|') + 1);
    if (const auto given = texts.find(row.key); given != texts.end()) text = given->second;
    EXPECT_EQ(set_from_text(row, text, choices), "") << row.key << " " << text;
    EXPECT_EQ(text_of(row, choices), text) << row.key;
    EXPECT_NE(text, default_text) << row.key;
  }
  return choices;
}

void expect_same(const Choices& a, const Choices& b) {
  for (const Row& row : all_rows()) EXPECT_EQ(text_of(row, a), text_of(row, b)) << row.key;
}

TEST(OptionTable, JsonKeepsEveryValue) {
  for (const Choices& written : {unusual_choices(), Choices{}}) {
    const nlohmann::json json = to_json(written.files, written.options);
    Choices read = unusual_choices();
    from_json(nlohmann::json::parse(json.dump()), read);
    expect_same(read, written);
    EXPECT_EQ(to_json(read.files, read.options), json);
  }
}

TEST(OptionTable, JsonOfOneOptionLeavesOthersAlone) {
  Choices choices;
  from_json({{"fit", {{"epochs", 7}}}, {"volume", {{"mode", 1}}}}, choices);
  Choices expected;
  expected.options.epochs = 7;
  expected.options.voxel_type = VoxelType::kInt16;
  expect_same(choices, expected);
}

TEST(OptionTable, JsonThatIsWrongIsNamed) {
  const auto refusal = [](const nlohmann::json& json) {
    Choices choices;
    const std::string message = testing::message_of<Error>([&] { from_json(json, choices); });
    expect_same(choices, {});  // a refusal changes nothing
    return message;
  };
  EXPECT_EQ(refusal({{"fit", {{"epochz", 7}}}}),
            "'fit.epochz' is no option: docs/options.md lists their names");
  EXPECT_EQ(refusal({{"fitt", 1}}), "'fitt' is no option: docs/options.md lists their names");
  EXPECT_EQ(refusal({{"fit", {{"subsets", 1.5}}}}),
            "'fit.subsets' must be a whole number, not 1.5");
  EXPECT_EQ(refusal({{"fit", {{"seed", -1}}}}), "'fit.seed' must be a whole number from 0, not -1");
  EXPECT_EQ(refusal({{"field", {{"kind", "mesh"}}}}),
            "'field.kind' must be vm or grid, not \"mesh\"");
  EXPECT_EQ(refusal({{"fit", {{"engine", "ray"}, {"boundary", "much"}}}}),
            "'fit.boundary' cannot be \"much\"");
  EXPECT_EQ(refusal({{"volume", {{"mode", 3}}}}), "'volume.mode' must be 2, 12 or 1, not 3");
}

TEST(OptionTable, TextsThatCannotBeReadSayWhatIsWanted) {
  const auto wanted = [](const char* key, const char* text) {
    Choices choices;
    return set_from_text(row_of(key), text, choices);
  };
  EXPECT_EQ(wanted("field.rank", "many"), "a whole number");
  EXPECT_EQ(wanted("field.rank", "1.5"), "a whole number");
  EXPECT_EQ(wanted("field.rank", ""), "a whole number");
  EXPECT_EQ(wanted("fit.epochs", "99999999999"), "auto or a whole number that is not so large");
  EXPECT_EQ(wanted("fit.seed", "-1"), "a whole number from 0");
  EXPECT_EQ(wanted("fit.boundary", "4x"), "a number");
  EXPECT_EQ(wanted("input.contrast", "grey"), "dark or bright");
  EXPECT_EQ(wanted("fit.fit_view_scale", "maybe"), "auto, on or off");
  EXPECT_EQ(wanted("fit.penalty", "strict"), "auto, concave or smooth");
  for (const char* text : {"1,2,3", "1,2,3,4,5", "a,b,c,d", "1,2,3,", "0,0,9,99999999999999999999"})
    EXPECT_EQ(wanted("specimen.roi", text), "four whole numbers, x0,y0,x1,y1") << text;
}

TEST(OptionTable, AutomaticOptionsTakeTheWordAuto) {
  Choices choices = unusual_choices();
  for (const Row& row : all_rows()) {
    if (row.automatic.empty()) continue;
    EXPECT_EQ(set_from_text(row, "auto", choices), "") << row.key;
    EXPECT_EQ(text_of(row, choices), std::nullopt) << row.key;
  }
}

TEST(OptionTable, EveryNumberIsCheckedAgainstItsRange) {
  Options good;
  good.thickness = 100;
  EXPECT_EQ(range_faults(good), std::vector<std::string>());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const SeriesFiles no_files;
  int num_numbers = 0;
  for (const Row& row : all_rows()) {
    if (row.range.kind == Range::Kind::kAny) continue;
    for (const double bad : {nan, infinity, -1e7}) {
      Options options = good;
      visit_value(row, no_files, options, [&]<typename T>(T& value) {
        if constexpr (std::is_same_v<T, double> || std::is_same_v<T, std::optional<double>>)
          value = bad;
        else if constexpr (std::is_same_v<T, int> || std::is_same_v<T, std::int64_t> ||
                           std::is_same_v<T, std::optional<int>>)
          value = -10'000'000;
      });
      const std::vector<std::string> faults = range_faults(options);
      ASSERT_EQ(faults.size(), 1u) << row.key;
      EXPECT_TRUE(faults[0].starts_with(std::string(flag_of(row.key)) + " must be " +
                                        row.range.text() + ", not "))
          << faults[0];
    }
    ++num_numbers;
  }
  EXPECT_GT(num_numbers, 20);
}

TEST(OptionTable, NumbersWithoutUpperLimitAreStillPlausible) {
  EXPECT_TRUE(Range::at_least(0).contains(1e9));
  EXPECT_FALSE(Range::at_least(0).contains(1e10));
  EXPECT_FALSE(Range::above(0).contains(1e300));
  Options options;
  options.thickness = 20;
  options.density_variation = 1e300;
  const std::vector<std::string> faults = range_faults(options);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_NE(faults[0].find("at most 1e+09"), std::string::npos) << faults[0];
}

TEST(OptionTable, RangesHoldTheirLimits) {
  EXPECT_TRUE(Range::between(1, 256).contains(256));
  EXPECT_FALSE(Range::between(1, 256).contains(257));
  EXPECT_FALSE(Range::above(0).contains(0));
  EXPECT_TRUE(Range::at_least(0).contains(0));
  EXPECT_TRUE(Range::zero_or_between(2, 9).contains(0));
  EXPECT_FALSE(Range::zero_or_between(2, 9).contains(1));
  EXPECT_TRUE(Range::multiple_of(16, 4096).contains(4096));
  EXPECT_FALSE(Range::multiple_of(16, 4096).contains(0));
  EXPECT_FALSE(Range::multiple_of(16, 4096).contains(24));
  EXPECT_TRUE(Range::either(1, -1).contains(-1));
  EXPECT_FALSE(Range::either(1, -1).contains(0));
}

}  // namespace
}  // namespace tomofield::option_table
