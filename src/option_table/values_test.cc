#include "option_table/values.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <type_traits>
#include <vector>

#include "option_table/setting.h"
#include "tomofield/error.h"

namespace tomofield::option_table {
namespace {

// Calls `note` with the address of each member of a struct. A member that is added does not compile
// here until it is counted.
template <typename Struct, typename Note>
void note_members(const Struct& of, const Note& note) {
  const auto note_all = [&](const auto&... member) { (note(&member), ...); };
  if constexpr (std::is_same_v<Struct, SeriesFiles>) {
    const auto& [m0, m1, m2, m3, m4, m5, m6, m7, m8, m9, m10, m11, m12] = of;
    note_all(m0, m1, m2, m3, m4, m5, m6, m7, m8, m9, m10, m11, m12);
  } else if constexpr (std::is_same_v<Struct, ViewOptions>) {
    const auto& [m0, m1, m2, m3, m4, m5, m6, m7, m8, m9, m10, m11, m12, m13, m14, m15, m16, m17,
                 m18, m19, m20, m21] = of;
    note_all(m0, m1, m2, m3, m4, m5, m6, m7, m8, m9, m10, m11, m12, m13, m14, m15, m16, m17, m18,
             m19, m20, m21);
  } else if constexpr (std::is_same_v<Struct, SpecimenOptions>) {
    const auto& [m0, m1, m2, m3, m4, m5] = of;
    note_all(m0, m1, m2, m3, m4, m5);
  } else if constexpr (std::is_same_v<Struct, FieldOptions>) {
    const auto& [m0, m1, m2, m3, m4, m5, m6, m7, m8, m9, m10] = of;
    note_all(m0, m1, m2, m3, m4, m5, m6, m7, m8, m9, m10);
  } else if constexpr (std::is_same_v<Struct, FitOptions>) {
    const auto& [m0, m1, m2, m3, m4, m5, m6, m7, m8, m9, m10, m11, m12, m13, m14, m15, m16, m17,
                 m18, m19, m20, m21, m22, m23, m24, m25] = of;
    note_all(m0, m1, m2, m3, m4, m5, m6, m7, m8, m9, m10, m11, m12, m13, m14, m15, m16, m17, m18,
             m19, m20, m21, m22, m23, m24, m25);
  } else if constexpr (std::is_same_v<Struct, VolumeOptions>) {
    const auto& [m0, m1, m2, m3, m4] = of;
    note_all(m0, m1, m2, m3, m4);
  } else {
    static_assert(std::is_same_v<Struct, RunOptions>);
    const auto& [m0, m1, m2, m3, m4, m5] = of;
    note_all(m0, m1, m2, m3, m4, m5);
  }
}

std::multiset<const void*> members_of(const Choices& choices) {
  std::multiset<const void*> members;
  const auto note = [&](const void* member) { members.insert(member); };
  note_members(choices.files, note);
  note_members(choices.options.views, note);
  note_members(choices.options.specimen, note);
  note_members(choices.options.field, note);
  note_members(choices.options.fit, note);
  note_members(choices.options.volume, note);
  note_members(choices.options.run, note);
  return members;
}

const void* address_of(const Row& row, const Choices& choices) {
  return visit_value(row, choices, [](const auto& value) -> const void* { return &value; });
}

TEST(OptionTable, HasEveryMemberOnce) {
  const Choices choices;
  std::multiset<const void*> in_table;
  for (const Row& row : all_rows()) in_table.insert(address_of(row, choices));
  EXPECT_EQ(in_table, members_of(choices));
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

TEST(OptionTable, JsonHasEveryValue) {
  const Choices choices = unusual_choices();
  const nlohmann::json json = to_json(choices);
  EXPECT_EQ(json.at("fit").at("seed"), std::uint64_t{18446744073709551615u});
  EXPECT_EQ(json.at("specimen").at("roi"), nlohmann::json({1, -2, 30, 40}));
  EXPECT_EQ(json.at("volume").at("mode"), 12);
  EXPECT_EQ(json.at("fit").at("epochs"), 37);
  EXPECT_EQ(json.at("input").at("contrast"), "bright");
  EXPECT_TRUE(to_json({}).at("input").at("angpix").is_null());
}

TEST(OptionTable, ValuesSayWhereTheyComeFrom) {
  const auto origin = [](const char* key, const Choices& choices) {
    return origin_of(row_of(key), choices);
  };
  Choices choices;
  for (const Row& row : all_rows()) EXPECT_EQ(origin_of(row, choices), Origin::kDefault) << row.key;
  choices.options.fit.epochs = *choices.options.fit.epochs;
  choices.options.fit.penalty.choose(Penalty::kSmooth);
  choices.options.field.leaf_size.derive(64);
  choices.options.fit.seed = 7;
  EXPECT_EQ(origin("fit.epochs", choices), Origin::kGiven);
  EXPECT_EQ(origin("fit.penalty", choices), Origin::kTrial);
  EXPECT_EQ(origin("field.leaf_size", choices), Origin::kDerived);
  EXPECT_EQ(origin("fit.seed", choices), Origin::kGiven);
  choices.options.fit.epochs.derive(9);  // it is chosen already
  EXPECT_EQ(choices.options.fit.epochs, *Options().fit.epochs);
  const std::vector<Setting> of_file{{"--tv", "3", "a.toml", "tv"}};
  note_settings(of_file, choices);
  EXPECT_EQ(origin("fit.density_variation", choices), Origin::kProject);
  EXPECT_EQ(choices.options.settings.size(), 1u);
  EXPECT_EQ(origin("input.bin", choices), Origin::kDefault);
  choices.options.given = {"--bin"};  // with the default value
  EXPECT_EQ(origin("input.bin", choices), Origin::kGiven);
}

TEST(OptionTable, SettingsSayWhatHoldsInTheirPlace) {
  Choices choices;
  choices.options.specimen.thickness = 300;
  choices.options.specimen.axis_x = 12;
  const std::vector<Setting> settings{{"--thickness", "300", "tilt.com", "THICKNESS"},
                                      {"--center", "12", "tilt.com", "OFFSET"},
                                      {"--bin", "2", "tilt.com", "IMAGEBINNED", "", "--angpix 10"},
                                      {"--cs", "2.7", "ctfcorrection.com", "SphericalAberration"}};
  note_settings(settings, choices);
  const auto instead = [&] {
    settle_settings(choices);
    std::string all;
    for (const Setting& setting : choices.options.settings) all += setting.instead + ";";
    return all;
  };
  EXPECT_EQ(instead(), ";;--angpix 10;--cs none;");
  choices.options.specimen.thickness = 200;
  choices.options.specimen.axis_x = 13;
  choices.options.specimen.axis_z = 3.5;
  EXPECT_EQ(instead(), "--thickness 200;--center 13,3.5;--angpix 10;--cs none;");
}

// Applies a setting of a project beside options that somebody gave. Returns the value that the
// option has then, and what holds in place of the setting: "1;--angpix 10".
std::string applied(const Setting& setting, Choices choices) {
  apply_settings({setting}, choices);
  return fmt::format("{};{}", flag_text_of(setting.option, choices),
                     choices.options.settings.front().instead);
}

TEST(OptionTable, GivenOptionsWinOverSettings) {
  const Setting bin{"--bin", "2", "newst.com", "BinByFactor"};
  EXPECT_EQ(applied(bin, {}), "2;");
  Choices given;
  given.options.given = {"--bin"};
  EXPECT_EQ(applied(bin, given), "1;--bin 1");
  given = {};
  given.options.views.angpix = 10;
  EXPECT_EQ(applied(bin, given), "1;--angpix 10");
  given = {};
  given.options.views.contrast = Contrast::kBright;
  EXPECT_EQ(applied({"--log", "true", "tilt.com", "LOG"}, given), "false;--contrast bright");
  EXPECT_EQ(applied({"--defocus", "3", "a.mdoc", "TargetDefocus"}, given),
            "none;--contrast bright");
  given = {};
  given.files.ctf = "none";
  EXPECT_EQ(applied({"--defocus", "3", "a.mdoc", "TargetDefocus"}, given), "none;--ctf none");
  given = {};
  given.options.fit.engine = Engine::kRay;
  EXPECT_EQ(applied({"--ctf", "a.txt", "a.txt", "CTF"}, given), "none;--engine ray");
  EXPECT_EQ(applied({"--voltage", "200", "a.mdoc", "Voltage"}, given), "200;");
  given = {};
  given.options.run.overwrite = true;
  EXPECT_EQ(applied({"--overwrite", "true", "a", "b"}, given), "true;--overwrite");
}

TEST(OptionTable, OptionsGivenLaterTakeSettingsBack) {
  Choices choices;
  apply_settings({{"--bin", "2", "newst.com", "BinByFactor"}, {"--aln", "a.aln", "a.aln", "ROT"}},
                 choices);
  choices.options.views.angpix = 10;
  settle_settings(choices);
  EXPECT_EQ(choices.options.settings[0].instead, "--angpix 10");
  EXPECT_EQ(choices.options.views.bin, 1);
  EXPECT_EQ(choices.options.settings[1].instead, "");
  EXPECT_EQ(choices.files.aln, "a.aln");
}

TEST(OptionTable, SettingsThatCannotBeReadAreRefused) {
  Choices choices;
  EXPECT_THROW(apply_settings({{"--bin", "two", "newst.com", "BinByFactor"}}, choices), Error);
}

TEST(OptionTable, TextsThatCannotBeReadSayWhatIsWanted) {
  const auto wanted = [](const char* key, const char* text) {
    Choices choices;
    return set_from_text(row_of(key), text, choices);
  };
  EXPECT_EQ(wanted("fit.subsets", "many"), "a whole number");
  EXPECT_EQ(wanted("fit.subsets", "1.5"), "a whole number");
  EXPECT_EQ(wanted("fit.subsets", ""), "a whole number");
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
  good.specimen.thickness = 100;
  EXPECT_EQ(range_faults(good), std::vector<std::string>());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  int num_numbers = 0;
  for (const Row& row : all_rows()) {
    if (row.range.kind == Range::Kind::kAny) continue;
    for (const double bad : {nan, infinity, -1e7}) {
      Choices choices{{}, good};
      visit_value(row, choices, [&]<typename T>(T& value) {
        if constexpr (std::is_same_v<T, double> || std::is_same_v<T, std::optional<double>> ||
                      std::is_same_v<T, Choice<double>>)
          value = bad;
        else if constexpr (std::is_same_v<T, int> || std::is_same_v<T, std::int64_t> ||
                           std::is_same_v<T, std::optional<int>> || std::is_same_v<T, Choice<int>>)
          value = -10'000'000;
      });
      const std::vector<std::string> faults = range_faults(choices.options);
      ASSERT_EQ(faults.size(), 1u) << row.key;
      EXPECT_TRUE(faults[0].starts_with(std::string(flag_of(row.key)) + " must be " +
                                        row.range.text() + ", not "))
          << faults[0];
    }
    ++num_numbers;
  }
  EXPECT_GT(num_numbers, 20);
}

TEST(OptionTable, NumbersWithoutARangeAreFinite) {
  Options options;
  options.specimen.thickness = 20;
  options.specimen.axis_x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(range_faults(options),
            std::vector<std::string>{"--center must be a finite number, not nan"});
}

TEST(OptionTable, AMissingNumberIsRequired) {
  EXPECT_EQ(range_faults(Options()),
            std::vector<std::string>{"--thickness is required: it must be from 1 to 1000000"});
}

TEST(OptionTable, NumbersWithoutUpperLimitAreStillPlausible) {
  EXPECT_TRUE(Range::at_least(0).contains(1e9));
  EXPECT_FALSE(Range::at_least(0).contains(1e10));
  EXPECT_FALSE(Range::above(0).contains(1e300));
  Options options;
  options.specimen.thickness = 20;
  options.fit.density_variation = 1e300;
  const std::vector<std::string> faults = range_faults(options);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_NE(faults[0].find("at most 1e+09"), std::string::npos) << faults[0];
}

TEST(OptionTable, ALimitIsNamedOnce) {
  Options options;
  options.specimen.thickness = 20;
  options.views.pixel_size_A = 1e300;
  const std::vector<std::string> faults = range_faults(options);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_EQ(faults[0].find("at most"), std::string::npos) << faults[0];
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
