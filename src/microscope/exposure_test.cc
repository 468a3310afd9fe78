#include "microscope/exposure.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>

#include "scratch_directory.h"

namespace tomofield::microscope {
namespace {

using testing::ScratchDirectory;

TEST(CriticalExposure, IsThatOfGrantAndGrigorieff) {
  // 0.245 · 10^1.665 + 2.81 and 0.245 · 3^1.665 + 2.81, from a desk calculator
  EXPECT_NEAR(critical_exposure(0.1, 300), 14.13834, 1e-4);
  EXPECT_NEAR(critical_exposure(1.0 / 3, 300), 4.33606, 1e-4);
  EXPECT_NEAR(critical_exposure(0.1, 200), 0.8 * 14.13834, 1e-4);
  EXPECT_NEAR(critical_exposure(0.1, 120), 0.45 * 14.13834, 1e-4);
  EXPECT_NEAR(critical_exposure(0.1, 250), 0.9 * 14.13834, 1e-4);
}

TEST(SignalAfter, FallsToTheRootOfEAtTheCriticalExposure) {
  EXPECT_NEAR(signal_after(critical_exposure(0.05, 300), 0.05, 300), std::exp(-0.5), 1e-12);
  EXPECT_EQ(signal_after(120, 0.0, 300), 1.0);
  EXPECT_EQ(signal_after(0, 0.3, 300), 1.0);
}

TEST(Exposures, FollowTheOrder) {
  const std::array<std::size_t, 3> order{1, 2, 0};
  const auto exposures = exposures_in_order(order, 3.0);
  EXPECT_EQ(exposures[1].before, 0.0);
  EXPECT_EQ(exposures[2].before, 3.0);
  EXPECT_EQ(exposures[0].before, 6.0);
  EXPECT_EQ(exposures[0].at_middle(), 7.5);
}

// Returns an .mdoc of three sections that were recorded in the order 1, 2, 0.
std::string mdoc_text(const std::array<std::string, 3>& entries) {
  const std::array<std::string, 3> times{"12:40:00", "12:30:00", "12:35:00"};
  std::string text = "PixelSpacing = 2\n";
  for (std::size_t i = 0; i < 3; ++i)
    text += "[ZValue = " + std::to_string(i) + "]\nTiltAngle = 0\nDateTime = 12-Mar-21 " +
            times[i] + "\n" + entries[i] + "\n";
  return text;
}

std::optional<std::vector<Exposure>> exposures_of_text(const std::array<std::string, 3>& entries) {
  const ScratchDirectory directory;
  return exposures_of(io::read_mdoc(directory.write("a.mdoc", mdoc_text(entries)))).of_view;
}

TEST(ExposuresOfMdoc, AddUpTheDoses) {
  const auto exposures =
      exposures_of_text({"ExposureDose = 4", "ExposureDose = 2", "ExposureDose = 3"});
  ASSERT_TRUE(exposures);
  EXPECT_EQ((*exposures)[1].before, 0.0);
  EXPECT_EQ((*exposures)[2].before, 2.0);
  EXPECT_EQ((*exposures)[0].before, 5.0);
  EXPECT_EQ((*exposures)[0].of_view, 4.0);
}

TEST(ExposuresOfMdoc, TakeThePriorDose) {
  const auto exposures =
      exposures_of_text({"PriorRecordDose = 10", "PriorRecordDose = 1", "PriorRecordDose = 4"});
  ASSERT_TRUE(exposures);
  EXPECT_EQ((*exposures)[0].before, 10.0);
  EXPECT_EQ((*exposures)[1].before, 1.0);
  EXPECT_EQ((*exposures)[1].of_view, 3.0);
  const auto both = exposures_of_text({"PriorRecordDose = 10\nExposureDose = 2.5",
                                       "PriorRecordDose = 0\nExposureDose = 2.5",
                                       "PriorRecordDose = 5\nExposureDose = 2.5"});
  ASSERT_TRUE(both);
  EXPECT_EQ((*both)[2].before, 5.0);
  EXPECT_EQ((*both)[2].of_view, 2.5);
}

TEST(ExposuresOfMdoc, AreUnknownIfSerialEmDoesNotKnowThem) {
  EXPECT_FALSE(exposures_of_text({"", "", ""}));
  EXPECT_FALSE(exposures_of_text({"ExposureDose = 0\nPriorRecordDose = 0",
                                  "ExposureDose = 0\nPriorRecordDose = 0",
                                  "ExposureDose = 0\nPriorRecordDose = 0"}));
  EXPECT_FALSE(exposures_of_text({"ExposureDose = 3", "ExposureDose = 3", ""}));
}

// Returns the exposures of an .mdoc of sections without times.
StatedExposures without_times(const std::vector<std::string>& entries) {
  const ScratchDirectory directory;
  std::string text;
  for (std::size_t i = 0; i < entries.size(); ++i)
    text += "[ZValue = " + std::to_string(i) + "]\n" + entries[i] + "\n";
  return exposures_of(io::read_mdoc(directory.write("a.mdoc", text)));
}

TEST(ExposuresOfMdoc, AreNotThoseOfAPriorDoseThatIsContradicted) {
  const auto fault = [](const std::array<std::string, 3>& entries) {
    const ScratchDirectory directory;
    return exposures_of(io::read_mdoc(directory.write("a.mdoc", mdoc_text(entries)))).fault;
  };
  EXPECT_EQ(fault({"PriorRecordDose = 1", "PriorRecordDose = 4", "PriorRecordDose = 9"}),
            "PriorRecordDose falls while DateTime rises");
  const auto with = [&](const std::string& dose) {
    return fault({"PriorRecordDose = 2\nExposureDose = " + dose,
                  "PriorRecordDose = 0\nExposureDose = " + dose,
                  "PriorRecordDose = 1\nExposureDose = " + dose});
  };
  EXPECT_EQ(with("1"), "");
  EXPECT_EQ(with("0.3"), "");  // a view was repeated
  EXPECT_EQ(with("3"), "PriorRecordDose rises by less than ExposureDose");
  constexpr const char* kEqual = "PriorRecordDose = 5\nExposureDose = 3";
  EXPECT_EQ(fault({kEqual, kEqual, kEqual}), "PriorRecordDose rises by less than ExposureDose");
}

TEST(ExposuresOfMdoc, NeverContradictAPriorDoseThatIsKnown) {
  // The order by numbers is not that of recording.
  const StatedExposures unordered =
      without_times({"ExposureDose = 8", "ExposureDose = 8\nPriorRecordDose = 56",
                     "ExposureDose = 8\nPriorRecordDose = 0", "ExposureDose = 8"});
  EXPECT_FALSE(unordered.of_view);
  EXPECT_EQ(unordered.fault,
            "PriorRecordDose is missing in sections 1, 4, and nothing else tells the order of "
            "recording");
  // It is, and the prior doses agree with it.
  const StatedExposures ordered = without_times(
      {"ExposureDose = 2", "ExposureDose = 2\nPriorRecordDose = 2.1", "ExposureDose = 2"});
  ASSERT_TRUE(ordered.of_view);
  EXPECT_EQ((*ordered.of_view)[2].before, 4.0);
  // Times tell an order that the prior doses contradict.
  const StatedExposures timed =
      without_times({"ExposureDose = 2\nDateTime = 12-Mar-21 10:00:00\nPriorRecordDose = 9",
                     "ExposureDose = 2\nDateTime = 12-Mar-21 10:01:00"});
  EXPECT_FALSE(timed.of_view);
  EXPECT_NE(timed.fault.find("contradict"), std::string::npos);
}

TEST(ExposuresOfMdoc, AreUnknownIfTimesGiveNoOrder) {
  const std::string dose = "ExposureDose = 3\n", time = "DateTime = 12-Mar-21 10:00:0";
  const auto fault = [&](const std::vector<std::string>& entries) {
    const StatedExposures found = without_times(entries);
    EXPECT_FALSE(found.of_view);
    return found.fault;
  };
  EXPECT_EQ(fault({dose + time + "2", dose + "DateTime = 12/03/21 10:00"}),
            "line 6: DateTime is not a date and a time such as 12-Mar-21 15:31:02, and nothing "
            "else tells the order of recording");
  EXPECT_EQ(fault({dose + time + "2", dose, dose}),
            "[ZValue = 1] has no DateTime, and nothing else tells the order of recording");
  EXPECT_EQ(
      fault({dose + time + "2", dose + time + "1", dose + time + "2"}),
      "[ZValue = 0] and [ZValue = 2] have the same DateTime, and nothing else tells the order "
      "of recording");
  // Doses before the sections tell the order as well.
  const StatedExposures told = without_times(
      {dose + "PriorRecordDose = 3\nDateTime = x", dose + "PriorRecordDose = 0\nDateTime = y"});
  ASSERT_TRUE(told.of_view);
  EXPECT_EQ((*told.of_view)[0].before, 3.0);
}

TEST(ExposuresOfMdoc, AreNotThoseOfFrames) {
  const std::string known = "FrameDosesAndNumber = 0.1 30";
  EXPECT_NE(without_times({known, known, known}).fault.find("FrameDosesAndNumber"),
            std::string::npos);
  const std::string none = "ExposureDose = 0\nFrameDosesAndNumber = 0 30";
  EXPECT_EQ(without_times({none, none, none}).fault, "");
}

TEST(ExposuresOfMdoc, SaysWhatIsMissing) {
  const std::string dose = "ExposureDose = 3";
  EXPECT_EQ(without_times({dose, "ExposureDose = 0", dose}).fault,
            "ExposureDose is missing or 0 in section 2");
  EXPECT_EQ(without_times({dose, "", "", "", "", "", "", "", "", ""}).fault,
            "ExposureDose is missing or 0 in sections 2, 3, 4, 5, 6, 7, 8, 9 …");
  EXPECT_EQ(without_times({"PriorRecordDose = 3", "", "PriorRecordDose = 0"}).fault,
            "PriorRecordDose is missing in section 2");
  EXPECT_EQ(without_times({"", ""}).fault, "");
}

TEST(ExposuresOfMdoc, AnOrderMayContradictThem) {
  const ScratchDirectory directory;
  const io::Mdoc mdoc = io::read_mdoc(directory.write(
      "a.mdoc",
      "[ZValue = 0]\nPriorRecordDose = 4\n[ZValue = 1]\n[ZValue = 2]\nPriorRecordDose = 0\n"));
  EXPECT_TRUE(contradicts_prior_doses(std::vector<std::size_t>{0, 1, 2}, mdoc));
  EXPECT_FALSE(contradicts_prior_doses(std::vector<std::size_t>{2, 1, 0}, mdoc));
}

TEST(ExposuresOfTable, AreThoseBeforeTheViews) {
  io::ViewTable table;
  for (const double dose : {6.0, 0.0, 3.0}) {
    table.views.emplace_back();
    table.views.back().dose_before = dose;
  }
  const auto exposures = exposures_of(table).of_view;
  ASSERT_TRUE(exposures);
  EXPECT_EQ((*exposures)[0].before, 6.0);
  EXPECT_EQ((*exposures)[0].of_view, 3.0);
  table.views.back().dose_before.reset();
  EXPECT_FALSE(exposures_of(table).of_view);
}

TEST(ExposuresOfTable, CannotBeTheSameBeforeTwoViewsThatAreUsed) {
  for (const std::array<double, 3>& doses :
       {std::array{3.0, 3.0, 3.0}, std::array{0.0, 3.0, 3.0}}) {
    io::ViewTable table;
    for (const double dose : doses) {
      table.views.emplace_back();
      table.views.back().dose_before = dose;
    }
    const StatedExposures same = exposures_of(table);
    EXPECT_FALSE(same.of_view);
    EXPECT_NE(same.fault.find("rows"), std::string::npos) << same.fault;
    table.views[1].is_used = false;
    EXPECT_EQ(exposures_of(table).of_view.has_value(), doses[0] != doses[2]);
  }
  io::Mdoc mdoc;
  for (const double dose : {3.0, 3.0, 6.0}) {
    mdoc.sections.emplace_back();
    mdoc.sections.back().prior_dose = dose;
  }
  EXPECT_FALSE(exposures_of(mdoc).of_view);
  EXPECT_NE(exposures_of(mdoc).fault.find("sections 1 and 2"), std::string::npos);
}

TEST(ExposuresOfTilts, AreNotKnownIfSomeAreZero) {
  io::TiltTable table{.angles = {{0, 1}, {3, 2}, {-3, 3}}, .order = {0, 1, 2}, .doses = {2, 2, 2}};
  EXPECT_EQ((*exposures_of(table).of_view)[2].before, 4.0);
  table.doses[1] = 0;
  EXPECT_NE(exposures_of(table).fault.find("row 2"), std::string::npos);
  table.doses = {0, 0, 0};
  EXPECT_FALSE(exposures_of(table).of_view);
  EXPECT_EQ(exposures_of(table).fault, "");
}

}  // namespace
}  // namespace tomofield::microscope
