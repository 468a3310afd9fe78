#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "base/random.h"
#include "compact/compress.h"
#include "compact/decoded_field.h"
#include "output/model_file.h"
#include "output/sample_model.h"
#include "output/volume.h"
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

Model compact_model() {
  Model model = testing::uneven_model(FieldKind::kGrid);
  compact::CompactField made = compact::compress(*model.field, model.roi, kBudget);
  model.field = std::move(made.field);
  model.coded = std::move(made.coded);
  return model;
}

TEST(CompactModel, ComesBackBitForBit) {
  const ScratchDirectory scratch;
  const Model model = compact_model();
  save_model(scratch / "model.h5", model);
  TrainingState state;
  const Model loaded = load_model(scratch / "model.h5", &state);
  EXPECT_EQ(state, TrainingState{});
  EXPECT_EQ(loaded.options_json, model.options_json);
  EXPECT_EQ(loaded.field->shapes(), model.field->shapes());
  EXPECT_TRUE(std::ranges::equal(loaded.field->parameters(), model.field->parameters()));
  ASSERT_TRUE(loaded.coded);
  EXPECT_EQ(loaded.coded->codes.shapes, model.coded->codes.shapes);
  EXPECT_EQ(load_outline(scratch / "model.h5").tree.leaves(), model.field->tree().leaves());
  save_model(scratch / "again.h5", loaded);
  EXPECT_TRUE(read_whole_file(scratch / "model.h5") == read_whole_file(scratch / "again.h5"));
}

TEST(CompactModel, IsSampledWithoutBeingDecoded) {
  const ScratchDirectory scratch;
  save_model(scratch / "model.h5", compact_model());
  const Model decoded = load_to_sample(scratch / "model.h5");
  const Model undecoded = load_to_sample(scratch / "model.h5", 1000);
  ASSERT_TRUE(decoded.field);
  ASSERT_FALSE(undecoded.field);
  const auto expect_same = [&](const field::OrientedBox& box) {
    EXPECT_EQ(sample_box(decoded, box), sample_box(undecoded, box));
  };
  field::OrientedBox box = region_box(decoded, 1.0);
  expect_same(box);
  expect_same(region_box(decoded, 3.7));
  box.field_from_box = field::rotation_from_euler(90, 8, 270);  // a little about X
  expect_same(box);
  box.field_from_box = field::rotation_from_euler(10, 20, 30);
  expect_same(box);
  box = {.centre_px = {50, 90, 10}, .size = {40, 1, 20}, .voxel_px = 0.7};
  expect_same(box);
  box = {.centre_px = {-20, -10, 10}, .size = {90, 90, 40}};  // beyond the model as well
  expect_same(box);
  base::Random random(3);
  std::vector<field::Point> points;
  for (int i = 0; i < 2000; ++i)
    points.push_back({random.uniform(-50, 150), random.uniform(-50, 150), random.uniform(-2, 25)});
  EXPECT_EQ(sample_points(decoded, points), sample_points(undecoded, points));
  EXPECT_TRUE(sample_points(undecoded, {}).empty());
}

// Somebody may have changed numbers and made the checksums right again.
TEST(CompactModel, NumbersThatNoModelHasAreRefused) {
  const ScratchDirectory scratch;
  const auto refusal = [&](const std::function<void(Model&)>& change, std::size_t most_bytes) {
    Model model = compact_model();
    change(model);
    save_model(scratch / "model.h5", model);
    return message_of<Error>([&] {
      const Model loaded = load_to_sample(scratch / "model.h5", most_bytes);
      sample_box(loaded, region_box(loaded, 1.0));
    });
  };
  for (const std::size_t most_bytes : {std::size_t{1000}, std::size_t{1} << 30}) {
    for (const double number : {1e300, 1e15, 1e10}) {
      const std::string said =
          refusal([&](Model& model) { model.coded->codes.step[0] = number; }, most_bytes);
      EXPECT_NE(said.find("steps"), std::string::npos) << number << said;
    }
    // Codes times 0, or almost 0, would be an empty volume.
    EXPECT_NE(
        refusal([](Model& model) { std::ranges::fill(model.coded->codes.step, 0); }, most_bytes)
            .find("step of 0"),
        std::string::npos);
    EXPECT_NE(refusal([](Model& model) { model.coded->codes.step[0] = 1e-300; }, most_bytes), "");
    EXPECT_NE(
        refusal([](Model& model) { model.geometry.thickness *= 2; }, most_bytes).find("thick"),
        std::string::npos);
    for (const double unit : {1e300, 1e16, 0.0, -40.0, 1e-300})
      EXPECT_NE(refusal([&](Model& model) { model.density_unit = unit; }, most_bytes), "") << unit;
    const auto more_components = [](Model& model) {
      model.coded->codes.shapes[1].rank_x = model.coded->codes.shapes[1].nx + 1;
    };
    EXPECT_NE(refusal(more_components, most_bytes).find("components"), std::string::npos);
    EXPECT_NE(refusal([](Model& model) { model.coded->codes.shapes[1].nz = 4000; }, most_bytes)
                  .find("impossible shape"),
              std::string::npos);
    // Every number is plausible, but not what they make together.
    EXPECT_NE(refusal([](Model& model) { model.coded->codes.step[0] = 9e8; }, most_bytes), "");
    EXPECT_EQ(refusal([](Model&) {}, most_bytes), "");
  }
}

TEST(CompactModel, WhatCodesDoNotHaveIsRefused) {
  if (!python_has("h5py")) GTEST_SKIP() << "python3-h5py is not installed";
  const ScratchDirectory scratch;
  for (const std::string change :
       {"['bias'] = 0.5", "['softplus_beta'] = 3.0", "['kind'] = np.bytes_('grid')"}) {
    save_model(scratch / "model.h5", compact_model());
    ASSERT_EQ(run_python(scratch,
                         "import h5py, numpy as np\nwith h5py.File('model.h5', 'r+', "
                         "libver='latest') as f:\n    f['field'].attrs" +
                             change + "\n"),
              "");
    for (const std::size_t most_bytes : {std::size_t{1000}, std::size_t{1} << 30})
      EXPECT_NE(message_of<Error>([&] {
                  load_to_sample(scratch / "model.h5", most_bytes);
                }).find("codes"),
                std::string::npos)
          << change;
  }
}

TEST(CompactModel, TheMemoryToDecodeItCountsWhatEachThreadHolds) {
  const field::LeafShape leaf{
      .nx = 16, .ny = 16, .nz = 32, .rank_x = 16, .rank_y = 16, .rank_z = 32};
  const std::size_t factors = 16 * (16 + 512) + 16 * (16 + 512) + 32 * (32 + 256);
  const std::size_t vertices = 17 * 17 * 32;
  const std::vector<field::LeafShape> leaves(10, leaf);
  for (const int threads : {1, 4, 100})
    EXPECT_EQ(compact::decoded_bytes(leaves, threads),
              4 * (10 * vertices) +
                  static_cast<std::size_t>(std::min(threads, 10)) * (12 * factors + 4 * vertices));
}

TEST(CompactModel, APartHasTheLeavesThatAreChosen) {
  const ScratchDirectory scratch;
  const Model model = compact_model();
  save_model(scratch / "model.h5", model);
  const Model part =
      load_part(scratch / "model.h5", [](const field::Quadtree&) { return std::vector{1}; });
  EXPECT_TRUE(part.field->keeps(1));
  EXPECT_FALSE(part.field->keeps(0));
  for (std::size_t i = part.field->offset(1); i < part.field->offset(2); ++i)
    ASSERT_EQ(part.field->parameters()[i], model.field->parameters()[i]);
}

TEST(CompactModel, AChangedByteIsFoundOrMeansNothing) {
  const ScratchDirectory scratch;
  const Model model = compact_model();
  save_model(scratch / "model.h5", model);
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

// An independent reader: h5py for the file, Python's lzma for the codes.
TEST(CompactModel, IsWhatTheDocumentsSay) {
  if (!python_has("h5py,numpy")) GTEST_SKIP() << "python3-h5py is not installed";
  const ScratchDirectory scratch;
  Model model = compact_model();
  std::ranges::fill(model.coded->codes.face_weight, 0);  // decoded_field_test.cc tests them
  model.field = compact::decode_field(*model.coded);
  save_model(scratch / "model.h5", model);
  std::string expected;  // sums of squares over the vertices of leaves but for their upper faces
  for (int leaf = 0; leaf < model.field->tree().num_leaves(); ++leaf) {
    const field::LeafShape& s = model.field->shape(leaf);
    const float* value = model.field->parameters().data() + model.field->offset(leaf);
    double sum = 0;
    for (int i = 0; i < s.nx; ++i)
      for (int k = 0; k < s.nz; ++k)
        for (int j = 0; j < s.ny; ++j, ++value)
          if (i + 1 < s.nx && j + 1 < s.ny) sum += static_cast<double>(*value * *value);
    expected += std::to_string(sum) + " ";
  }
  const std::string script = R"(
import h5py, lzma, numpy as np, zlib
f = h5py.File('model.h5', 'r')
code, leaves = f['field/code'], f['field/leaves']
offset, data, step = code['offset'][:], code['bytes'][:].tobytes(), code['step'][0]
assert (code['step'][:] == step).all()
expected = ')" + expected + R"('.split()
lzma2 = [{'id': lzma.FILTER_LZMA2, 'dict_size': 1 << 16}]
for i, square in enumerate(expected):
    part = data[offset[i]:offset[i + 1]]
    plain = lzma.decompress(part[:-4], lzma.FORMAT_RAW, filters=lzma2) if part else b''
    assert not part or zlib.crc32(plain) == int.from_bytes(part[-4:], 'little')
    numbers, value, shift = [], 0, 0
    for byte in plain:
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            numbers.append(value >> 1 ^ -(value & 1))
            value = shift = 0
    nx, ny, nz = (int(leaves[n][i]) for n in ('nx', 'ny', 'nz'))
    values, at = np.zeros((nx, ny, nz)), 0
    for name, form, to in (('rank_x', (nx, nz, ny), 'ri,rkj->ijk'), ('rank_y', (ny, nx, nz), 'rj,rik->ijk'),
                           ('rank_z', (nz, nx, ny), 'rk,rij->ijk')):
        rank, n, m = int(leaves[name][i]), form[0], form[1] * form[2]
        vectors = np.array(numbers[at:at + n * rank], float).reshape(rank, n)
        matrices = np.array(numbers[at + n * rank:at + (n + m) * rank], float).reshape(rank, *form[1:])
        vectors /= np.sqrt((vectors**2).sum(1, keepdims=True))
        values += np.einsum(to, vectors, matrices * step)
        at += (n + m) * rank
    assert at == len(numbers), (i, at, len(numbers))
    assert abs((values**2).sum() - float(square)) <= 1e-3 * (1 + float(square)), (i, square)
)";
  EXPECT_EQ(run_python(scratch, script), "");
}

}  // namespace
}  // namespace tomofield::output
