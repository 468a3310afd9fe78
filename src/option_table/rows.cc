#include "option_table/rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/plausible.h"

namespace tomofield::option_table {
namespace {

constexpr double kMaxCount = 1e9;
constexpr double kLeafStep = 16;  // rows of a slab (kernels/lanes.h): leaves have whole slabs
constexpr double kMaxLeaf = 4096;
constexpr Range kPixelSizes = Range::between(base::kPixelSizes_A.low(), base::kPixelSizes_A.high());

constexpr std::string_view kUnbinned = "unbinned pixels";
constexpr std::string_view kBinned = "binned pixels";

// Names a member of Choices once, for the reference to it and for its name in Python.
#define NAMED_MEMBER(of_struct, field_name, python_name)                \
  .member = [](Choices & c) -> auto& { return c.of_struct.field_name; } \
  , .section = #of_struct, .name = python_name
#define MEMBER(of_struct, field_name) NAMED_MEMBER(of_struct, field_name, #field_name)

// clang-format would spread a row over many lines.
// clang-format off
constexpr Row kRows[] = {
    // The series
    {.key = "input.stack", .flag = "stack", MEMBER(files, stack), .group = Group::kSeries,
     .label = "STACK",
     .help = "Tilt series: a stack, raw or aligned, or a project", .is_common = true, .is_required = true},

    // Tilt angles and alignment
    {.key = "input.tlt", .flag = "--tlt", MEMBER(files, tlt), .group = Group::kAlignment,
     .help = "Tilt angles in degrees, a line for every section (.tlt, .rawtlt)",
     .is_common = true},
    {.key = "input.xf", .flag = "--xf", MEMBER(files, xf), .group = Group::kAlignment,
     .help = "IMOD's transforms (.xf) for a raw stack; leave out for an aligned one",
     .is_common = true, .rival = "input.aln"},
    {.key = "input.xtilt", .flag = "--xtilt", MEMBER(files, xtilt),
     .group = Group::kAlignment,
     .help = "IMOD's x-axis tilts (.xtilt): a line with degrees for every section"},
    {.key = "input.local", .flag = "--local", MEMBER(files, local), .group = Group::kAlignment,
     .help = "IMOD's local alignments of an aligned stack or of --xf (LOCALFILE of tilt.com)"},
    {.key = "input.aln", .flag = "--aln", MEMBER(files, aln), .group = Group::kAlignment,
     .help = "AreTomo's alignment of the raw stack (.aln): angles, rotation, shifts",
     .is_common = true, .rival = "input.xf"},
    {.key = "input.mdoc", .flag = "--mdoc", MEMBER(files, mdoc),
     .group = Group::kAlignment,
     .help = "SerialEM's metadata (.mdoc): angles, and the pixel size if the stack has none. "
             "The angles of --tlt take precedence over those of --mdoc and --aln",
     .is_common = true},
    {.key = "input.tilt_offset_deg", .flag = "--tilt-offset", MEMBER(options.views, tilt_offset_deg),
     .group = Group::kAlignment, .unit = "degrees", .range = Range::between(-90, 90),
     .help = "Added to all tilt angles: the tilt of the specimen at the angle 0, as IMOD's OFFSET"},
    {.key = "input.x_axis_tilt_deg", .flag = "--x-axis-tilt", MEMBER(options.views, x_axis_tilt_deg),
     .group = Group::kAlignment, .unit = "degrees", .range = Range::between(-60, 60),
     .help = "Tilt of the specimen about the X axis, which the volume turns back, as IMOD's "
             "XAXISTILT: subtracted from --xtilt"},
    {.key = "input.tilt_axis_deg", .flag = "--tilt-axis", MEMBER(options.views, tilt_axis_deg),
     .group = Group::kAlignment, .unit = "degrees", .range = Range::between(-180, 180),
     .automatic = "what the .mdoc or the header of the stack states",
     .help = "Tilt axis of a raw stack, counter-clockwise from the vertical. The views are turned by "
             "it, and --align full begins with it"},
    {.key = "input.exclude", .flag = "--exclude", MEMBER(options.views, exclude),
     .group = Group::kAlignment, .label = "LIST",
     .help = "Sections to leave out, counted from 1, as in 1-3,40",
     .is_common = true},
    {.key = "input.ignore", .flag = "--ignore", MEMBER(options.views, ignore),
     .group = Group::kAlignment, .label = "NAMES",
     .help = "Entries of other programs' files that are not applied, as in LOCALFILE,LOG (tilt.com) "
             "or TiltAxisAngle (.mdoc)"},

    // Images
    {.key = "input.bin", .flag = "--bin", MEMBER(options.views, bin), .group = Group::kImages,
     .label = "FACTOR", .range = Range::at_least(1),
     .help = "Bin the views by this factor, whole or fractional", .is_common = true, .rival = "input.angpix"},
    {.key = "input.angpix", .flag = "--angpix", MEMBER(options.views, angpix),
     .group = Group::kImages, .unit = "Å", .range = kPixelSizes, .automatic = "as --bin says",
     .help = "Bin the views to this pixel size instead",
     .is_common = true, .rival = "input.bin"},
    {.key = "input.pixel_size_A", .flag = "--pixel-size", MEMBER(options.views, pixel_size_A),
     .group = Group::kImages, .unit = "Å", .range = kPixelSizes,
     .automatic = "that of the stack's header, else of --mdoc",
     .help = "Pixel size of the unbinned stack, if its header has none or a wrong one"},
    {.key = "input.contrast", .flag = "--contrast", MEMBER(options.views, contrast),
     .group = Group::kImages,
     .help = "How dense matter looks: dark, as a cryo microscope records it, or bright, as in "
             "dark-field images and line integrals",
     .is_common = true},
    {.key = "input.log", .flag = "--log", MEMBER(options.views, take_log), .group = Group::kImages,
     .help = "Take the logarithm of the transmitted intensity instead of its linear approximation "
             "(with --contrast dark)"},
    {.key = "input.log_base", .flag = "--log-base", MEMBER(options.views, log_base),
     .group = Group::kImages, .unit = "intensity", .range = Range::between(-1e6, 1e6),
     .help = "Added to all intensities before the logarithm, as IMOD's LOG (with --log)"},
    {.key = "input.black_level", .flag = "--black-level", MEMBER(options.views, black_level),
     .group = Group::kImages, .unit = "intensity", .range = Range::between(-1e6, 1e6),
     .automatic = "what trials prefer, up to the intensity of the emptiest places; 0 without trials",
     .help = "Intensity that the detector adds to every pixel of a bright series"},

    // Masks
    {.key = "input.bead_diameter_nm", .flag = "--bead-diameter",
     MEMBER(options.views, bead_diameter_nm), .group = Group::kMasks, .unit = "nm",
     .range = Range::at_least(0),
     .automatic = "estimated if there clearly are beads, which are masked with --contrast dark, and "
                  "with bright if trials prefer that",
     .help = "Diameter of the gold beads to find and mask in every view. 0: none"},
    {.key = "input.remove_fixed_pattern", .flag = "--no-fixed-pattern",
     MEMBER(options.views, remove_fixed_pattern), .group = Group::kMasks,
     .help = "The detector has no pattern of its own; the program removes nothing that stays at one "
             "place of all views"},
    {.key = "input.fiducials", .flag = "--fiducials", MEMBER(files, fiducials),
     .group = Group::kMasks,
     .help = "Positions of more beads to mask: IMOD's fiducial model of this stack as text "
             "(model2point, with or without -object or -contour)"},
    {.key = "input.mask", .flag = "--mask", MEMBER(files, mask), .group = Group::kMasks,
     .help = "MRC stack of the same size as the tilt series. Pixels that are 0 in it are left out"},

    // Contrast transfer and dose
    {.key = "input.ctf", .flag = "--ctf", MEMBER(files, ctf), .group = Group::kTransfer,
     .help = "Contrast transfer of each section, which the fit takes into account: a table of CTFFIND "
             "or AreTomo, IMOD's .defocus, a STAR file of RELION or Gctf, or Warp's XML. none: use "
             "no such file of a project",
     .is_common = true, .rival = "input.defocus_um"},
    {.key = "input.defocus_um", .flag = "--defocus", MEMBER(options.views, defocus_um),
     .group = Group::kTransfer, .unit = "µm", .range = Range::between(-1000, 1000),
     .automatic = "that of --ctf; without it views are plain projections",
     .help = "Underfocus of all views on the tilt axis, in place of --ctf",
     .is_common = true, .rival = "input.ctf"},
    {.key = "input.is_phase_flipped", .flag = "--ctf-phase-flipped",
     MEMBER(options.views, is_phase_flipped), .group = Group::kTransfer,
     .help = "The phases of the stack were flipped already: the contrast transfer is |CTF|"},
    {.key = "input.defocus_hand", .flag = "--defocus-hand", MEMBER(options.views, defocus_hand),
     .group = Group::kTransfer, .range = Range::either(1, -1),
     .automatic = "that of a RELION project or of Warp's file, else --hand",
     .help = "Side of a view at a positive tilt that is farther from focus: 1 is the right one, -1 the "
             "left one. rlnTomoHand has the opposite sign"},
    {.key = "input.mtf", .flag = "--mtf", MEMBER(files, mtf), .group = Group::kTransfer,
     .help = "How much of the signal the detector passes at each frequency (MTF): a STAR file as "
             "RELION takes it. Its pixel is that of the stack"},
    {.key = "input.voltage_kV", .flag = "--voltage", MEMBER(options.views, voltage_kV),
     .group = Group::kTransfer, .unit = "kV", .range = Range::between(1, 10000),
     .automatic = "that of --ctf, else 300", .help = "Voltage of the microscope"},
    {.key = "input.spherical_aberration_mm", .flag = "--cs",
     MEMBER(options.views, spherical_aberration_mm), .group = Group::kTransfer, .unit = "mm",
     .range = Range::between(0, 100), .automatic = "that of --ctf, else 2.7",
     .help = "Spherical aberration of the microscope"},
    {.key = "input.amplitude_contrast", .flag = "--amplitude-contrast",
     MEMBER(options.views, amplitude_contrast), .group = Group::kTransfer, .range = Range::between(0, 1),
     .automatic = "that of --ctf, else 0.07", .help = "Share of the contrast that is absorption"},
    {.key = "input.dose_per_tilt", .flag = "--dose-per-tilt", MEMBER(options.views, dose_per_tilt),
     .group = Group::kTransfer, .unit = "electrons per Å²", .range = Range::between(0, 1e4),
     .automatic = "with a contrast transfer the doses of --mdoc or of a table of views, else 0",
     .help = "Dose of each view, in the order of --mdoc or of a table of views, else in that of the "
             "stack: the fit expects less detail of late views. 0: no radiation damage"},
    {.key = "input.is_dose_weighted", .flag = "--dose-weighted", MEMBER(options.views, is_dose_weighted),
     .group = Group::kTransfer,
     .help = "The views were weighted by dose already: the fit applies no radiation damage"},

    // Specimen
    {.key = "specimen.thickness", .flag = "--thickness", MEMBER(options.specimen, thickness),
     .group = Group::kSpecimen, .unit = kUnbinned, .range = Range::between(1, 1e6),
     .help = "Thickness of the tomogram along Z", .is_common = true, .is_required = true,
     .is_of_project = true},
    {.key = "specimen.roi", .flag = "--roi", MEMBER(options.specimen, roi), .group = Group::kSpecimen,
     .label = "X0,Y0,X1,Y1", .unit = kUnbinned, .automatic = "the whole field of view",
     .help = "Region of interest at zero tilt; X1 and Y1 lie outside",
     .is_common = true},
    {.key = "specimen.hand", .flag = "--hand", MEMBER(options.specimen, hand), .group = Group::kSpecimen,
     .range = Range::either(1, -1),
     .help = "Direction of the tilt. 1: x = X cos + Z sin, as IMOD, AreTomo and RELION have it; "
             "-1: the volume is mirrored in Z"},
    {.key = "specimen.axis_x", .flag = "--center", MEMBER(options.specimen, axis_x),
     .group = Group::kSpecimen, .label = "X[,Z]", .unit = kUnbinned, .automatic = "the centre",
     .help = "Position of the tilt axis on the view, and in the volume. Pixel i covers [i, i+1)"},
    {.key = "specimen.axis_z", .flag = "--center", MEMBER(options.specimen, axis_z),
     .group = Group::kSpecimen, .label = "X[,Z]", .unit = kUnbinned, .automatic = "the centre",
     .help = "Height of the tilt axis in the volume: the second number of --center"},
    {.key = "specimen.shift_z", .flag = "--shift-z", MEMBER(options.specimen, shift_z),
     .group = Group::kSpecimen, .unit = kUnbinned, .range = Range::between(-1e6, 1e6),
     .help = "Moves the specimen up by so much in the volume (minus the Z of IMOD's SHIFT)"},
    {.key = "field.with_margin", .flag = "--no-margin", MEMBER(options.field, with_margin),
     .group = Group::kSpecimen,
     .help = "The specimen ends inside the field of view; the program models nothing outside it"},

    // Field
    {.key = "field.kind", .flag = "--field", NAMED_MEMBER(options.field, kind, "field"), .group = Group::kField,
     .automatic = "grid; vm with --tree adaptive or --vertex-epochs",
     .help = "vm: vector-matrix factors in every leaf; grid: plain vertices"},
    {.key = "field.leaf_size", .flag = "--leaf-size", MEMBER(options.field, leaf_size),
     .group = Group::kField, .unit = kBinned, .range = Range::multiple_of(kLeafStep, kMaxLeaf),
     .automatic = "32; 64 for a uniform tree of plain vertices", .help = "Side of a leaf"},
    {.key = "field.tree", .flag = "--tree", MEMBER(options.field, tree), .group = Group::kField,
     .help = "uniform: all leaves are alike; adaptive: leaves are finer where the density varies "
             "more"},
    {.key = "field.vertex_spacing", .flag = "--vertex-spacing", MEMBER(options.field, vertex_spacing),
     .group = Group::kField, .unit = kBinned, .range = Range::between(0.25, 64),
     .help = "Distance between vertices, in leaves of --leaf-size"},
    {.key = "field.rank", .flag = "--rank", MEMBER(options.field, rank), .group = Group::kField,
     .range = Range::between(1, 256), .automatic = "24; --tune tries others", .help = "Number of components of each mode (with --field vm)"},
    {.key = "field.budget", .flag = "--budget", MEMBER(options.field, budget), .group = Group::kField,
     .label = "AMOUNT",
     .help = "Replace the finished fit by a compact model: within decibels of PSNR (0.1dB), "
             "parameters (500k, 2M) or bytes (800kB, 5MB)"},
    {.key = "field.tile_rows", .flag = "--tile-rows", MEMBER(options.field, tile_rows),
     .group = Group::kField, .unit = kBinned, .range = Range::between(0, kMaxCount),
     .automatic = "all rows, or with --budget as many as there is memory for",
     .help = "Rows of the region that are fitted at a time; each such tile is made compact before the "
             "next one (with --budget). 0: all rows"},

    // Fit
    {.key = "fit.align", .flag = "--align", MEMBER(options.run, align), .group = Group::kFit,
     .help = "Align the views with the field before the fit",
     .is_common = true},
    {.key = "fit.epochs", .flag = "--epochs", MEMBER(options.fit, epochs), .group = Group::kFit,
     .range = Range::between(1, kMaxCount),
     .automatic = "10; 20 for plain vertices with a contrast transfer, dose or MTF; 30 for factors "
                  "that do not begin with vertices; half for vertices 2 or more pixels apart (4 or "
                  "more in an adaptive tree)",
     .help = "Passes over all views at full resolution"},
    {.key = "fit.denoise", .flag = "--denoise", MEMBER(options.fit, denoise), .group = Group::kFit,
     .label = "STRENGTH", .help = "Smoothness: light, medium, strong or a factor",
     .is_common = true},
    {.key = "fit.density_variation", .flag = "--tv", MEMBER(options.fit, density_variation),
     .group = Group::kFit, .unit = "noise units", .range = Range::at_least(0),
     .automatic = "14; with the smooth penalty 5, or 0.9 to 29 by trials if the penalty is left to "
                  "them too",
     .help = "Weight of the density's total variation"},
    {.key = "fit.penalty", .flag = "--tv-penalty", MEMBER(options.fit, penalty),
     .group = Group::kFit,
     .automatic = "concave if --tv is given, or if it predicts held-out views better in short trials "
                  "by three standard errors and by 1 %; else smooth",
     .help = "Kind of total variation: concave keeps edges sharp, smooth is the standard one"},
    {.key = "fit.prior", .flag = "--prior", MEMBER(options.fit, prior), .group = Group::kFit,
     .automatic = "learned unless a trial predicts held-out views worse with it; tv if --tv or "
                  "--tv-penalty is given",
     .help = "learned: end the fit with a prior that simulated tilt series taught, for plain vertices "
             "a pixel apart. tv: total variation alone. light: little of it, as the training needs"},
    {.key = "fit.noise_model", .flag = "--noise-model", MEMBER(options.fit, noise_model),
     .group = Group::kFit,
     .help = "coloured: late in the fit, weight the frequencies of each view by the inverse of the "
             "noise that its residual shows there. white: count all frequencies alike"},
    {.key = "fit.fit_view_scale", .flag = "--view-scale", MEMBER(options.fit, fit_view_scale),
     .group = Group::kFit, .automatic = "what trials prefer; without trials on for dark contrast, else off",
     .help = "Fit a scale and an offset for every view"},
    {.key = "fit.hold_out", .flag = "--hold-out", MEMBER(options.fit, hold_out),
     .group = Group::kFit, .range = Range::zero_or_between(2, kMaxCount),
     .help = "Leave every Nth view out of the fit and score it. 0: none"},
    {.key = "tune", .flag = "--tune", MEMBER(options.fit, tune), .group = Group::kFit,
     .help = "Choose penalty, weight, rank and epochs by longer trials, then fit",
     .is_common = true},
    {.key = "fit.patience", .flag = "--early-stop", MEMBER(options.fit, patience),
     .group = Group::kFit, .unit = "epochs", .range = Range::between(0, kMaxCount),
     .help = "Stop after N epochs in which the held-out error has not fallen. 0: never"},
    {.key = "fit.seed", .flag = "--seed", MEMBER(options.fit, seed), .group = Group::kFit,
     .help = "Seed of all random numbers"},

    // Volume
    {.key = "volume.mode", .flag = "--mode", MEMBER(options.volume, voxel_type),
     .group = Group::kVolume,
     .help = "MRC mode of the volume. 2: float; 12: half float; 1: scaled 16-bit integers"},
    {.key = "volume.axes", .flag = "--axes", MEMBER(options.volume, axes), .group = Group::kVolume,
     .help = "Order of the axes in the file: xyz, or xzy as IMOD's tilt writes it (same hand)"},
    {.key = "volume.invert", .flag = "--invert", MEMBER(options.volume, invert),
     .group = Group::kVolume, .help = "Write the volume with the contrast of the input inverted",
     .is_common = true},
    {.key = "running.zarr", .flag = "--zarr", MEMBER(options.volume, zarr), .group = Group::kVolume,
     .help = "Also write the volume as OME-Zarr with a 2x pyramid, in a folder NAME.zarr",
     .is_common = true},
    {.key = "running.zarr_version", .flag = "--zarr-version", MEMBER(options.volume, zarr_version),
     .group = Group::kVolume,
     .help = "Version of OME-Zarr. 0.4: Zarr v2, which all readers know; 0.5: Zarr v3, as the CryoET "
             "Data Portal and copick have it"},

    // Halves
    {.key = "input.even", .flag = "--even", MEMBER(files, even), .group = Group::kHalves,
     .help = "MRC stack of the even frames alone; STACK is the sum or the mean of all frames. With "
             "--odd, the program also fits both separately and writes how they agree",
     .is_common = true},
    {.key = "input.odd", .flag = "--odd", MEMBER(files, odd), .group = Group::kHalves,
     .help = "MRC stack of the odd frames alone",
     .is_common = true},
    {.key = "fit.split_tilts", .flag = "--split-tilts", MEMBER(options.fit, split_tilts),
     .group = Group::kHalves,
     .help = "Do the same with the even and the odd tilts of STACK, in the order of the angles"},
    {.key = "volume.denoising_halves", .flag = "--denoising-halves",
     MEMBER(options.fit, denoising_halves), .group = Group::kHalves,
     .help = "Also write both halves by weighted back-projection. These may train cryoCARE, IsoNet "
             "or DeepDeWedge; fitted halves must not"},

    // Running
    {.key = "running.output", .flag = "-o,--output", MEMBER(options.run, output),
     .group = Group::kRun,
     .help = "The tomogram; model, metrics and pictures go beside it",
     .is_common = true, .is_required = true},
    {.key = "running.overwrite", .flag = "--overwrite", MEMBER(options.run, overwrite),
     .group = Group::kRun, .help = "Replace existing results", .is_common = true},
    {.key = "running.resume", .flag = "--resume", MEMBER(options.run, resume), .group = Group::kRun,
     .help = "Continue an interrupted run from its model file", .is_common = true},
    {.key = "running.checkpoint_minutes", .flag = "--checkpoint-minutes",
     MEMBER(options.run, checkpoint_minutes), .group = Group::kRun, .unit = "minutes",
     .range = Range::at_least(0), .help = "Time between checkpoints"},
    {.key = "running.alignment_json", .flag = "--alignment-json", MEMBER(options.run, alignment_json),
     .group = Group::kRun,
     .help = "Also write the alignment as the CryoET Data Portal has it, in NAME_alignment.json"},

    // For research
    {.key = "field.leaf_budget", .flag = "--leaf-budget", MEMBER(options.field, leaf_budget),
     .group = Group::kResearch, .range = Range::between(0, kMaxCount),
     .help = "Largest number of leaves of an adaptive tree. 0: as many as at the start"},
    {.key = "field.activation", .flag = "--activation", MEMBER(options.field, activation),
     .group = Group::kResearch,
     .automatic = "identity for dark contrast, whose zero is uncertain, else softplus",
     .help = "softplus keeps densities above zero; identity lets them have either sign"},
    {.key = "fit.vertex_epochs", .flag = "--vertex-epochs", MEMBER(options.fit, vertex_epochs),
     .group = Group::kResearch, .range = Range::between(0, kMaxCount),
     .automatic = "as many as --epochs, at most 10, where vertices take no more memory than "
                  "factors, else 0",
     .help = "Passes at full resolution with plain vertices, before those of --epochs; the vertices "
             "are then factorised. 0: fit factors from the start"},
    {.key = "fit.coarse_epochs", .flag = "--coarse-epochs", MEMBER(options.fit, coarse_epochs),
     .group = Group::kResearch, .range = Range::between(0, kMaxCount),
     .automatic = "160; fewer in proportion where --epochs is below its own default",
     .help = "Passes over binned views, before all passes at full resolution. 0: none"},
    {.key = "fit.coarse_bin", .flag = "--coarse-bin", MEMBER(options.fit, coarse_bin),
     .group = Group::kResearch, .unit = "pixels on each axis", .range = Range::between(2, 64),
     .help = "Largest binning of the coarse passes: a power of two that divides a sixteenth of a "
             "leaf's side. Passes with half of it follow, down to 2"},
    {.key = "fit.subsets", .flag = "--subsets", MEMBER(options.fit, subsets), .group = Group::kResearch,
     .range = Range::between(1, kMaxCount),
     .help = "Number of steps in a pass; each step uses one interleaved subset of the views"},
    {.key = "fit.engine", .flag = "--engine", MEMBER(options.fit, engine), .group = Group::kResearch,
     .help = "slab: fast, for one tilt axis; ray: any geometry of the views, which are not "
             "resampled"},
    {.key = "fit.ray_samples", .flag = "--ray-samples", MEMBER(options.fit, ray_samples),
     .group = Group::kResearch, .range = Range::between(0, 1 << 15),
     .help = "Samples along a leaf's diagonal (with --engine ray). 0: one for each pixel"},
    {.key = "fit.learning_rate", .flag = "--learning-rate", MEMBER(options.fit, learning_rate),
     .group = Group::kResearch, .range = Range::above(0), .automatic = "0.05; 0.035 for --field grid",
     .help = "Learning rate of the first step; it decays exponentially. Vertices that are "
             "factorised later take 0.7 of it, the factors made of them 0.3"},
    {.key = "fit.factor_variation", .flag = "--tv-factors", MEMBER(options.fit, factor_variation),
     .group = Group::kResearch, .unit = "noise units", .range = Range::at_least(0),
     .help = "Weight of the factors' total variation"},
    {.key = "fit.boundary", .flag = "--bcc", MEMBER(options.fit, boundary), .group = Group::kResearch,
     .range = Range::at_least(0),
     .help = "Weight of the boundary consistency: neighbouring leaves agree on their faces"},
    {.key = "fit.fourier", .flag = "--ifp", MEMBER(options.fit, fourier), .group = Group::kResearch,
     .range = Range::at_least(0),
     .help = "Weight of the isotropic Fourier prior, which acts against streaks along X and Y"},
    {.key = "fit.fourier_ring", .flag = "--ifp-ring", MEMBER(options.fit, fourier_ring),
     .group = Group::kResearch,
     .help = "Compare the Fourier axes with the mean or the maximum of each ring"},
    {.key = "fit.spike_rank", .flag = "--spike-rank", MEMBER(options.fit, spike_rank),
     .group = Group::kResearch, .range = Range::between(0, 8),
     .automatic = "3, or 0 if trials with the smooth penalty clearly prefer it",
     .help = "After each epoch, plain vertices are at most as large as the one of this rank among "
             "the 26 around them, and as small: single black and white voxels go. 0: no limit"},
    {.key = "fit.fit_noise", .flag = "--no-noise-fit", MEMBER(options.fit, fit_noise),
     .group = Group::kResearch,
     .help = "Weight each view by the noise measured on it alone, and residuals of any size fully. "
             "By default views that the volume predicts worse than others count less, and a "
             "residual counts at most as one of 4 standard deviations"},
    {.key = "field.margin_spacing", .flag = "--margin-spacing", MEMBER(options.field, margin_spacing),
     .group = Group::kResearch, .unit = kBinned, .range = Range::between(1, 64),
     .help = "Distance between samples of the margin around the region of interest"},
};
// clang-format on
#undef MEMBER
#undef NAMED_MEMBER

const Row* find(std::string_view key) {
  const auto* row = std::ranges::find(kRows, key, &Row::key);
  return row == std::end(kRows) ? nullptr : row;
}

}  // namespace

bool Range::contains(double value) const {
  if (!std::isfinite(value)) return false;
  const bool is_between = value >= low && value <= high;
  switch (kind) {
    case Kind::kAny:
      return true;
    case Kind::kBetween:
      return is_between;
    case Kind::kZeroOrBetween:
      return value == 0 || is_between;
    case Kind::kAbove:
      return value > low && base::is_plausible(value);
    case Kind::kAtLeast:
      return value >= low && base::is_plausible(value);
    case Kind::kMultiple:
      return is_between && std::fmod(value, low) == 0;
    case Kind::kEither:
      return value == low || value == high;
  }
  return false;
}

std::string Range::text() const {
  switch (kind) {
    case Kind::kAny:
      return {};
    case Kind::kBetween:
      return fmt::format("from {} to {}", low, high);
    case Kind::kZeroOrBetween:
      return fmt::format("0 or from {} to {}", low, high);
    case Kind::kAbove:
      return fmt::format("above {}", low);
    case Kind::kAtLeast:
      return fmt::format("{} or more", low);
    case Kind::kMultiple:
      return fmt::format("a multiple of {} up to {}", low, high);
    case Kind::kEither:
      return fmt::format("{} or {}", low, high);
  }
  return {};
}

std::string_view title_of(Group group) {
  switch (group) {
    case Group::kSeries:
      return "Tilt series";
    case Group::kAlignment:
      return "Tilt angles and alignment";
    case Group::kImages:
      return "Images";
    case Group::kMasks:
      return "Masks";
    case Group::kTransfer:
      return "Contrast transfer and dose";
    case Group::kSpecimen:
      return "Specimen";
    case Group::kField:
      return "Field";
    case Group::kFit:
      return "Fit";
    case Group::kVolume:
      return "Volume";
    case Group::kHalves:
      return "Halves";
    case Group::kRun:
      return "Running";
    case Group::kResearch:
      return "For research";
  }
  return {};
}

std::span<const Row> all_rows() { return kRows; }

const Row& row_of(std::string_view key) {
  const Row* row = find(key);
  TOMOFIELD_CHECK(row != nullptr, std::string(key));
  return *row;
}

std::span<const Row> rows_of_flag(std::string_view flag) {
  const auto* first = std::ranges::find(kRows, flag, &Row::flag);
  const auto* end =
      std::find_if(first, std::end(kRows), [&](const Row& r) { return r.flag != flag; });
  return {first, end};
}

std::string_view flag_of(std::string_view key) {
  const Row* row = find(key);
  if (row == nullptr) return {};
  const std::size_t long_name = row->flag.find("--");
  return long_name == std::string_view::npos ? row->flag : row->flag.substr(long_name);
}

}  // namespace tomofield::option_table
