// Writes the files that the fuzz targets begin with: write_seeds FOLDER makes FOLDER/TARGET/….

#include <tiffio.h>

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "align/alignment_record.h"
#include "base/threads/parallel.h"
#include "checkpoint/checkpoint.h"
#include "checkpoint/tile_record.h"
#include "compact/compress.h"
#include "geometry/view_warp.h"
#include "io/images/mrc.h"
#include "small_fit.h"
#include "tune/trial_record.h"
#include "tune/tuning.h"
#include "uneven_model.h"

namespace {

namespace fs = std::filesystem;
using namespace tomofield;

constexpr int kViews = 5, kWidth = 24, kHeight = 20;

const std::string kAngles = "-40\n-20\n0\n+20.5\n4e1\n";
const std::string kTransforms =
    "1 0 0 1 0 0\n0.9 0.1 -0.1 0.9 1.5 -2\n1 0 0 1 0 0\n1 0 0 1 0.25 0\n-1 0 0 1 0 0\n";
const std::string kXTilts = "0.5\n0.5\n0.5\n0.5\n0.5\n";
const std::string kAreTomo =
    "# AreTomo Alignment\n# RawSize = 24 20 5\n# NumPatches = 1\n# DarkFrame = 1 1 -20\n"
    "# AlphaOffset = 1.5\n# BetaOffset = 0.25\n"
    "0 5 1.0 1 -2 nan 1 1 0 -40\n2 5 1.0 1 -2 1 1 1 0 0\n3 5 1.0 1 -2 1 1 1 0 20\n"
    "4 5 1.0 1 -2 1 1 1 0 40\n# Local Alignment\n0 0 1.0 2.0 0.1 0.2 1.0\n"
    "1 0 1.0 2.0 0.1 0.2 1.0\n2 0 1.0 2.0 0.1 0.2 1.0\n3 0 1.0 2.0 0.1 0.2 1.0\n";
const std::string kTable =
    "stack,path2,thickness,\"a \"\"b\"\"\"\r\n/dev/null,true,\"1,2\",\n\n/,, 5 ,false\n";
const std::string kMdoc =
    "PixelSpacing = 2.17\n[T = Tilt axis angle = 85.9]\n\n[ZValue = 0]\nTiltAngle = -40\n"
    "[ZValue = 1]\nTiltAngle = -20\n[ZValue = 2]\nTiltAngle = 0\n[ZValue = 3]\nTiltAngle = 20\n"
    "[ZValue = 4]\nTiltAngle = 40\nPixelSpacing = 2.17\n";
const std::string kTiltCom =
    "$setenv IMOD_OUTPUT_FORMAT MRC\n$tilt -StandardInput\nInputProjections TS_ali.mrc\n"
    "IMAGEBINNED 2\nTILTFILE TS.tlt\nTHICKNESS 24\nXAXISTILT 1.5\nLOG 0.0\nFULLIMAGE 24 20\n"
    "SUBSETSTART -2 0\nOFFSET 0.5 1\nSHIFT 2 -3\nWIDTH 12\nSLICE 2 9\nEXCLUDELIST2 1,3-4\n"
    "XTILTFILE TS.xtilt\nMODE 1\n$if (-e ./savework) ./savework\n";
const std::string kNewstCom =
    "$newstack -StandardInput\nInputFile\tTS.st\nOutputFile\tTS_ali.mrc\nTransformFile\tTS.xf\n"
    "SizeToOutputInXandY\t10,8\nOffsetsInXandY\t1.0,0.0\n#DistortionField\t.idf\nBinByFactor\t2\n";
const std::string kRelionViews =
    "\n# version 50001\n\ndata_TS_01\n\nloop_\n_rlnMicrographName #1\n_rlnTomoYTilt #2\n"
    "_rlnTomoZRot #3\n_rlnTomoXShiftAngst #4\n_rlnTomoYShiftAngst #5\n_rlnDefocusU #6\n"
    "M/a.mrc -3.0 85.3 1.5 -2 30000\n2@s.mrcs 0.0 85.3 0 0 None\n";
const std::string kRelionTomograms =
    "data_global\n\nloop_\n_rlnTomoName #1\n_rlnTomoTiltSeriesStarFile #2\n_rlnTomoHand #3\n"
    "_rlnTomoTiltSeriesPixelSize #4\n_rlnTomoSizeX #5\n_rlnTomoSizeY #6\n_rlnTomoSizeZ #7\n"
    "TS_01 t/TS_01.star -1.0 2.39 4092 4000 1392\n\"TS 02\" t/TS_02.star 1 2.39 0 None 'x'\n";
const std::string kTomostar =
    "\ndata_\n\nloop_\n_wrpMovieName #1\n_wrpAngleTilt #2\n_wrpAxisAngle #3\n_wrpDose #4\n"
    "_wrpAxisOffsetX #5\n_wrpAxisOffsetY #6\n../f/a.eer 45.01 83.94 116.1 3 -4\n";
const std::string kWarpXml =
    "<TiltSeries LevelAngleX=\"0.5\" LevelAngleY=\"-1\" VolumeDimensionsAngstrom=\"9, 9, 9\">\n"
    "<Angles>-60\n-57.5</Angles><Dose>3\n0</Dose><UseTilt>True\nFalse</UseTilt>\n"
    "<AxisAngle>-4.3\n-4.3</AxisAngle><AxisOffsetX>271.8\n1</AxisOffsetX>\n"
    "<MoviePath>../2/a.tif\n../2/b.tif</MoviePath>\n"
    "<GridMovementX Width=\"1\" Height=\"1\" Depth=\"2\"><Node X=\"0\" Y=\"0\" Z=\"0\" "
    "Value=\"1\"/><Node X=\"0\" Y=\"0\" Z=\"1\" Value=\"2\"/></GridMovementX>\n"
    "<CTF><Param Name=\"Voltage\" Value=\"300\"/></CTF><GridCTF Width=\"1\" Height=\"1\">"
    "<Node X=\"0\" Y=\"0\" Z=\"0\" Value=\"4.5\"/></GridCTF></TiltSeries>\n";
const std::string kCtffind =
    "# Pixel size: 1.327 Angstroms ; acceleration voltage: 300.0 keV ; spherical aberration: 2.70 "
    "mm "
    "; amplitude contrast: 0.07\n# Columns: #1 - micrograph number; #2 - defocus 1 [Angstroms]\n"
    "1.000000 14477.8 13500.0 75.0 0.5 0.001 12.1\n3.000000 19371.7 18665.4 -39.9 0 0.006 inf\n";
const std::string kDefocus2 = "1\t3\t-60.0\t-56.0\t4000.0\t2\n4\t6\t-54.0\t-50.0\t4600.0\n";
const std::string kDefocus3 =
    "47 0 0. 0. 0 3\n1 1 -3 -3 4100 3900 0.52 1.57 0.01\n3 3 -3 -3 4100 0 0.52 1.57 0.01\n";
const std::string kFiducials = "1 1 5 6 0\n1 1 5.5 6 1\n1 2 12 10 2\n1 2 13 10 3\n";
const std::string kConfig =
    "thickness = 24\ntv = 1.5\nfield = \"grid\"\nroi = [0, 0, 16, 16]\nno-margin = true\n"
    "center = \"12,10\"\nmode = 12\nseed = 7\n";

const std::string kRequest =
    "GET /k/plane?volume=0&center=1%2C2,3&right=1,0,0&up=0,1,0&width=4&height=3&step=0.5 "
    "HTTP/1.1\r\nHost: 127.0.0.1:80\r\nConnection: close";
const std::string kPlan =
    R"({"stack":"a.mrc","views":3,"view_size_px":[4,4],"pixel_size_A":10,"parameters":9,"steps":4,)"
    R"("threads":2,"memory_bytes":1300,"memory_bytes_of_one_thread":1000,"core_seconds":1.5,)"
    R"("sample_steps":5,"result_bytes":7,"disk_bytes":9,"trials":6,"open_variation":true,)"
    R"("open_spike_rank":false,"open_prior":true,"inputs":["a.mrc"],"results":["o/a.mrc"]})";
const std::string kJobs =
    R"({"overwrites":true,"jobs":[{"name":"a","output":"o/a.mrc","command":["reconstruct"],)"
    R"("skipped":false,"memory_bytes_of_one_thread":1,"memory_bytes_a_thread":1,)"
    R"("core_seconds":null,"sample_steps":1,"result_bytes":1,"disk_bytes":1,)"
    R"("open_variation":true,"open_spike_rank":true,"open_prior":true,"trials":3}]})";
const std::string kCells("a\0'b \"c\0data_x\0loop_\0\ntwo\nlines\0None\0", 37);

// Describes a file of text for the fuzz target of one reader.
struct Seed {
  const char* reader;
  const char* name;
  std::string text;
};

void write(const fs::path& path, const std::string& contents) {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << contents;
}

std::string contents_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void write_stack(const fs::path& path, io::MrcMode mode) {
  fs::create_directories(path.parent_path());
  io::MrcSpec spec;
  spec.nx = kWidth;
  spec.ny = kHeight;
  spec.nz = kViews;
  spec.mode = mode;
  spec.voxel_size_A.fill(10);
  spec.labels = {"a seed"};
  io::MrcWriter file(path, spec);
  base::Random random(1);
  for (int section = 0; section < kViews; ++section) {
    std::vector<float> values(static_cast<std::size_t>(kWidth * kHeight));
    for (float& value : values) value = static_cast<float>(random.uniform(50, 100));
    file.write_rows(section, 0, kHeight, values);
  }
  file.close();
}

// Writes TIFF files of two pages, in strips and in tiles, plain and compressed.
void write_tiffs(const fs::path& folder) {
  fs::create_directories(folder);
  struct Kind {
    const char* name;
    std::uint16_t bits, format, compression;
    bool is_tiled;
  };
  for (const Kind kind : {Kind{"bytes", 8, SAMPLEFORMAT_UINT, COMPRESSION_NONE, false},
                          Kind{"shorts", 16, SAMPLEFORMAT_INT, COMPRESSION_LZW, false},
                          Kind{"floats", 32, SAMPLEFORMAT_IEEEFP, COMPRESSION_ADOBE_DEFLATE, true},
                          Kind{"packbits", 8, SAMPLEFORMAT_UINT, COMPRESSION_PACKBITS, false},
                          Kind{"deflate", 16, SAMPLEFORMAT_UINT, COMPRESSION_DEFLATE, false},
                          Kind{"lzma", 16, SAMPLEFORMAT_UINT, COMPRESSION_LZMA, true},
                          Kind{"zstd", 32, SAMPLEFORMAT_IEEEFP, COMPRESSION_ZSTD, false},
                          Kind{"lerc", 32, SAMPLEFORMAT_IEEEFP, COMPRESSION_LERC, true},
                          Kind{"jpeg", 8, SAMPLEFORMAT_UINT, COMPRESSION_JPEG, false},
                          Kind{"webp", 8, SAMPLEFORMAT_UINT, COMPRESSION_WEBP, false}}) {
    if (!TIFFIsCODECConfigured(kind.compression)) continue;
    TIFF* file = TIFFOpen((folder / kind.name).c_str(), "w");
    for (int page = 0; page < 2; ++page) {
      TIFFSetField(file, TIFFTAG_IMAGEWIDTH, kWidth);
      TIFFSetField(file, TIFFTAG_IMAGELENGTH, kHeight);
      TIFFSetField(file, TIFFTAG_BITSPERSAMPLE, kind.bits);
      TIFFSetField(file, TIFFTAG_SAMPLEFORMAT, kind.format);
      TIFFSetField(file, TIFFTAG_COMPRESSION, kind.compression);
      TIFFSetField(file, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
      std::vector<char> values(static_cast<std::size_t>(32 * 32 * kind.bits / 8), 7);
      if (kind.is_tiled) {
        TIFFSetField(file, TIFFTAG_TILEWIDTH, 32);
        TIFFSetField(file, TIFFTAG_TILELENGTH, 32);
        TIFFWriteEncodedTile(file, 0, values.data(), TIFFTileSize(file));
      } else {
        TIFFSetField(file, TIFFTAG_ROWSPERSTRIP, kHeight);
        TIFFWriteEncodedStrip(file, 0, values.data(), TIFFStripSize(file));
      }
      TIFFWriteDirectory(file);
    }
    TIFFClose(file);
  }
}

// Returns one file of a series in the form that series_fuzz reads.
std::string part(int kind, const std::string& contents) {
  const auto length = static_cast<std::uint32_t>(contents.size());
  return std::string(1, static_cast<char>(kind)) +
         std::string(reinterpret_cast<const char*>(&length), sizeof length) + contents;
}

void write_series(const fs::path& folder, const std::string& stack) {
  const std::string head = part(0, stack);
  write(folder / "imod", head + part(1, kAngles) + part(2, kTransforms) + part(3, kXTilts));
  write(folder / "aretomo", head + part(4, kAreTomo));
  write(folder / "mdoc", head + part(5, kMdoc) + part(6, kFiducials));
  write(folder / "mask", head + part(1, kAngles) + part(7, stack));
}

// Writes trials and their tuning to `folder`, and what a batch makes of them to `batch`.
void write_trials(const fs::path& folder, const fs::path& batch) {
  using namespace tune;
  const TrialSettings settings{Penalty::kSmooth, 5, 12, 30};
  const tune::HeldOutScore score{1.25, {1.0, 1.5}};
  const nlohmann::json trial = tune::to_json(tune::FitTrial{settings, score, 2.5});
  write(folder / "file", nlohmann::json{{"fingerprint", "{}"}, {"trials", {trial, trial}}}.dump());
  const nlohmann::json chosen = settings_json(settings);
  nlohmann::json choice = chosen, vote = chosen;
  vote["series"] = "a";
  choice["votes"] = {vote, {{"series", "b"}, {"failure", "no memory"}}};
  write(batch / "choice", choice.dump());
  const TunedFit tuned{
      .settings = settings, .trials = {{settings, score, 2.5}}, .predicted_views = {3, 9}};
  write(folder / "tuning", tuning_json(tuned).dump());
  write(batch / "vote", tuning_json(tuned).dump());
}

// Writes two records of an alignment: a plain one, and one with beads, a pose and local motion.
void write_alignments(const fs::path& folder) {
  using namespace alignment;
  AlignmentRecord record{
      .origin = {.num_sections = 3,
                 .size_px = {kWidth, kHeight},
                 .files = {{"tlt", "00ff"}},
                 .header_tilts = "01",
                 .pixels = "02",
                 .made_with = {{"seed", 1}}},
      .is_accepted = true,
      .freedoms = {.rotation = true, .magnification = true, .tilt = true},
      .held_out = {.before = 0.5, .after = 0.4, .gain = {.mean = 0.1, .error = 0.01}},
      .steps_px = {1.0, 0.1},
      .seconds = 1.5};
  for (int section = 0; section < 3; ++section)
    record.views.push_back({.section = section,
                            .tilt_deg = 20.0 * section - 20,
                            .shift_px = {1.5, -2},
                            .rotation_deg = 0.25,
                            .log_magnification = 0.01,
                            .tilt_change_deg = 0.5,
                            .agreement = {.correlation = 0.9, .error_px = {0.1, 0.2}},
                            .is_left_out = section == 1});
  write(folder / "plain", to_json(record).dump());
  record.pose = FoundPose{.pose = {.thickness_px = 20, .pitch_deg = 1},
                          .error = {.thickness_px = 2, .pitch_deg = 0.1}};
  record.beads = BeadRecord{5, 2.0, 2.0, 0.3, {.mean = 0.1, .error = 0.01}, true};
  record.local =
      LocalRecord{.trial = {.held_out = record.held_out, .steps_px = {0.1}, .is_accepted = true},
                  .size_px = {kWidth, kHeight},
                  .rms_px = 0.2};
  for (AlignedView& view : record.views)
    view.local = geometry::ViewWarp{.width_px = kWidth, .height_px = kHeight};
  write(folder / "whole", to_json(record).dump());
}

// Writes the tiles of a run as checkpoint::FinishedTiles does.
void write_tiles(const fs::path& folder, const output::Model& model) {
  fs::create_directories(folder);
  const std::vector<checkpoint::FinishedTile> tiles{{.rows = {0, 64},
                                                     .fitted_rows = {0, 80},
                                                     .residual = 1.0,
                                                     .seconds_fitting = 2.0,
                                                     .seconds_compressing = 1.0,
                                                     .report = {.parameters = 10,
                                                                .bytes = 100,
                                                                .mean_square_change = 0.1,
                                                                .variance = 1.0,
                                                                .decibels = 0.1,
                                                                .volume = 9.0}}};
  const auto numbers_of = [](const std::string& text) {
    return std::vector<std::int64_t>(text.begin(), text.end());
  };
  const output::TrainingState state{
      .floats = {},
      .doubles = {},
      .integers = {{"fingerprint", numbers_of("the fingerprint")},
                   {"budget", numbers_of("0.1dB")},
                   {"tiles", numbers_of(checkpoint::to_json(tiles).dump())}}};
  output::save_coded(folder / "tiles", *model.coded, model, &state);
}

void write_models(const fs::path& folder) {
  fs::create_directories(folder / "model");
  fs::create_directories(folder / "checkpoint");
  for (const FieldKind kind : {FieldKind::kVm, FieldKind::kGrid})
    output::save_model(folder / "model" / (kind == FieldKind::kVm ? "vm" : "grid"),
                       testing::uneven_model(kind));
  output::Model small = testing::uneven_model(FieldKind::kGrid);
  compact::CompactField made = compact::compress(*small.field, small.roi, {});
  small.field = std::move(made.field);
  small.coded = std::move(made.coded);
  output::save_model(folder / "model" / "compact", small);
  write_tiles(folder / "tiles", small);
  const testing::SmallFit series;
  for (const int steps : {1, 7, 12}) {
    const auto fit = series.make();
    fit->run([&](const fit::Fit& f) { return f.progress().step != steps; });
    const fs::path path = folder / "checkpoint" / std::to_string(steps);
    checkpoint::save_checkpoint(path, *fit, series.info(),
                                {.fingerprint = testing::SmallFit::kFingerprint, .tuned = {}});
    fs::copy_file(path, folder / "model" / ("checkpoint" + std::to_string(steps)),
                  fs::copy_options::overwrite_existing);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: write_seeds FOLDER\n");
    return 2;
  }
  base::set_thread_count(1);
  const fs::path folder = argv[1];
  const Seed seeds[] = {
      {"angles", "tlt", kAngles},
      {"transforms", "xf", kTransforms},
      {"aretomo", "aln", kAreTomo},
      {"mdoc", "mdoc", kMdoc},
      {"star", "views", kRelionViews},
      {"star", "tomograms", kRelionTomograms},
      {"star", "tomostar", kTomostar},
      {"warp_xml", "series", kWarpXml},
      {"ctf", "ctffind", kCtffind},
      {"ctf", "imod2", kDefocus2},
      {"ctf", "imod3", kDefocus3},
      {"ctf", "relion", kRelionViews},
      {"fiducials", "text", kFiducials},
      {"config", "toml", kConfig},
      {"table", "csv", kTable},
      {"query", "request", kRequest},
      {"query", "query", "volume=0&center=1,2,3&right=1,0,0&up=0,1,0&width=4&height=3&step=1"},
      {"batch", "plan", kPlan},
      {"batch", "jobs", kJobs},
      {"star_text", "cells", kCells},
      {"command_file", "tilt", kTiltCom},
      {"command_file", "both", kTiltCom + '\1' + kNewstCom},
  };
  for (const Seed& seed : seeds) write(folder / seed.reader / seed.name, seed.text);
  write_tiffs(folder / "tiff");
  write_trials(folder / "trials", folder / "batch");
  write_alignments(folder / "alignment");
  for (const io::MrcMode mode : {io::MrcMode::kInt8, io::MrcMode::kInt16, io::MrcMode::kUint16,
                                 io::MrcMode::kFloat16, io::MrcMode::kFloat32})
    write_stack(folder / "mrc" / std::to_string(static_cast<int>(mode)), mode);
  write_series(folder / "series", contents_of(folder / "mrc" / "0"));
  write_models(folder);
  return 0;
}
