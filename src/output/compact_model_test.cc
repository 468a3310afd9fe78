#include "output/compact_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "base/random.h"
#include "python_script.h"
#include "scratch_directory.h"
#include "tomofield/error.h"
#include "uneven_model.h"

namespace tomofield::output {
namespace {

using testing::message_of;
using testing::python_has;
using testing::read_whole_file;
using testing::run_python;
using testing::ScratchDirectory;

constexpr compact::Budget kBudget{compact::Budget::Kind::kDecibels, 0.1};

// Returns a model with a compact field, and its codes.
Model compact_model(compact::LeafCodes& codes) {
  Model model = testing::uneven_model(FieldKind::kGrid);
  compact::CompactField made = compact::compress(*model.field, kBudget);
  model.field = std::move(made.field);
  codes = std::move(made.codes);
  return model;
}

TEST(CompactModel, ComesBackBitForBit) {
  const ScratchDirectory scratch;
  compact::LeafCodes codes;
  const Model model = compact_model(codes);
  save_model(scratch / "model.h5", *model.field, codes, model);
  TrainingState state;
  const Model loaded = load_model(scratch / "model.h5", &state);
  EXPECT_EQ(state, TrainingState{});
  EXPECT_EQ(loaded.options_json, model.options_json);
  EXPECT_EQ(loaded.field->kind(), FieldKind::kVm);
  EXPECT_EQ(loaded.field->shapes(), model.field->shapes());
  EXPECT_TRUE(std::ranges::equal(loaded.field->parameters(), model.field->parameters()));
  EXPECT_EQ(load_outline(scratch / "model.h5").tree.leaves(), model.field->tree().leaves());
  save_model(scratch / "again.h5", *model.field, codes, model);
  EXPECT_TRUE(read_whole_file(scratch / "model.h5") == read_whole_file(scratch / "again.h5"));
}

// The codes of other leaves are not read, so they may be damaged.
TEST(CompactModel, ALeafIsReadAlone) {
  const ScratchDirectory scratch;
  compact::LeafCodes codes;
  const Model model = compact_model(codes);
  const field::Field& field = *model.field;
  int kept = 0;
  while (field.offset(kept) == field.offset(kept + 1)) ++kept;
  int other = kept + 1;
  while (field.offset(other) == field.offset(other + 1)) ++other;
  codes.bytes[static_cast<std::size_t>(codes.offset[static_cast<std::size_t>(other)]) + 9] ^= 0x55;
  save_model(scratch / "model.h5", field, codes, model);
  const Model part =
      load_part(scratch / "model.h5", [&](const field::Quadtree&) { return std::vector{kept}; });
  for (std::size_t i = 0; i < field.num_parameters(); ++i) {
    const bool is_kept = field.offset(kept) <= i && i < field.offset(kept + 1);
    ASSERT_EQ(part.field->parameters()[i], is_kept ? field.parameters()[i] : 0.0f);
  }
  EXPECT_NE(message_of<Error>([&] { load_model(scratch / "model.h5"); }).find("model.h5"),
            std::string::npos);
}

TEST(CompactModel, AChangedByteIsFoundOrMeansNothing) {
  const ScratchDirectory scratch;
  compact::LeafCodes codes;
  const Model model = compact_model(codes);
  save_model(scratch / "model.h5", *model.field, codes, model);
  const std::string whole = read_whole_file(scratch / "model.h5");
  base::Random random(2);
  int num_refused = 0, num_tried = 0;
  for (std::size_t at = 0; at < whole.size(); at += 1 + random.below(160), ++num_tried) {
    std::string changed = whole;
    changed[at] = static_cast<char>(changed[at] ^ (1 << random.below(8)));
    SCOPED_TRACE(at);
    try {
      const Model loaded = load_model(scratch.write("changed.h5", changed));
      EXPECT_TRUE(std::ranges::equal(loaded.field->parameters(), model.field->parameters()));
    } catch (const Error& error) {
      ++num_refused;
      EXPECT_NE(std::string(error.what()).find("changed.h5"), std::string::npos) << error.what();
    }
  }
  EXPECT_GT(num_refused, num_tried / 2);
}

// An independent reader: h5py for the file, the program zstd for the codes.
TEST(CompactModel, IsWhatTheDocumentsSay) {
  if (!python_has("h5py,numpy") || std::system("zstd --version > /dev/null 2>&1") != 0)
    GTEST_SKIP() << "python3-h5py or zstd is not installed";
  const ScratchDirectory scratch;
  compact::LeafCodes codes;
  const Model model = compact_model(codes);
  save_model(scratch / "model.h5", *model.field, codes, model);
  std::string expected;
  for (int leaf = 0; leaf < model.field->tree().num_leaves(); ++leaf) {
    double sum = 0;
    const auto parameters = model.field->parameters().subspan(model.field->offset(leaf));
    for (std::size_t i = 0; i < model.field->offset(leaf + 1) - model.field->offset(leaf); ++i)
      sum += static_cast<double>(parameters[i] * parameters[i]);
    expected += std::to_string(sum) + " ";
  }
  const std::string script = R"(
import h5py, numpy as np, subprocess
f = h5py.File('model.h5', 'r')
code, leaves = f['field/code'], f['field/leaves']
offset, data, step = code['offset'][:], code['bytes'][:].tobytes(), code.attrs['step']
expected = ')" + expected + R"('.split()
for i, square in enumerate(expected):
    part = data[offset[i]:offset[i + 1]]
    plain = subprocess.run(['zstd', '-d', '-c'], input=part, capture_output=True).stdout if part else b''
    numbers, value, shift = [], 0, 0
    for byte in plain:
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            numbers.append(value >> 1 ^ -(value & 1))
            value = shift = 0
    nx, ny, nz = (int(leaves[n][i]) for n in ('nx', 'ny', 'nz'))
    total, at = 0.0, 0
    for n, m, rank in ((nx, nz * ny, leaves['rank_x'][i]), (ny, nx * nz, leaves['rank_y'][i]),
                       (nz, nx * ny, leaves['rank_z'][i])):
        rank = int(rank)
        total += rank  # the vectors have length 1
        at += n * rank
        total += (np.array(numbers[at:at + m * rank], float) ** 2).sum() * step ** 2
        at += m * rank
    assert at == len(numbers), (i, at, len(numbers))
    assert abs(total - float(square)) <= 1e-3 * (1 + float(square)), (i, total, square)
)";
  EXPECT_EQ(run_python(scratch, script), "");
}

}  // namespace
}  // namespace tomofield::output
