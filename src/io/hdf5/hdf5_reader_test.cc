#include "io/hdf5/hdf5_reader.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/random.h"
#include "hdf5_edits.h"
#include "io/hdf5/hdf5_file.h"
#include "io/hdf5/lookup3.h"
#include "python_script.h"
#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using testing::Hdf5Edits;
using testing::message_of;
using testing::python_has;
using testing::read_whole_file;
using testing::run_python;
using testing::ScratchDirectory;

TEST(Lookup3, HasTheAuthorsValues) {
  // From the comments and the self-test of lookup3.c.
  EXPECT_EQ(lookup3(""), 0xdeadbeefu);
  EXPECT_EQ(lookup3("Four score and seven years ago"), 0x17770551u);
}

std::filesystem::path write_some(const ScratchDirectory& scratch) {
  auto file = Hdf5File::create(scratch / "some.h5");
  Hdf5Group root = file.root();
  root.write_text("name", "a specimen");
  root.write_number("length", 2.5);
  root.write_integer("count", -7);
  root.write_array<double>("doubles", std::vector<double>{1, 2, 3});
  Hdf5Group group = root.create_group("group");
  group.write_array<float>("floats", std::vector<float>{1, 2});
  group.write_array<std::int64_t>("none", std::vector<std::int64_t>{});
  file.close();
  return scratch / "some.h5";
}

// Reads everything that a file of write_some() has.
void read_some(const std::filesystem::path& path) {
  const StoredGroup root = Hdf5Reader(path).root();
  root.text("name");
  root.number("length", 10);
  root.integer("count");
  root.read_array<double>("doubles");
  const StoredGroup group = root.group("group");
  group.read_array<float>("floats");
  group.read_floats("floats", [](std::span<const float>) {});
  group.read_array<std::int64_t>("none");
}

TEST(Hdf5Reader, ReadsWhatHdf5FileWrites) {
  const ScratchDirectory scratch;
  const StoredGroup root = Hdf5Reader(write_some(scratch)).root();
  EXPECT_EQ(root.text("name"), "a specimen");
  EXPECT_EQ(root.number("length", 10), 2.5);
  EXPECT_EQ(root.number("count", 10), -7.0);
  EXPECT_EQ(root.integer("count"), -7);
  EXPECT_EQ(root.read_array<double>("doubles"), (std::vector<double>{1, 2, 3}));
  EXPECT_EQ(root.names(), (std::vector<std::string>{"doubles", "group"}));
  EXPECT_TRUE(root.has("group") && !root.has("name") && root.has_attribute("name"));
  const StoredGroup group = root.group("group");
  EXPECT_EQ(group.read_array<float>("floats"), (std::vector<float>{1, 2}));
  EXPECT_TRUE(group.read_array<std::int64_t>("none").empty());
}

TEST(Hdf5Reader, NamesWhatIsMissingOrOfAnotherKind) {
  const ScratchDirectory scratch;
  const StoredGroup root = Hdf5Reader(write_some(scratch)).root();
  const auto refuses = [&](const char* item, auto&& read) {
    const std::string said = message_of<Error>(read);
    EXPECT_NE(said.find(item), std::string::npos) << said;
    EXPECT_NE(said.find("some.h5"), std::string::npos) << said;
  };
  refuses("width", [&] { root.number("width", 10); });
  refuses("name", [&] { root.number("name", 10); });
  refuses("2.5", [&] { root.number("length", 2); });
  refuses("length", [&] { root.text("length"); });
  refuses("length", [&] { root.integer("length"); });
  refuses("length", [&] { root.group("length"); });
  refuses("doubles", [&] { root.group("doubles"); });
  refuses("doubles", [&] { root.read_array<float>("doubles"); });
  refuses("group", [&] { root.array_size("group"); });
  refuses("/group/ints", [&] { root.group("group").array_size("ints"); });
  std::vector<double> two(2);
  refuses("3 elements", [&] { root.read_array<double>("doubles", two); });
}

TEST(Hdf5Reader, RefusesWhatTomofieldDoesNotWrite) {
  if (!python_has("h5py,numpy")) GTEST_SKIP() << "python3-h5py is not installed";
  const ScratchDirectory scratch;
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"f['a'] = np.zeros(4)", ""},
      {"f['a'] = h5py.SoftLink('/etc/passwd')", "soft link"},
      {"f['a'] = h5py.ExternalLink('other.h5', '/a')", "external link"},
      {"f.create_dataset('a', (4,), 'f4', external=[('/etc/passwd', 0, 16)])", "another file"},
      {"f.create_dataset('a', (4,), 'f4', chunks=(2,))", "chunks"},
      {"f.create_dataset('a', (4,), 'f4', compression='gzip')", ""},
      {"f['a'] = np.zeros((2, 2))", "one-dimensional"},
      {"f['a'] = np.zeros(4, '>f4')", "another type"},
      {"f['a'] = np.zeros(4, 'i2')", "another type"},
      {"f['a'] = np.zeros(4, [('x', 'f4'), ('y', 'i8')])", "another type"},
      {"f['a'] = 'text of any length'", "another type"},
      {"f.attrs['a'] = 'text of any length'", "another type"},
      {"f['a'] = np.zeros(4); f['b'] = f['a']", "header message"},
      {"g = f.create_group('g'); g['loop'] = f['/']", ""},
      {"[f.create_group('g%d' % i) for i in range(20)]", "many members"},
      {"[f.attrs.__setitem__('a%d' % i, 1.0) for i in range(20)]", "many attributes"},
      {"v = h5py.VirtualLayout((4,), 'f4'); v[:] = h5py.VirtualSource('other.h5', 'a', (4,)); "
       "f.create_virtual_dataset('a', v)",
       "pieces of other files"},
      {"f.create_dataset('a', (1 << 50,), 'f4', fillvalue=1)", "beyond its end"},
  };
  std::string script = "import h5py, numpy as np\n";
  for (std::size_t i = 0; i < cases.size(); ++i) {
    script += "with h5py.File('" + std::to_string(i) + ".h5', 'w', libver='latest') as f:\n    " +
              cases[i].first + "\n";
  }
  script += "h5py.File('old.h5', 'w')['a'] = np.zeros(4)\n";
  ASSERT_EQ(run_python(scratch, script), "");
  for (std::size_t i = 0; i < cases.size(); ++i) {
    SCOPED_TRACE(cases[i].first);
    const auto path = scratch / (std::to_string(i) + ".h5");
    const std::string said = message_of<Error>([&] { Hdf5Reader{path}; });
    EXPECT_NE(said.find(cases[i].second), std::string::npos) << said;
    EXPECT_EQ(said.empty(), i == 0) << said;
  }
  const std::string old = message_of<Error>([&] { Hdf5Reader{scratch / "old.h5"}; });
  EXPECT_NE(old.find("superblock"), std::string::npos) << old;
}

TEST(Hdf5Reader, NothingWithRightChecksumsMakesItCrashOrTakeMemory) {
  const ScratchDirectory scratch;
  const Hdf5Edits whole(read_whole_file(write_some(scratch)));
  ASSERT_GT(whole.parts().size(), 4u);
  base::Random random(1);
  const std::vector<std::uint64_t> wild = {
      0, 1, 7, 48, 255, 65535, 0x7fffffff, 0xffffffff, 1u << 30, ~0ull, ~0ull >> 1, 1ull << 63};
  int num_refused = 0;
  constexpr int kTries = 500;
  for (int i = 0; i < kTries; ++i) {
    Hdf5Edits changed = whole;
    const auto& part = whole.parts()[random.below(whole.parts().size())];
    const std::size_t at = part.begin + random.below(part.size);
    if (random.below(2) == 0) {
      changed.put(at, std::string(1, static_cast<char>(random.below(256))));
    } else {
      const std::uint64_t value = wild[random.below(wild.size())];
      const std::size_t width =
          std::min<std::size_t>(std::size_t{1} << random.below(4), part.begin + part.size - at);
      changed.put(at, {reinterpret_cast<const char*>(&value), width});
    }
    scratch.write("changed.h5", changed.bytes());
    num_refused += message_of<Error>([&] { read_some(scratch / "changed.h5"); }).empty() ? 0 : 1;
  }
  EXPECT_GT(num_refused, kTries / 2);
}

TEST(Hdf5Reader, GivesNoByteOutTwice) {
  const ScratchDirectory scratch;
  const std::string whole = read_whole_file(write_some(scratch));
  // The link to the group leads to the root, which is a loop.
  const std::size_t name = whole.find("\x05group");
  ASSERT_NE(name, std::string::npos);
  std::uint64_t root = 0;
  std::memcpy(&root, whole.data() + 36, sizeof root);
  scratch.write("loop.h5", Hdf5Edits(whole).put_number(name + 6, root).bytes());
  const std::string said = message_of<Error>([&] { Hdf5Reader{scratch / "loop.h5"}; });
  EXPECT_NE(said.find("overlap"), std::string::npos) << said;
}

}  // namespace
}  // namespace tomofield::io
