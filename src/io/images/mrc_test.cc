#include "io/images/mrc.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <vector>

#include "base/threads/parallel.h"
#include "expect_parts.h"
#include "python_script.h"
#include "tomofield/error.h"
#include "warning_catcher.h"

namespace tomofield::io {
namespace {

using testing::message_of;
using testing::python_has;
using testing::run_python;
using testing::ScratchDirectory;

MrcSpec spec_of(std::int64_t nx, std::int64_t ny, std::int64_t nz,
                MrcMode mode = MrcMode::kFloat32) {
  MrcSpec spec;
  spec.nx = nx;
  spec.ny = ny;
  spec.nz = nz;
  spec.mode = mode;
  return spec;
}

std::vector<float> read_all(const std::filesystem::path& path) {
  const MrcReader reader(path);
  const MrcHeader& header = reader.header();
  const auto section_values = static_cast<std::size_t>(header.nx * header.ny);
  std::vector<float> values(section_values * static_cast<std::size_t>(header.nz));
  for (std::int64_t z = 0; z < header.nz; ++z) {
    reader.read_section(
        z, std::span(values).subspan(static_cast<std::size_t>(z) * section_values, section_values));
  }
  return values;
}

// Returns value i of the files that both Python and this test make. Every mode of MRC can hold it;
// the unsigned mode holds its magnitude.
float pattern(std::size_t i, bool is_unsigned) {
  const auto value = static_cast<float>((i * 37) % 41) - 20.0f;
  return is_unsigned ? std::fabs(value) : value;
}

TEST(Mrc, ReadsEveryModeInBothByteOrders) {
  if (!python_has("mrcfile")) GTEST_SKIP() << "python3-mrcfile is not installed";
  const ScratchDirectory scratch;
  // mrcfile writes the native order. Reversing every word makes the other order, and mrcfile must
  // agree that it holds the same.
  ASSERT_EQ(run_python(scratch, R"(
import numpy as np, mrcfile
values = (np.arange(5 * 4 * 3) * 37 % 41 - 20).astype(np.float32).reshape(3, 4, 5)
for mode, dtype in {0: 'i1', 1: 'i2', 2: 'f4', 6: 'u2', 12: 'f2'}.items():
    data = (abs(values) if mode == 6 else values).astype(dtype)
    with mrcfile.new(f'little_{mode}.mrc', overwrite=True) as m:
        m.set_data(data)
        m.set_extended_header(np.frombuffer(b'x' * 37, dtype='V37'))
        m.voxel_size = (1.5, 2.5, 3.25)
        m.header.origin = (-10, 20, 30)
        m.add_label('made by mrcfile')
        assert m.header.mode == mode
    raw = open(f'little_{mode}.mrc', 'rb').read()
    words = np.frombuffer(raw[:1024], 'u1').reshape(256, 4).copy()
    text = {26, 52, 53} | set(range(56, 256))
    for i in range(256):
        if i not in text: words[i] = words[i, ::-1]
    words[53] = [0x11, 0x11, 0, 0]
    swapped = np.frombuffer(raw[1024 + 37:], dtype).byteswap().tobytes()
    open(f'big_{mode}.mrc', 'wb').write(words.tobytes() + raw[1024:1024 + 37] + swapped)
    with mrcfile.open(f'big_{mode}.mrc') as m: assert (m.data == data).all()
)"),
            "");
  for (const int mode : {0, 1, 2, 6, 12}) {
    for (const char* order : {"little", "big"}) {
      const auto path = scratch / (std::string(order) + "_" + std::to_string(mode) + ".mrc");
      SCOPED_TRACE(path);
      const MrcHeader header = MrcReader(path).header();
      EXPECT_EQ(static_cast<int>(header.mode), mode);
      EXPECT_EQ(header.is_byte_swapped, std::string(order) == "big");
      EXPECT_EQ(header.nx, 5);
      EXPECT_EQ(header.ny, 4);
      EXPECT_EQ(header.nz, 3);
      EXPECT_EQ(header.extended_header_bytes, 37);
      EXPECT_EQ(header.voxel_size_A, (std::array<double, 3>{1.5, 2.5, 3.25}));
      EXPECT_EQ(header.origin_A, (std::array<double, 3>{-10, 20, 30}));
      EXPECT_NE(header.labels.back().find("made by mrcfile"), std::string::npos);
      const std::vector<float> values = read_all(path);
      for (std::size_t i = 0; i < values.size(); ++i) ASSERT_EQ(values[i], pattern(i, mode == 6));
    }
  }
}

// IMOD's stamp with and without the bit that says that ORIGIN has the sign of MRC2014.
TEST(Mrc, TurnsTheOriginOfImodAround) {
  const ScratchDirectory scratch;
  MrcSpec spec = spec_of(5, 4, 3, MrcMode::kFloat32);
  spec.origin_A = {50, 40, 0};
  MrcWriter(scratch / "a.mrc", spec).close();
  EXPECT_EQ(MrcReader(scratch / "a.mrc").header().origin_A, spec.origin_A);
  std::string bytes = testing::read_whole_file(scratch / "a.mrc");
  bytes[156] = 0;
  const auto imods = MrcReader(scratch.write("imod.mrc", bytes)).header().origin_A;
  EXPECT_EQ(imods, (std::array<double, 3>{-50, -40, 0}));
  bytes[152] = 0;
  EXPECT_EQ(MrcReader(scratch.write("none.mrc", bytes)).header().origin_A, spec.origin_A);
}

// IMOD packs two values of 4 bits into a byte of mode 0, and says so by a flag (mrc_format.txt).
TEST(Mrc, PackedBytesOfImodAreRefused) {
  const ScratchDirectory scratch;
  MrcWriter(scratch / "a.mrc", spec_of(4, 4, 2, MrcMode::kInt8)).close();
  std::string bytes = testing::read_whole_file(scratch / "a.mrc");
  bytes[156] = static_cast<char>(bytes[156] | 16);
  const auto path = scratch.write("packed.mrc", bytes);
  testing::expect_parts(testing::message_of<Error>([&] { MrcReader reader(path); }),
                        {"packed.mrc", "4 bits", "newstack"});
}

TEST(Mrc, HalfFloatsThatDoNotHoldTheValuesAreNamed) {
  const ScratchDirectory scratch;
  const auto warning_of = [&](MrcMode mode, float largest) {
    const testing::WarningCatcher warnings;
    MrcWriter writer(scratch / "half.mrc", spec_of(2, 1, 1, mode));
    writer.write_section(0, std::vector<float>{0.0f, -largest});
    writer.close();
    return warnings.text();
  };
  for (const float fits : {0.0f, 2e-5f, 1.0f, 65504.0f})
    EXPECT_EQ(warning_of(MrcMode::kFloat16, fits), "") << fits;
  EXPECT_NE(warning_of(MrcMode::kFloat16, 7e4f).find("end at 65504"), std::string::npos);
  EXPECT_NE(warning_of(MrcMode::kFloat16, 1e-10f).find("are multiples of 6e-08"),
            std::string::npos);
  EXPECT_EQ(warning_of(MrcMode::kFloat32, 1e30f), "");
}

TEST(Mrc, OtherProgramsReadWhatIsWritten) {
  if (!python_has("mrcfile")) GTEST_SKIP() << "python3-mrcfile is not installed";
  const ScratchDirectory scratch;
  for (const MrcMode mode :
       {MrcMode::kInt8, MrcMode::kInt16, MrcMode::kFloat32, MrcMode::kUint16, MrcMode::kFloat16}) {
    MrcSpec spec = spec_of(5, 4, 3, mode);
    spec.voxel_size_A = {1.7, 1.7, 3.3};
    spec.origin_A = {-5, 6, 7};
    spec.is_volume = mode != MrcMode::kInt16;
    spec.labels = {std::string(100, 'L')};  // 80 characters are kept
    MrcWriter writer(scratch / ("mode_" + std::to_string(static_cast<int>(mode)) + ".mrc"), spec);
    std::vector<float> section(20);
    for (const std::int64_t z : {2, 0, 1}) {  // in any order
      for (std::size_t i = 0; i < 20; ++i) {
        section[i] = pattern(static_cast<std::size_t>(z) * 20 + i, mode == MrcMode::kUint16);
      }
      writer.write_rows(z, 2, 2, std::span(section).last(10));
      writer.write_rows(z, 0, 2, std::span(section).first(10));
    }
    writer.close();
  }
  EXPECT_EQ(run_python(scratch, R"(
import io, numpy as np, mrcfile
values = (np.arange(5 * 4 * 3) * 37 % 41 - 20).astype(np.float32).reshape(3, 4, 5)
for mode in (0, 1, 2, 6, 12):
    name = f'mode_{mode}.mrc'
    problems = io.StringIO()
    assert mrcfile.validate(name, print_file=problems), name + problems.getvalue()
    with mrcfile.open(name) as m:
        want = abs(values) if mode == 6 else values
        assert m.header.mode == mode and (m.data == want).all(), name
        h = m.header
        assert h.dmin == want.min() and h.dmax == want.max()
        assert abs(h.dmean - want.mean()) < 1e-5 and abs(h.rms - want.std()) < 1e-4
        assert np.allclose([m.voxel_size.x, m.voxel_size.z], [1.7, 3.3], rtol=1e-7)
        assert (h.origin.x, h.origin.y, h.origin.z) == (-5, 6, 7)
        stamp, flags = np.frombuffer(open(name, 'rb').read()[152:160], '<i4')
        assert stamp == 1146047817 and flags == (5 if mode == 0 else 4)  # bytes are signed
        assert h.ispg == (0 if mode == 1 else 1) and h.nversion == 20141
        assert m.get_labels() == ['L' * 80]
)"),
            "");
}

TEST(Mrc, VoxelSizeIsExact) {
  const ScratchDirectory scratch;
  MrcSpec spec = spec_of(341, 1, 1);
  spec.voxel_size_A = {16.56, 16.56, 16.56};
  MrcWriter(scratch / "a.mrc", spec).close();
  EXPECT_NEAR(MrcReader(scratch / "a.mrc").header().voxel_size_A[0], 16.56, 16.56 * 6e-8);
}

TEST(Mrc, IntegersRoundAndSaturate) {
  const ScratchDirectory scratch;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> values{0.4f, 0.6f, -1.6f, 1e9f, -1e9f, nan};
  const auto written = [&](MrcMode mode) {
    MrcWriter writer(scratch / "a.mrc", spec_of(6, 1, 1, mode));
    writer.write_section(0, values);
    writer.close();
    return read_all(scratch / "a.mrc");
  };
  EXPECT_EQ(written(MrcMode::kInt8), (std::vector<float>{0, 1, -2, 127, -128, 0}));
  EXPECT_EQ(written(MrcMode::kInt16), (std::vector<float>{0, 1, -2, 32767, -32768, 0}));
  EXPECT_EQ(written(MrcMode::kUint16), (std::vector<float>{0, 1, 0, 65535, 0, 0}));
}

TEST(Mrc, ConsecutiveSectionsAreWrittenTogether) {
  const ScratchDirectory scratch;
  std::vector<float> values(2 * 3 * 4);
  std::iota(values.begin(), values.end(), 1.0f);
  MrcWriter writer(scratch / "a.mrc", spec_of(2, 3, 4));
  writer.write_sections(1, std::span(values).subspan(6));
  writer.write_sections(0, std::span(values).first(6));
  EXPECT_THROW(writer.write_sections(0, std::span(values).first(7)), std::logic_error);
  EXPECT_THROW(writer.write_sections(3, std::span(values).first(12)), std::logic_error);
  writer.close();
  EXPECT_EQ(read_all(scratch / "a.mrc"), values);
}

TEST(Mrc, UnwrittenRowsAreZeroAndCounted) {
  const ScratchDirectory scratch;
  MrcWriter writer(scratch / "a.mrc", spec_of(2, 2, 2));
  writer.write_rows(1, 0, 1, std::vector<float>{3, 5});
  writer.close();
  EXPECT_EQ(read_all(scratch / "a.mrc"), (std::vector<float>{0, 0, 0, 0, 3, 5, 0, 0}));
  const MrcHeader header = MrcReader(scratch / "a.mrc").header();
  EXPECT_EQ(header.min, 0);
  EXPECT_EQ(header.max, 5);
  EXPECT_EQ(header.mean, 1);
  EXPECT_NEAR(header.rms, std::sqrt(34.0 / 8 - 1), 1e-6);
}

TEST(Mrc, StatisticsDoNotDependOnThreads) {
  const ScratchDirectory scratch;
  const auto write = [&](const std::string& name, bool parallel) {
    MrcWriter writer(scratch / name, spec_of(33, 7, 40));
    const auto write_section = [&](std::int64_t z) {
      std::vector<float> section(33 * 7);
      for (std::size_t i = 0; i < section.size(); ++i) {
        section[i] = 1e4f + std::sin(static_cast<float>(i) + 0.1f * static_cast<float>(z));
      }
      writer.write_section(z, section);
    };
    if (parallel) {
      base::parallel_for("write sections", 40, [&](std::int64_t i) { write_section(39 - i); });
    } else {
      for (std::int64_t z = 0; z < 40; ++z) write_section(z);
    }
    writer.close();
  };
  write("a.mrc", false);
  write("b.mrc", true);
  EXPECT_EQ(testing::read_whole_file(scratch / "a.mrc"),
            testing::read_whole_file(scratch / "b.mrc"));
  EXPECT_NEAR(MrcReader(scratch / "a.mrc").header().rms, std::sqrt(0.5), 0.01);
}

TEST(Mrc, AbandonedWriterLeavesTheOldFile) {
  const ScratchDirectory scratch;
  const auto path = scratch.write("a.mrc", "an older result");
  {
    MrcWriter writer(path, spec_of(4, 4, 4));
    writer.write_section(0, std::vector<float>(16, 1.0f));
  }
  EXPECT_EQ(testing::read_whole_file(path), "an older result");
  EXPECT_EQ(scratch.num_files(), 1u);
}

TEST(Mrc, UnwritableDirectoryIsAnErrorBeforeAnyWork) {
  const ScratchDirectory scratch;
  EXPECT_THROW(MrcWriter(scratch / "absent/a.mrc", spec_of(4, 4, 4)), Error);
  EXPECT_THROW(MrcWriter(scratch / "a.mrc", spec_of(0, 4, 4)), Error);
  EXPECT_EQ(scratch.num_files(), 0u);
}

TEST(Mrc, FilesLargerThanTheDiskAreRefusedBeforeAnyWork) {
  const ScratchDirectory scratch;
  const auto refusal = [&](std::int64_t nx, std::int64_t ny, std::int64_t nz) {
    return message_of<Error>([&] { MrcWriter(scratch / "a.mrc", spec_of(nx, ny, nz)); });
  };
  constexpr std::int64_t kMost = (std::int64_t{1} << 31) - 1;
  EXPECT_NE(refusal(kMost, 1000, 1000).find("its disk has only"), std::string::npos);
  EXPECT_NE(refusal(1, kMost, 1000000).find("its disk has only"), std::string::npos);
  EXPECT_NE(refusal(1, kMost, kMost), "");  // whose rows take more memory
  EXPECT_FALSE(std::filesystem::exists(scratch / "a.mrc"));
}

TEST(Mrc, FilesBeyondFourGibibytesWork) {
  const ScratchDirectory scratch;
  if (std::filesystem::space(scratch.path()).available < std::uintmax_t{6} << 30)
    GTEST_SKIP() << "the disk is too small";
  const auto path = scratch / "large.mrc";
  std::vector<float> row(16384);
  for (std::size_t i = 0; i < row.size(); ++i) row[i] = static_cast<float>(i);
  MrcWriter writer(path, spec_of(16384, 16384, 5));  // 5 GiB, but only two rows are written
  writer.write_rows(4, 16383, 1, row);
  writer.write_rows(0, 0, 1, row);
  writer.close();
  struct stat status {};
  ASSERT_EQ(::stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_size, 1024 + (std::int64_t{5} << 30));
  const MrcReader reader(path);
  std::vector<float> found(row.size());
  reader.read_rows(4, 16383, 1, found);
  EXPECT_EQ(found, row);
  reader.read_rows(4, 16382, 1, found);  // 32-bit offsets would wrap to another place
  EXPECT_EQ(found, std::vector<float>(row.size()));
  EXPECT_EQ(reader.header().max, 16383);
}

// A header in which chosen words are changed.
struct Damage {
  const char* name;
  std::size_t offset;
  std::int32_t value;
  const char* expected;  // part of the message
};

class MrcHostileHeader : public ::testing::TestWithParam<Damage> {};

TEST_P(MrcHostileHeader, IsRefusedWithASentence) {
  const ScratchDirectory scratch;
  MrcWriter(scratch / "a.mrc", spec_of(4, 4, 4)).close();
  std::string bytes = testing::read_whole_file(scratch / "a.mrc");
  std::memcpy(bytes.data() + GetParam().offset, &GetParam().value, 4);
  scratch.write("a.mrc", bytes);
  const std::string message = message_of<Error>([&] { MrcReader reader(scratch / "a.mrc"); });
  EXPECT_NE(message.find("a.mrc"), std::string::npos) << message;
  EXPECT_NE(message.find(GetParam().expected), std::string::npos) << message;
}

INSTANTIATE_TEST_SUITE_P(Mrc, MrcHostileHeader,
                         ::testing::Values(Damage{"zero_size", 0, 0, "0 × 4 × 4"},
                                           Damage{"negative_size", 8, -4, "4 × 4 × -4"},
                                           Damage{"large_size", 4, 1 << 30, "truncated"},
                                           Damage{"unknown_mode", 12, 7, "mode 7"},
                                           Damage{"complex_mode", 12, 4, "complex"},
                                           Damage{"negative_mode", 12, -1, "mode -1"},
                                           Damage{"huge_extended_header", 92, 0x7fffffff,
                                                  "truncated"},
                                           Damage{"negative_extended_header", 92, -1, "-1 bytes"},
                                           Damage{"axis_order", 64, 3, "MAPC"}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(Mrc, OverflowingSizesAreRefused) {
  const ScratchDirectory scratch;
  MrcWriter(scratch / "a.mrc", spec_of(4, 4, 4)).close();
  std::string bytes = testing::read_whole_file(scratch / "a.mrc");
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int32_t largest = 0x7fffffff;
    std::memcpy(bytes.data() + 4 * axis, &largest, 4);
  }
  scratch.write("a.mrc", bytes);
  const std::string message = message_of<Error>([&] { MrcReader reader(scratch / "a.mrc"); });
  EXPECT_NE(message.find("more than any file"), std::string::npos) << message;
}

TEST(Mrc, TruncationTellsBothLengths) {
  const ScratchDirectory scratch;
  MrcWriter(scratch / "a.mrc", spec_of(4, 4, 4)).close();
  std::filesystem::resize_file(scratch / "a.mrc", 1200);
  const std::string message = message_of<Error>([&] { MrcReader reader(scratch / "a.mrc"); });
  EXPECT_NE(message.find("1280"), std::string::npos) << message;
  EXPECT_NE(message.find("1200"), std::string::npos) << message;
  std::filesystem::resize_file(scratch / "a.mrc", 1000);
  EXPECT_THROW(MrcReader(scratch / "a.mrc"), Error);
  EXPECT_THROW(MrcReader(scratch / "absent.mrc"), Error);
  EXPECT_THROW(MrcReader(scratch.path()), Error);
}

TEST(Mrc, MinimumAndMaximumTellBytesWithoutAStamp) {
  const ScratchDirectory scratch;
  const auto reads_255 = [&](float low, float high) {
    MrcWriter writer(scratch / "a.mrc", spec_of(2, 1, 1, MrcMode::kInt8));
    writer.write_section(0, std::vector<float>{-1, 5});
    writer.close();
    std::string bytes = testing::read_whole_file(scratch / "a.mrc");
    bytes[152] = 0;  // no stamp of IMOD
    std::memcpy(bytes.data() + 76, &low, sizeof low);
    std::memcpy(bytes.data() + 80, &high, sizeof high);
    scratch.write("a.mrc", bytes);
    return read_all(scratch / "a.mrc")[0] == 255.0f;
  };
  EXPECT_TRUE(reads_255(0, 255));
  EXPECT_TRUE(reads_255(-1, 200));
  EXPECT_FALSE(reads_255(-128, 127));
  EXPECT_FALSE(reads_255(-100, 130));
  EXPECT_FALSE(reads_255(0, 0));  // MRC2014's signed bytes, where nothing tells
}

TEST(Mrc, AStampThatTheModeContradictsDoesNotCount) {
  const ScratchDirectory scratch;
  MrcWriter writer(scratch / "a.mrc", spec_of(2, 1, 1, MrcMode::kFloat32));
  writer.write_section(0, std::vector<float>{-1, 5});
  writer.close();
  std::string bytes = testing::read_whole_file(scratch / "a.mrc");
  bytes[212] = bytes[213] = 0x11;  // big-endian
  scratch.write("a.mrc", bytes);
  EXPECT_EQ(read_all(scratch / "a.mrc"), (std::vector<float>{-1, 5}));
}

TEST(Mrc, ImodStampTellsSignedFromUnsignedBytes) {
  const ScratchDirectory scratch;
  MrcWriter writer(scratch / "a.mrc", spec_of(2, 1, 1, MrcMode::kInt8));
  writer.write_section(0, std::vector<float>{-1, 5});
  writer.close();
  EXPECT_EQ(read_all(scratch / "a.mrc"), (std::vector<float>{-1, 5}));
  std::string bytes = testing::read_whole_file(scratch / "a.mrc");
  bytes[156] = 0;  // IMOD's flag for signed bytes
  scratch.write("a.mrc", bytes);
  EXPECT_EQ(read_all(scratch / "a.mrc"), (std::vector<float>{255, 5}));
  bytes[152] = 0;  // without the stamp, MRC2014 applies: bytes are signed
  scratch.write("a.mrc", bytes);
  EXPECT_EQ(read_all(scratch / "a.mrc"), (std::vector<float>{-1, 5}));
}

}  // namespace
}  // namespace tomofield::io
