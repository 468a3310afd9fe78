#include "output/model_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "base/enum_names.h"
#include "base/random.h"
#include "hdf5_edits.h"
#include "io/hdf5/hdf5_file.h"
#include "io/hdf5/hdf5_objects.h"
#include "python_script.h"
#include "tomofield/error.h"
#include "tomofield/version.h"
#include "uneven_model.h"

namespace tomofield::output {
namespace {

using testing::message_of;
using testing::python_has;
using testing::read_whole_file;
using testing::run_python;
using testing::ScratchDirectory;
using testing::uneven_model;

TrainingState some_state() {
  TrainingState state;
  // This array is longer than one piece of 1 MiB.
  state.floats["adam m"] = std::vector<float>(300001, 0.5f);
  state.floats["adam m"].back() = -0.0f;
  state.floats["none"] = {};
  state.doubles["loss"] = {1.0 / 3.0, std::numeric_limits<double>::infinity(), -0.0};
  state.integers["step"] = {std::numeric_limits<std::int64_t>::min(), 41};
  return state;
}

void expect_same(const Model& a, const Model& b) {
  const field::Field& f = *a.field;
  const field::Field& g = *b.field;
  EXPECT_EQ(f.kind(), g.kind());
  EXPECT_EQ(f.thickness(), g.thickness());
  EXPECT_EQ(f.tree().roots(), g.tree().roots());
  ASSERT_EQ(f.tree().leaves(), g.tree().leaves());
  for (int i = 0; i < f.tree().num_leaves(); ++i) {
    EXPECT_EQ(f.tree().leaf(i).square, g.tree().leaf(i).square);
    EXPECT_EQ(f.tree().leaf(i).region, g.tree().leaf(i).region);
  }
  EXPECT_EQ(f.shapes(), g.shapes());
  EXPECT_EQ(f.bias, g.bias);
  EXPECT_EQ(f.activation.beta, g.activation.beta);
  EXPECT_TRUE(std::equal(f.parameters().begin(), f.parameters().end(), g.parameters().begin(),
                         g.parameters().end()));
  EXPECT_EQ(a.geometry.width, b.geometry.width);
  EXPECT_EQ(a.geometry.height, b.geometry.height);
  EXPECT_EQ(a.geometry.thickness, b.geometry.thickness);
  EXPECT_EQ(a.geometry.tilt_deg, b.geometry.tilt_deg);
  EXPECT_EQ(a.geometry.hand, b.geometry.hand);
  EXPECT_EQ(a.geometry.axis_x, b.geometry.axis_x);
  EXPECT_EQ(a.geometry.axis_z, b.geometry.axis_z);
  EXPECT_EQ(a.roi, b.roi);
  EXPECT_EQ(a.pixel_size_A, b.pixel_size_A);
  EXPECT_EQ(a.density_unit, b.density_unit);
  EXPECT_EQ(a.is_dark, b.is_dark);
  EXPECT_EQ(a.options_json, b.options_json);
}

std::string refusal(const std::filesystem::path& path) {
  TrainingState state;
  return message_of<Error>([&] { load_model(path, &state); });
}

// Expects an error whose message names the file and has `fact` in it.
void expect_refusal(const std::filesystem::path& path, const std::string& fact) {
  const std::string message = refusal(path);
  EXPECT_NE(message.find(path.filename().string()), std::string::npos) << message;
  EXPECT_NE(message.find(fact), std::string::npos) << message;
}

TEST(ModelFile, ComesBackBitForBit) {
  const ScratchDirectory scratch;
  for (const FieldKind kind : {FieldKind::kVm, FieldKind::kGrid}) {
    Model model = uneven_model(kind);
    model.is_dark = kind == FieldKind::kVm;
    const TrainingState state = some_state();
    save_model(scratch / "model.h5", model, &state);
    TrainingState loaded_state;
    const Model loaded = load_model(scratch / "model.h5", &loaded_state);
    expect_same(loaded, model);
    EXPECT_EQ(loaded_state, state);
    EXPECT_TRUE(std::signbit(loaded_state.floats["adam m"].back()));
    EXPECT_TRUE(std::signbit(loaded_state.doubles["loss"].back()));
    EXPECT_EQ(loaded.written_by, std::string("tomofield ") + library_version());
  }
}

TEST(ModelFile, SomeLeavesComeBackWithTheirMoments) {
  const ScratchDirectory scratch;
  const Model model = uneven_model(FieldKind::kVm);
  const field::Field& field = *model.field;
  std::vector<float> moments(field.num_parameters());
  for (std::size_t i = 0; i < moments.size(); ++i) moments[i] = static_cast<float>(i) + 0.5f;
  // Hands out the floats as several processes do: in pieces that know nothing of leaves.
  const auto in_pieces = [](std::span<const float> values) {
    return FloatSource(values.size(), [values](const FloatSource::Sink& sink) {
      for (std::size_t at = 0; at < values.size(); at += 77)
        sink(values.subspan(at, std::min<std::size_t>(77, values.size() - at)));
    });
  };
  TrainingState state;
  state.integers["step"] = {41};
  save_model(scratch / "whole.h5", field, model, &state, {{"m", FloatSource(moments)}});
  save_model(scratch / "pieces.h5", field, in_pieces(field.parameters()), model, &state,
             {{"m", in_pieces(moments)}});
  EXPECT_TRUE(read_whole_file(scratch / "whole.h5") == read_whole_file(scratch / "pieces.h5"));

  const std::vector<int> kept{1, field.tree().num_leaves() - 1};
  const Model part = load_part(scratch / "pieces.h5", [&](const field::Quadtree&) { return kept; });
  EXPECT_EQ(load_training(scratch / "pieces.h5"), state);
  std::vector<float> loaded(moments.size());
  load_floats(scratch / "pieces.h5", "m", *part.field, loaded);
  for (int leaf = 0; leaf < field.tree().num_leaves(); ++leaf) {
    const bool is_kept = std::ranges::find(kept, leaf) != kept.end();
    for (std::size_t i = field.offset(leaf); i < field.offset(leaf + 1); ++i) {
      ASSERT_EQ(part.field->parameters()[i], is_kept ? field.parameters()[i] : 0.0f);
      ASSERT_EQ(loaded[i], is_kept ? moments[i] : 0.0f);
    }
  }
  const auto refused = [&](const char* name, std::size_t size) {
    std::vector<float> values(size);
    return message_of<Error>(
        [&] { load_floats(scratch / "pieces.h5", name, *part.field, values); });
  };
  EXPECT_NE(refused("v", loaded.size()).find("'v' is missing"), std::string::npos);
  EXPECT_NE(refused("m", loaded.size() + 1).find("damaged"), std::string::npos);
}

TEST(ModelFile, WithoutTrainingStateGivesAnEmptyOne) {
  const ScratchDirectory scratch;
  save_model(scratch / "model.h5", uneven_model(FieldKind::kVm));
  TrainingState state = some_state();
  load_model(scratch / "model.h5", &state);
  EXPECT_EQ(state, TrainingState{});
}

TEST(ModelFile, HoldsTextsOfAnyLength) {
  const ScratchDirectory scratch;
  Model model = uneven_model(FieldKind::kGrid);
  model.options_json = "{\"list\": \"" + std::string(200000, 'x') + "\"}";
  save_model(scratch / "model.h5", model);
  EXPECT_EQ(load_model(scratch / "model.h5").options_json, model.options_json);
}

TEST(ModelFile, TheSameModelIsTheSameBytes) {
  const ScratchDirectory scratch;
  const TrainingState state = some_state();
  save_model(scratch / "a.h5", uneven_model(FieldKind::kVm), &state);
  save_model(scratch / "b.h5", uneven_model(FieldKind::kVm), &state);
  EXPECT_TRUE(read_whole_file(scratch / "a.h5") == read_whole_file(scratch / "b.h5"));
}

// Returns true if `path` is refused. Otherwise expects the same contents as before: the change was
// between items, where nothing refers to it.
bool is_refused(const std::filesystem::path& path, const Model& model, const TrainingState& state) {
  try {
    TrainingState loaded_state;
    const Model loaded = load_model(path, &loaded_state);
    expect_same(loaded, model);
    EXPECT_EQ(loaded_state, state);
    return false;
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find(path.filename().string()), std::string::npos)
        << error.what();
    return true;
  }
}

TEST(ModelFile, IsRefusedWhereverItIsCutOff) {
  const ScratchDirectory scratch;
  const Model model = uneven_model(FieldKind::kGrid);
  TrainingState state;
  state.floats["m"] = std::vector<float>(500, 1.0f);
  save_model(scratch / "whole.h5", model, &state);
  const std::string whole = read_whole_file(scratch / "whole.h5");
  ASSERT_FALSE(is_refused(scratch / "whole.h5", model, state));
  base::Random random(1);
  for (std::size_t length = 0; length < whole.size(); length += 1 + random.below(400)) {
    scratch.write("torn.h5", whole.substr(0, length));
    EXPECT_TRUE(is_refused(scratch / "torn.h5", model, state)) << length << " of " << whole.size();
    // This file is what remains when a file system keeps the length and loses the contents.
    scratch.write("torn.h5", whole.substr(0, length) + std::string(whole.size() - length, '\0'));
    const bool is_same = whole.find_first_not_of('\0', length) == std::string::npos;
    EXPECT_NE(is_refused(scratch / "torn.h5", model, state), is_same)
        << length << " of " << whole.size();
  }
  scratch.write("torn.h5", whole.substr(0, whole.size() - 1));
  expect_refusal(scratch / "torn.h5", "truncated");
}

TEST(ModelFile, AChangedByteIsFoundOrMeansNothing) {
  const ScratchDirectory scratch;
  const Model model = uneven_model(FieldKind::kGrid);
  TrainingState state;
  state.doubles["loss"] = {0.25, 0.125};
  save_model(scratch / "whole.h5", model, &state);
  const std::string whole = read_whole_file(scratch / "whole.h5");
  base::Random random(2);
  int num_refused = 0, num_tried = 0;
  for (std::size_t at = 0; at < whole.size(); at += 1 + random.below(80), ++num_tried) {
    std::string changed = whole;
    changed[at] = static_cast<char>(changed[at] ^ (1 << random.below(8)));
    SCOPED_TRACE(at);
    num_refused += is_refused(scratch.write("changed.h5", changed), model, state);
  }
  EXPECT_GT(num_refused, num_tried / 2);
}

TEST(ModelFile, RefusesForeignFiles) {
  const ScratchDirectory scratch;
  expect_refusal(scratch / "absent.h5", "does not exist");
  expect_refusal(scratch.write("text.h5", "a text"), "no HDF5 file");
  expect_refusal(scratch.write("empty.h5", ""), "no HDF5 file");
  expect_refusal(scratch.path(), "not a regular file");
  auto file = io::Hdf5File::create(scratch / "foreign.h5");
  file.root().write_number("voltage", 300.0);
  file.close();
  expect_refusal(scratch / "foreign.h5", "no model of tomofield");
}

TEST(ModelFile, RefusesANewerFormatAndNamesItsWriter) {
  const ScratchDirectory scratch;
  auto file = io::Hdf5File::create(scratch / "newer.h5");
  file.root().write_text("format", "tomofield model");
  file.root().write_integer("format_version", 4);
  file.root().write_text("written_by", "tomofield 9.8.7");
  file.close();
  expect_refusal(scratch / "newer.h5", "tomofield 9.8.7");
  expect_refusal(scratch / "newer.h5", "formats 2 and 3");
}

// Edits models with h5py and corrects the checksums of the arrays.
constexpr const char* kEditor = R"(
import h5py, numpy as np, shutil
P1, P2, P3, P4, P5 = (0x9e3779b185ebca87, 0xc2b2ae3d27d4eb4f, 0x165667b19e3779f9,
                      0x85ebca77c2b2ae63, 0x27d4eb2f165667c5)
mask = (1 << 64) - 1
rotl = lambda x, n: ((x << n) | ((x & mask) >> (64 - n))) & mask
turn = lambda acc, word: rotl((acc + word * P2) & mask, 31) * P1 & mask
def xxh64(data):
    words = [int(w) for w in np.frombuffer(data[:len(data) // 8 * 8], '<u8')]
    h = P5
    stripes = len(data) // 32
    if stripes:
        lanes = [(P1 + P2) & mask, P2, 0, -P1 & mask]
        for i in range(4 * stripes):
            lanes[i % 4] = turn(lanes[i % 4], words[i])
        h = sum(rotl(lane, n) for lane, n in zip(lanes, (1, 7, 12, 18))) & mask
        for lane in lanes:
            h = ((h ^ turn(0, lane)) * P1 + P4) & mask
    h = (h + len(data)) & mask
    for word in words[4 * stripes:]:
        h = (rotl(h ^ turn(0, word), 27) * P1 + P4) & mask
    if len(data) % 8:  # arrays are of whole 4-byte words
        h = (rotl(h ^ int.from_bytes(data[-4:], 'little') * P1 & mask, 23) * P2 + P3) & mask
    h = (h ^ h >> 33) * P2 & mask
    h = (h ^ h >> 29) * P3 & mask
    return h ^ h >> 32
def seal(name, item):
    if isinstance(item, h5py.Dataset):
        item.attrs['xxh64'] = np.bytes_('%016x' % xxh64(item[:].tobytes()))
def edit(number, change):
    path = 'damaged-%d.h5' % number
    shutil.copy('model.h5', path)
    with h5py.File(path, 'r+') as f:
        if change:
            exec(change)
        f.visititems(seal)
)";

TEST(ModelFile, RefusesWhatIsConsistentHdf5ButNoSoundModel) {
  if (!python_has("h5py,numpy")) GTEST_SKIP() << "python3-h5py is not installed";
  const ScratchDirectory scratch;
  save_model(scratch / "model.h5", uneven_model(FieldKind::kVm));
  struct Damage {
    const char* change;
    const char* fact;
  };
  const std::vector<Damage> damages = {
      {"", ""},  // the editor itself does no harm
      {"f['field/parameters'][3] = float('nan')", "parameter 3"},
      {"f['field/parameters'][3] = 1e10", "parameter 3"},
      {"del f['field/parameters']", "parameters"},
      {"p = f['field/parameters'][:-1]; del f['field/parameters']; f['field/parameters'] = p",
       "elements"},
      {"p = f['field/parameters'][:]; del f['field/parameters']; f['field/parameters'] = "
       "p.astype('f8')",
       "another type"},
      {"f['field'].attrs['kind'] = np.bytes_('mesh')", "mesh"},
      {"f['field'].attrs['bias'] = float('inf')", "bias"},
      {"f['field/leaves/nx'][2] = 1", "impossible shape"},
      {"f['field/leaves/nx'][2] = 8192", "impossible shape"},
      {"f['field/leaves/nz'][2] = 60000", "impossible shape"},
      {"for n in 'nx', 'ny', 'nz': f['field/leaves/' + n][:] = 200", "more parameters"},
      {"f['geometry'].attrs['thickness'] = 1e300", "geometry"},
      {"f['field'].attrs['thickness'] = 1e300", "thickness"},
      {"f['geometry'].attrs['axis_x'] = 1e300", "geometry"},
      {"f.attrs.modify('pixel_size_A', 1e300)", "pixel_size_A"},
      {"f['field/tree/node_size'][1] = 32", "quadtree"},
      {"f['field/tree'].attrs['columns'] = np.int64(1) << 40", "out of range"},
      {"f['geometry'].attrs['hand'] = 2", "geometry"},
      {"f['geometry/tilt_deg'][1] = float('nan')", "geometry"},
      {"f['geometry/roi'][2] = 1000", "region of interest"},
      {"f.attrs.modify('pixel_size_A', 0.0)", "pixel_size_A"},
      {"f['field'].attrs['thickness'] = 21.0", "thickness of its field"},
      {"f['geometry'].attrs['thickness'] = 43.0", "thickness of its field"},
      {"f.attrs.modify('contrast', np.array(b'DARK', dtype=h5py.string_dtype('utf-8', 4)))",
       "neither dark nor bright"},
      {"f.attrs.modify('x_tilt_deg', 91.0)", "x_tilt_deg"},
      {"f.attrs.modify('density_unit', 0.0)", "density_unit"},
      {"f.attrs.modify('density_unit', -40.0)", "density_unit"},
      {"f['field'].attrs.modify('softplus_beta', 1e-40)", "softplus_beta"},
      {"f.attrs.modify('density_unit', 1e-300)", "density_unit"},
      {"f['field/leaves/node'][2] = 1", "leaves"},
      {"f['field/leaves/offset'][2] = 16", "index of its parameters"},
      {"del f['geometry']", "geometry"},
  };
  std::string script = kEditor;
  for (std::size_t i = 0; i < damages.size(); ++i)
    script += "edit(" + std::to_string(i) + ", \"" + damages[i].change + "\")\n";
  ASSERT_EQ(run_python(scratch, script), "");
  EXPECT_EQ(refusal(scratch / "damaged-0.h5"), "");
  for (std::size_t i = 1; i < damages.size(); ++i) {
    SCOPED_TRACE(damages[i].change);
    expect_refusal(scratch / ("damaged-" + std::to_string(i) + ".h5"), damages[i].fact);
  }
}

TEST(ModelFile, RefusesLeavesWhoseNumberOfParametersWraps) {
  const ScratchDirectory scratch;
  Model model = uneven_model(FieldKind::kGrid);
  constexpr int kSide = 256;  // 2^16 leaves, which need 2^48 parameters each
  const field::RootGrid roots{
      .x0 = -60, .y0 = 0, .cell_size = 4096, .columns = kSide, .rows = kSide};
  model.field = make_field(
      FieldKind::kGrid,
      field::Quadtree(roots, std::vector<field::Region>(kSide * kSide, field::Region::kInterest)),
      4096.0, std::vector<field::LeafShape>(kSide * kSide, {.nx = 2, .ny = 2, .nz = 2}));
  model.geometry.thickness = 4096.0;
  save_model(scratch / "model.h5", model);
  testing::Hdf5Edits edits(read_whole_file(scratch / "model.h5"));
  const auto file = io::read_hdf5_objects(
      io::PositionedFile(scratch / "model.h5", io::PositionedFile::Access::kRead));
  const io::Hdf5Object& leaves = file.children.at("field").children.at("leaves");
  const std::vector<std::int64_t> counts(kSide * kSide, 65536);
  for (const char* axis : {"nx", "ny", "nz"})
    edits.put_data(static_cast<std::size_t>(leaves.children.at(axis).address),
                   std::as_bytes(std::span(counts)));
  expect_refusal(scratch.write("wrapped.h5", edits.bytes()), "more parameters");
}

TEST(ModelFile, ReplacesAModelAsAWholeOrNotAtAll) {
  const ScratchDirectory scratch;
  save_model(scratch / "model.h5", uneven_model(FieldKind::kVm));
  Model diverged = uneven_model(FieldKind::kVm);
  diverged.field->parameters()[7] = std::nanf("");
  const std::string message =
      message_of<Error>([&] { save_model(scratch / "model.h5", diverged); });
  EXPECT_NE(message.find("diverged"), std::string::npos) << message;
  expect_same(load_model(scratch / "model.h5"), uneven_model(FieldKind::kVm));
  save_model(scratch / "model.h5", uneven_model(FieldKind::kGrid));
  EXPECT_EQ(load_model(scratch / "model.h5").field->kind(), FieldKind::kGrid);
  EXPECT_EQ(scratch.num_files(), 1u) << "temporary files are left";
  EXPECT_THROW(save_model(scratch / "nowhere" / "model.h5", diverged), Error);
}

// Reads the layout of docs/model-format.md with another program, which evaluates equation 4 at a
// point by itself.
TEST(ModelFile, IsReadByH5py) {
  if (!python_has("h5py,numpy")) GTEST_SKIP() << "python3-h5py is not installed";
  const ScratchDirectory scratch;
  for (const FieldKind kind : {FieldKind::kVm, FieldKind::kGrid}) {
    const Model model = uneven_model(kind);
    const TrainingState state = some_state();
    save_model(scratch / "model.h5", model, &state);
    std::ofstream(scratch / "expected.txt")
        << std::hexfloat << model.field->density(40.0, 9.0, 2.5) << "\n";
    EXPECT_EQ(run_python(scratch, R"(
import h5py, numpy as np
f = h5py.File('model.h5', 'r')
assert f.attrs['format'].decode() == 'tomofield model'
assert f.attrs['format_version'] == 2
assert f.attrs['pixel_size_A'] == 3.3725 and f.attrs['density_unit'] == 40.0
assert f.attrs['contrast'].decode() == 'bright'
assert 'Ångström' in f.attrs['options_json'].decode('utf8')
geometry = f['geometry']
assert list(geometry['tilt_deg']) == [-60.0, -1.5, 0.0, 59.9]
assert list(geometry['roi']) == [10, 4, 110, 120]
assert geometry.attrs['hand'] == -1 and geometry.attrs['axis_x'] == 65.5
assert f['training/floats/adam m'].shape == (300001,) and f['training/integers/step'][1] == 41

field, tree, leaves = f['field'], f['field/tree'], f['field/leaves']
point = np.array([40.0, 9.0, 2.5])
inside = None
for leaf, node in enumerate(leaves['node']):
    corner = np.array([tree['node_x0'][node], tree['node_y0'][node]])
    size = tree['node_size'][node]
    offset = point[:2] - 0.5 - corner  # faces lie on the centres of pixels
    if np.all(offset >= 0) and np.all(offset < size):
        inside = leaf, np.append(offset / size, (point[2] - 0.5) / max(1, field.attrs['thickness'] - 1))
leaf, unit = inside
assert tree['node_size'][leaves['node'][leaf]] == 16 and not tree['node_is_margin'][leaves['node'][leaf]]
nx, ny, nz = (int(leaves[n][leaf]) for n in ('nx', 'ny', 'nz'))
rx, ry, rz = (int(leaves[n][leaf]) for n in ('rank_x', 'rank_y', 'rank_z'))
p = field['parameters'][leaves['offset'][leaf]:].astype('f8')
def take(*shape):
    global p
    array, p = p[:np.prod(shape)].reshape(shape), p[np.prod(shape):]
    return array
if field.attrs['kind'].decode() == 'vm':
    vx, myz, vy = take(nx, rx), take(nz, ny, rx), take(ny, ry)
    mxz, vz, mxy = take(nx, nz, ry), take(nz, rz), take(nx, ny, rz)
    vertices = (np.einsum('xr,zyr->xyz', vx, myz) + np.einsum('yr,xzr->xyz', vy, mxz)
                + np.einsum('zr,xyr->xyz', vz, mxy))
else:
    vertices = take(nx, nz, ny).transpose(0, 2, 1)
vertices = vertices + field.attrs['bias']
for axis, n in enumerate((nx, ny, nz)):
    at = unit[axis] * (n - 1)
    low = int(at)
    vertices = vertices[low] + (at - low) * (vertices[low + 1] - vertices[low])
beta = field.attrs['softplus_beta']
density = np.log1p(np.exp(beta * vertices)) / beta
expected = float.fromhex(open('expected.txt').read())
assert abs(density - expected) < 1e-6, (density, expected)
)"),
              "")
        << base::name_of(kind);
  }
}

}  // namespace
}  // namespace tomofield::output
