#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "expect_parts.h"
#include "io/images/mrc.h"
#include "scratch_directory.h"

namespace tomofield::io {
namespace {

using testing::ScratchDirectory;

// Gives a file an extended header.
void insert_extended_header(const std::filesystem::path& path, const std::string& extended,
                            const char* type, std::int16_t section_bytes, std::int16_t flags) {
  std::string bytes = testing::read_whole_file(path);
  const auto length = static_cast<std::int32_t>(extended.size());
  std::memcpy(bytes.data() + 92, &length, 4);
  std::memcpy(bytes.data() + 104, type, 4);
  std::memcpy(bytes.data() + 128, &section_bytes, 2);
  std::memcpy(bytes.data() + 130, &flags, 2);
  bytes.insert(1024, extended);
  std::ofstream(path, std::ios::binary) << bytes;
}

TEST(Mrc, SeriTiltAngles) {
  const ScratchDirectory scratch;
  // Each section holds two shorts: its tilt (flag 1) and its intensity (flag 16).
  const std::vector<std::int16_t> records{-6000, 7, 0, 8, 4550, 9};
  const std::string extended(reinterpret_cast<const char*>(records.data()), 12);
  const auto tilts = [&](const char* type, std::int16_t section_bytes, std::int16_t flags) {
    MrcWriter(scratch / "a.mrc",
              MrcSpec{.nx = 2, .ny = 1, .nz = 3, .mode = MrcMode::kInt16, .labels = {}})
        .close();
    insert_extended_header(scratch / "a.mrc", extended, type, section_bytes, flags);
    return MrcReader(scratch / "a.mrc").header().extended_tilt_deg;
  };
  const std::vector<double> expected{-60.0, 0.0, 45.5};
  EXPECT_EQ(tilts("SERI", 4, 17), expected);
  EXPECT_EQ(tilts("\0\0\0\0", 4, 17), expected);  // from before there were type codes
  EXPECT_TRUE(tilts("SERI", 4, 16).empty());      // no angles among the flags
  EXPECT_TRUE(tilts("SERI", 6, 17).empty());      // records longer than the header
  EXPECT_TRUE(tilts("SERI", -4, 17).empty());
  EXPECT_TRUE(tilts("CCP4", 4, 17).empty());
}

std::string joined(const std::vector<std::string>& texts) {
  return fmt::format("{}", fmt::join(texts, "; "));
}

// Puts a number into bytes as a file of this machine has it.
template <typename T>
void put(std::string& bytes, std::size_t at, T value) {
  bytes.replace(at, sizeof(T), reinterpret_cast<const char*>(&value), sizeof(T));
}

// Returns the header of a stack of three sections without a pixel size, with this extended header.
MrcHeader header_with_extended(const std::string& extended, const std::string& type,
                               std::int16_t first, std::int16_t second,
                               const std::string& label = "") {
  const ScratchDirectory scratch;
  MrcSpec spec{.nx = 2, .ny = 2, .nz = 3, .mode = MrcMode::kInt16, .labels = {}};
  spec.is_volume = false;
  spec.voxel_size_A = {1, 1, 1};
  if (!label.empty()) spec.labels = {label};
  MrcWriter writer(scratch / "a.mrc", spec);
  writer.close();
  insert_extended_header(scratch / "a.mrc", extended, type.data(), first, second);
  return MrcReader(scratch / "a.mrc").header();
}

// Returns records of 32 floats a section, after `num_integers` integers, as Xplore3D and UCSF's
// programs write them: the tilt comes first, the axis and the pixel size are the 11th and the 12th.
std::string float_records(int num_integers, int num_floats, float axis, float pixel) {
  std::string extended;
  for (const float tilt : {-60.0f, 0.0f, 45.5f}) {
    std::string record(static_cast<std::size_t>(4 * (num_integers + num_floats)), '\0');
    const auto first = static_cast<std::size_t>(4 * num_integers);
    put(record, first, tilt);
    if (num_floats > 10) put(record, first + 40, axis);
    if (num_floats > 11) put(record, first + 44, pixel);
    extended += record;
  }
  return extended;
}

TEST(Mrc, FloatRecordsOfExtendedHeaders) {
  const std::string no_type(4, '\0');
  const std::vector<double> tilts{-60.0, 0.0, 45.5};
  const MrcHeader xplore =
      header_with_extended(float_records(0, 32, -86.25f, 3.5e-10f), no_type, 0, 32, "Fei Company");
  EXPECT_EQ(xplore.extended_tilt_deg, tilts);
  EXPECT_NEAR(xplore.voxel_size_A[0], 3.5, 1e-6);
  EXPECT_EQ(xplore.extended_axis_deg, 86.25);  // IMOD turns the sign of FEI's
  // FEI's first programs stated the bytes of a record.
  EXPECT_EQ(
      header_with_extended(float_records(0, 32, -86.25f, 3.5e-10f), no_type, 128, 32, "Fei Company")
          .extended_tilt_deg,
      tilts);
  const MrcHeader agard = header_with_extended(float_records(2, 12, 86.25f, 3.5f), "AGAR", 2, 12);
  EXPECT_EQ(agard.extended_tilt_deg, tilts);
  EXPECT_NEAR(agard.voxel_size_A[0], 3.5, 1e-6);
  EXPECT_EQ(agard.extended_axis_deg, 86.25);
  // Records whose pixels differ.
  std::string mixed = float_records(0, 32, -86.25f, 3.5e-10f);
  put(mixed, 2 * 128 + 44, 7e-10f);
  const MrcHeader two_sizes = header_with_extended(mixed, no_type, 0, 32, "Fei Company");
  EXPECT_EQ(two_sizes.differences,
            std::vector<std::string>{
                "pixels in Å of 7 in section 3, and of 3.5 in the first, which is taken"});
  EXPECT_TRUE(xplore.differences.empty());
  std::string turned = float_records(0, 32, -86.25f, 3.5e-10f);
  put(turned, 128 + 40, -12.0f);
  EXPECT_EQ(header_with_extended(turned, no_type, 0, 32, "Fei Company").differences,
            std::vector<std::string>{
                "a tilt axis in degrees of 12 in section 2, and of 86.25 in the first, which is "
                "taken"});
  const MrcHeader impossible =
      header_with_extended(float_records(0, 32, 1000.0f, 3.5e-10f), no_type, 0, 32, "Fei Company");
  ASSERT_EQ(impossible.differences.size(), 1u);
  testing::expect_parts(impossible.differences[0], {"-1000°", "cannot be"});
  const MrcHeader few = header_with_extended(float_records(0, 4, 0, 0), no_type, 0, 4);
  EXPECT_EQ(few.extended_tilt_deg, tilts);
  EXPECT_EQ(few.voxel_size_A[0], 1.0);
  EXPECT_FALSE(few.extended_axis_deg);
  // Records that are too few, of another type, or without tilts.
  EXPECT_TRUE(
      header_with_extended(float_records(0, 12, 0, 0), no_type, 0, 40).extended_tilt_deg.empty());
  EXPECT_TRUE(
      header_with_extended(float_records(0, 12, 0, 0), "CCP4", 0, 12).extended_tilt_deg.empty());
  EXPECT_TRUE(
      header_with_extended(std::string(144, '\0'), no_type, 0, 12).extended_tilt_deg.empty());
}

TEST(Mrc, TiltsOfMoreSectionsAreNotTaken) {
  const auto expect_surplus = [](const MrcHeader& header) {
    EXPECT_TRUE(header.extended_tilt_deg.empty());
    ASSERT_FALSE(header.differences.empty());
    testing::expect_parts(header.differences[0], {"more sections than its 3", "--tlt"});
  };
  const auto of_serialem = [](std::int16_t after) {
    const std::vector<std::int16_t> records{-6000, 0, 4550, after, 0};
    return header_with_extended(std::string(reinterpret_cast<const char*>(records.data()), 10),
                                "SERI", 2, 1);
  };
  EXPECT_EQ(of_serialem(0).extended_tilt_deg.size(), 3u);  // empty records
  expect_surplus(of_serialem(6000));
  const std::string floats = float_records(0, 32, -86.25f, 3.5e-10f);
  EXPECT_EQ(
      header_with_extended(floats + std::string(256, '\0'), "AGAR", 0, 32).extended_tilt_deg.size(),
      3u);
  expect_surplus(header_with_extended(floats + floats, "AGAR", 0, 32));
  std::string fei;
  for (const double tilt : {-60.0, 0.0, 45.5, 60.0}) {
    std::string record(768, '\0');
    put(record, 0, std::int32_t{768});
    put(record, 8, 1u << 7);
    put(record, 100, tilt);
    fei += record;
  }
  expect_surplus(header_with_extended(fei, "FEI1", 0, 0));
  put(fei, 3 * 768 + 100, 0.0);
  EXPECT_EQ(header_with_extended(fei, "FEI1", 0, 0).extended_tilt_deg.size(), 3u);
}

TEST(Mrc, PiecesOfMontagesByTheHeaderOfSerialEm) {
  const auto records = [](char z_of_second) {
    std::string extended(24, '\0');
    extended[0] = 100;  // the tilt, in hundredths of a degree
    extended[14] = z_of_second;
    extended[22] = 2;
    return extended;
  };
  EXPECT_TRUE(header_with_extended(records(0), "SERI", 8, 3).has_pieces);
  EXPECT_FALSE(header_with_extended(records(1), "SERI", 8, 3).has_pieces);
  // Without the tilts, the places begin the record.
  const MrcHeader untilted =
      header_with_extended(records(0).substr(2) + std::string(2, '\0'), "SERI", 8, 2);
  EXPECT_TRUE(untilted.has_pieces);
  EXPECT_TRUE(untilted.extended_tilt_deg.empty());
}

TEST(Mrc, MagnificationsThatDifferByTheHeaderOfSerialEm) {
  constexpr std::int16_t kTiltAndMagnification = 9;
  const auto difference = [&](std::int16_t second) {
    const std::vector<std::int16_t> records{-6000, 330, 0, second, 6000, 330};
    const std::string extended(reinterpret_cast<const char*>(records.data()), 12);
    return joined(header_with_extended(extended, "SERI", 4, kTiltAndMagnification).differences);
  };
  EXPECT_EQ(difference(330), "");
  EXPECT_EQ(
      difference(420),
      "a magnification over 100 of 420 in section 2, and of 330 in the first, which is taken");
}

TEST(Mrc, RecordsOfFei1) {
  constexpr std::uint32_t kTilt = 1u << 7, kAxis = 1u << 12, kPixel = 1u << 14;
  const auto records = [](std::size_t size, std::uint32_t mask, const char* version) {
    std::string extended;
    for (const double tilt : {-60.0, 0.0, 45.5}) {
      std::string record(size, '\0');
      put(record, 0, static_cast<std::int32_t>(size));
      put(record, 8, mask);
      record.replace(68, std::string(version).size(), version);
      put(record, 100, tilt);
      put(record, 140, -86.25);
      put(record, 84, 200000.0);
      put(record, 156, 3.5e-10);
      put(record, 164, 7e-10);
      extended += record;
    }
    return extended;
  };
  for (const std::size_t size : {std::size_t{768}, std::size_t{888}}) {
    const MrcHeader header = header_with_extended(records(size, kTilt | kAxis | kPixel, "5.1"),
                                                  size == 768 ? "FEI1" : "FEI2", 0, 0);
    EXPECT_EQ(header.extended_tilt_deg, (std::vector<double>{-60.0, 0.0, 45.5}));
    EXPECT_NEAR(header.voxel_size_A[0], 3.5, 1e-6);
    EXPECT_EQ(header.extended_axis_deg, 86.25);
  }
  const auto difference = [&](std::size_t offset, double value) {
    std::string extended = records(768, kTilt | kAxis | kPixel | (1u << 5), "5.1");
    put(extended, 768 + offset, value);
    return joined(header_with_extended(extended, "FEI1", 0, 0).differences);
  };
  EXPECT_EQ(difference(156, 3.51e-10), "");
  EXPECT_EQ(difference(156, 7e-10),
            "pixels in Å of 7 in section 2, and of 3.5 in the first, which is taken");
  EXPECT_EQ(difference(84, 3e5),
            "a voltage in V of 300000 in section 2, and of 200000 in the first, which is taken");
  EXPECT_EQ(difference(140, 3.0),
            "a tilt axis in degrees of -3 in section 2, and of 86.25 in the first, which is taken");
  constexpr std::uint32_t kVoltage = 1u << 5, kPixelHeight = 1u << 15;
  const MrcHeader more = header_with_extended(
      records(768, kTilt | kPixel | kVoltage | kPixelHeight, "5.1"), "FEI1", 0, 0);
  EXPECT_EQ(more.extended_voltage_kV, 200.0);
  EXPECT_NEAR(more.voxel_size_A[0], 3.5, 1e-6);
  EXPECT_NEAR(more.voxel_size_A[1], 7.0, 1e-6);
  const MrcHeader masked = header_with_extended(records(768, kTilt, "5.1"), "FEI1", 0, 0);
  EXPECT_EQ(masked.extended_tilt_deg.size(), 3u);
  EXPECT_EQ(masked.voxel_size_A[0], 1.0);
  EXPECT_FALSE(masked.extended_axis_deg || masked.extended_voltage_kV);
  EXPECT_TRUE(
      header_with_extended(records(768, kPixel, "5.1"), "FEI1", 0, 0).extended_tilt_deg.empty());
  // Radians, of one version of the software.
  const MrcHeader radians = header_with_extended(records(768, kTilt, "4.4.0.4981"), "FEI1", 0, 0);
  EXPECT_TRUE(radians.extended_tilt_deg.empty());  // 60 radians are no tilt
  const std::string cut = records(768, kTilt | kAxis, "5.1").substr(0, 2 * 768);
  const MrcHeader of_two = header_with_extended(cut, "FEI1", 0, 0);
  EXPECT_TRUE(of_two.extended_tilt_deg.empty());
  EXPECT_EQ(of_two.extended_axis_deg, 86.25);
  testing::expect_parts(joined(of_two.differences), {"2 of its 3 sections"});
  // Without tilts, before metadata of several megabytes, and with a voltage in kV.
  std::string untilted = records(768, kAxis | kVoltage, "5.1") + std::string(17 << 20, '\0');
  put(untilted, 84, 200.0);
  const MrcHeader axis_alone = header_with_extended(untilted, "FEI1", 0, 0);
  EXPECT_TRUE(axis_alone.extended_tilt_deg.empty());
  EXPECT_EQ(axis_alone.extended_axis_deg, 86.25);
  EXPECT_EQ(axis_alone.extended_voltage_kV, 200.0);
}

}  // namespace
}  // namespace tomofield::io
