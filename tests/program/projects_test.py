"""Tests reconstruct on what other programs write: folders of eTomo, AreTomo's .aln, SerialEM's .mdoc,
single images and TIFF stacks. A project gives the same bits as its settings given by hand."""

import json
import os
import pathlib
import re
import shlex
import shutil

import mrcfile
import numpy as np
import pytest
import scipy.ndimage
import tifffile

import harness
import star_projects
from harness import HEIGHT, PIXEL_SIZE, QUICK, THICKNESS, TILTS, WIDTH, fresh_directory, merge

PAGE = pathlib.Path(__file__).resolve().parents[2] / "docs/projects.md"
NUM_VIEWS = len(TILTS)
SHIFTS = [f"1 0 0 1 {0.5 * (i % 3):.2f} -1.5" for i in range(NUM_VIEWS)]
# All that a project of these tests does not say.
REST = merge(QUICK, ["--thickness", 0])[:-2]


def write(folder, name, *lines):
    """Writes a text file and returns its path."""
    path = os.path.join(folder, name)
    with open(path, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")
    return path


@pytest.fixture(scope="module")
def series():
    return harness.Series("series")


def write_command_files(folder, name, extension, entries, newst):
    """Writes tilt.com and newst.com as eTomo lays them out, with more entries."""
    write(folder, "newst.com", "$setenv IMOD_OUTPUT_FORMAT MRC", "$newstack -StandardInput",
          "AntialiasFilter\t-1", f"InputFile\t{name}.{extension}", f"OutputFile\t{name}_ali.mrc",
          f"TransformFile\t{name}.xf", "TaperAtFill\t1,1", "AdjustOrigin",
          "OffsetsInXandY\t0.0,0.0", "#DistortionField\t.idf", "ImagesAreBinned\t1.0",
          f"#GradientFile\t{name}.maggrad", *newst, "$if (-e ./savework) ./savework")
    write(folder, "tilt.com", "$setenv IMOD_OUTPUT_FORMAT MRC", "$tilt -StandardInput",
          f"InputProjections {name}_ali.mrc", f"OutputFile {name}_full_rec.mrc",
          f"TILTFILE {name}.tlt", "RADIAL 0.35 0.035", "FalloffIsTrueSigma 1", "SCALE 0.0 330.0",
          "PERPENDICULAR", "MODE 1", "AdjustOrigin", "ActionIfGPUFails 1,2", *entries,
          "$if (-e ./savework) ./savework")


def write_etomo(folder, series, *entries, newst=()):
    """Makes a folder in the layout of eTomo, with more entries in its command files."""
    os.makedirs(folder, exist_ok=True)
    shutil.copy(series.stack, os.path.join(folder, "TS_01.st"))
    np.savetxt(os.path.join(folder, "TS_01.tlt"), TILTS, fmt="%.2f")
    write(folder, "TS_01.xf", *SHIFTS)
    write(folder, "TS_01.xtilt", *["0.0"] * NUM_VIEWS)
    write_command_files(folder, "TS_01", "st", entries, newst)
    return folder


def reconstruct(name, *words, run=harness.succeed):
    """Runs reconstruct and returns its results and what it printed."""
    output = os.path.join(fresh_directory(name), "out.mrc")
    printed = run("reconstruct", *words, "-o", output)
    return harness.Results(output), printed


def origins(results):
    with open(results.json_path, encoding="utf-8") as file:
        return json.load(file)["origins"]


def refuse(words, *arguments):
    """Checks that reconstruct refuses its arguments with one sentence and writes nothing."""
    folder = fresh_directory("refused")
    result = harness.tomofield("reconstruct", *arguments, "-o", os.path.join(folder, "out.mrc"))
    assert result.returncode == 2, result
    sentence = result.stderr.splitlines()[-1]
    assert sentence.startswith("tomofield: ") and len(sentence) < 700, result.stderr
    for word in words:
        assert word in sentence, (word, sentence)
    assert os.listdir(folder) == []


# ------------------------------------------------------------------------------------- eTomo

def test_an_etomo_folder_is_its_settings_given_by_hand(series):
    folder = write_etomo(fresh_directory("etomo"), series, "IMAGEBINNED 2", "THICKNESS 24",
                         "XAXISTILT 0.0", "XTILTFILE TS_01.xtilt", "FULLIMAGE 48 36",
                         "SUBSETSTART 4 0", "OFFSET -1.5", "SHIFT 0.0 2.0", "EXCLUDELIST2 1,20-21",
                         newst=["BinByFactor\t2", "SizeToOutputInXandY\t20,18"])
    imported, printed = reconstruct("imported", folder, *REST)

    def path(name):
        return os.path.join(folder, name)

    by_hand, _ = reconstruct("by_hand", path("TS_01.st"), *REST, "--xf", path("TS_01.xf"), "--tlt",
                             path("TS_01.tlt"), "--xtilt", path("TS_01.xtilt"), "--bin", 2,
                             "--thickness", 24, "--tilt-offset=-1.5", "--shift-z=-2", "--exclude",
                             "1,20-21", "--roi", "4,0,44,36")
    assert imported.same_as(by_hand)
    assert imported.volume.shape == (12, 18, 20)
    lines = printed.stdout.splitlines()
    assert f"--thickness 24 from {path('tilt.com')}: THICKNESS" in lines
    assert f"stack {path('TS_01.st')} from {path('newst.com')}: InputFile" in lines
    # The verdict judges the short fit of a tiny series; nothing before it is a warning.
    assert printed.stderr.split("verdict:")[0].count("warning") == 0, printed.stderr
    assert {"option": "--thickness", "value": "24", "file": path("tilt.com"),
            "entry": "THICKNESS"} in origins(imported)
    assert origins(by_hand) == []
    # The command file alone, and the folder from within.
    for words, where in (([path("tilt.com")], None), (["."], folder)):
        result = harness.succeed("reconstruct", *words, *REST, "--dry-run", "-o", "never.mrc",
                                 cwd=where)
        assert "tomogram 20 × 18 × 12 voxels" in result.stdout


def test_options_and_configuration_files_win(series):
    folder = write_etomo(fresh_directory("winners"), series, "THICKNESS 24", "OFFSET 5", "LOG 0")
    config = write(folder, "mine.toml", "thickness = 16", "ignore = \"LOG\"")
    results, printed = reconstruct("configured", folder, *REST, "--config", config, "--tilt-offset",
                                   0.25)
    assert results.volume.shape[0] == 16
    assert re.search(r"--thickness 24 from .*THICKNESS \(not used: --thickness 16 is given",
                     printed.stdout)
    with open(results.json_path, encoding="utf-8") as file:
        options = json.load(file)["options"]["input"]
    assert options["tilt_offset_deg"] == 0.25 and options["log"] is False
    instead = {origin["option"]: origin.get("instead") for origin in origins(results)}
    assert instead == {"stack": None, "--xf": None, "--tlt": None, "--thickness": "--thickness 16",
                       "--tilt-offset": "--tilt-offset 0.25"}
    report = results.volume_path.replace(".mrc", "_report.html")
    with open(report, encoding="utf-8") as file:
        assert f"given, in place of 24 ({os.path.join(folder, 'tilt.com')}: THICKNESS)" in file.read()
    # --angpix takes the place of --bin.
    write_etomo(folder, series, "THICKNESS 24", "IMAGEBINNED 2", newst=["BinByFactor 2"])
    planned = harness.succeed("reconstruct", folder, *REST, "--angpix", PIXEL_SIZE, "--dry-run", "-o",
                              "never.mrc").stdout
    assert "--bin 2" in planned and f"(not used: --angpix {PIXEL_SIZE} is given)" in planned
    assert f"tomogram {WIDTH} × {HEIGHT} × 24 voxels" in planned


def test_a_baseline_and_info_take_the_folder_too(series):
    folder = write_etomo(fresh_directory("others"), series, "THICKNESS 24", "IMAGEBINNED 1")
    output = os.path.join(fresh_directory("wbp"), "out.mrc")
    harness.succeed("baseline", "wbp", folder, "--contrast", "bright", "-o", output)
    assert {"option": "--thickness", "value": "24", "file": os.path.join(folder, "tilt.com"),
            "entry": "THICKNESS"} in origins(harness.Results(output))
    info = harness.succeed("info", folder, "--contrast", "bright").stdout
    assert "--thickness 24 from" in info and "as a tilt series 21 views" in info


def test_what_cannot_be_honoured_is_refused_or_said(series):
    folder = write_etomo(fresh_directory("refusals"), series, "THICKNESS 24",
                         "ZFACTORFILE TS_01.zfac", "WOBBLE 3")
    np.savetxt(os.path.join(folder, "TS_01.zfac"), np.full((NUM_VIEWS, 2), [0.02, -0.05]))
    # 0.05 times half of the thickness
    refuse(["tilt.com", "line 14", "ZFACTORFILE", "by up to 0.6 pixels", "--ignore ZFACTORFILE"],
           folder, *REST)
    _, printed = reconstruct("ignoring", folder, *REST, "--ignore", "ZFACTORFILE")
    assert "warning: " in printed.stderr and "WOBBLE" in printed.stderr
    refuse(["--ignore LOKALFILE"], folder, *REST, "--ignore", "ZFACTORFILE,LOKALFILE")
    for axis in "ab":
        shutil.copy(os.path.join(folder, "tilt.com"), os.path.join(folder, f"tilt{axis}.com"))
    os.remove(os.path.join(folder, "tilt.com"))
    refuse(["2 projects", "tilta.com, tiltb.com"], folder, *REST)
    empty = fresh_directory("empty")
    refuse([empty, "no project"], empty, *REST)
    for name in ("TS_01.xf", "TS_01.tlt"):
        refuse([name, "not a stack"], os.path.join(folder, name), "--thickness", 24, *REST)


def imod_projection(x, y, row, tilt, alpha, shape, axis_offset, shift_z):
    """Returns where IMOD's tilt takes the value of voxel (x, row, y) of its .rec from in a view, all
    zero-based. It is the formula of its source, whose positions count from 1."""
    width, height, thickness = shape
    slice_position = (y + 1) - (height / 2 + 0.5)
    z = (row + 1) - (thickness / 2 + 0.5 + shift_z)
    sin_beta, cos_beta = -np.sin(np.radians(tilt)), np.cos(np.radians(tilt))
    sin_alpha, cos_alpha = -np.sin(np.radians(alpha)), np.cos(np.radians(alpha))
    centre = width / 2 + 0.5 + axis_offset
    u = (((x + 1) - centre) * cos_beta + slice_position * sin_alpha * sin_beta
         + z * cos_alpha * sin_beta + centre)
    v = slice_position * cos_alpha - z * sin_alpha + height / 2 + 0.5
    return u - 1, v - 1


def test_the_volume_lies_over_that_of_imod():
    """Beads that IMOD would reconstruct at some voxels of its .rec are found at the same voxels, after
    the rotation of trimvol -rx, with every entry that moves them."""
    width, height, thickness = 64, 48, 32
    offset, axis_offset, x_axis_tilt, shift_z = 4.0, 3.0, 6.0, 5.0
    beads = [(20, 12, 14), (44, 33, 18), (30, 24, 22)]  # x, y and row of the .rec
    v, u = np.mgrid[:height, :width]
    views = np.zeros((NUM_VIEWS, height, width), np.float32)
    for view, tilt in zip(views, TILTS):
        for x, y, row in beads:
            at = imod_projection(x, y, row, tilt + offset, 0.5 - x_axis_tilt,
                                 (width, height, thickness), axis_offset, shift_z)
            view += 100 * np.exp(-((u - at[0]) ** 2 + (v - at[1]) ** 2) / (2 * 1.5 ** 2))
    views += np.random.default_rng(1).normal(0, 1, views.shape)
    folder = fresh_directory("imod")
    harness.write_stack(os.path.join(folder, "TS_ali.mrc"), views)
    np.savetxt(os.path.join(folder, "TS.tlt"), TILTS, fmt="%.2f")
    write(folder, "TS.xtilt", *["0.5"] * NUM_VIEWS)
    write(folder, "tilt.com", "$tilt -StandardInput", "InputProjections TS_ali.mrc",
          "TILTFILE TS.tlt", "XTILTFILE TS.xtilt", f"THICKNESS {thickness}",
          f"OFFSET {offset} {axis_offset}", f"XAXISTILT {x_axis_tilt}", f"SHIFT 0 {shift_z}")
    results, _ = reconstruct("over_imod", folder, "--contrast", "bright", "--bead-diameter", 0,
                             "--tv-penalty", "smooth", "--view-scale", "off", "--epochs", 10,
                             "--exclude", f"1,{NUM_VIEWS}", "--no-fixed-pattern")
    volume = results.volume
    assert volume.shape == (thickness, height, width)
    for x, y, row in beads:
        z = thickness - 1 - row
        around = volume[z - 4 : z + 5, y - 4 : y + 5, x - 4 : x + 5].clip(volume.max() / 5)
        weight = around - around.min()
        found = [np.average(np.arange(9) - 4, weights=weight.sum(tuple({0, 1, 2} - {axis})))
                 for axis in range(3)]
        assert np.abs(found).max() < 0.35, (x, y, row, found)


def rotated_views(transforms, aligned_at, raw_shape):
    """Returns raw intensities whose beads lie at `aligned_at` [view, bead, (u, v)], from the middle
    of the views, after the transforms [view, (A11, A12, A21, A22, DX, DY)]."""
    height, width = raw_shape
    y, x = np.mgrid[:height, :width] + 0.5
    random = np.random.default_rng(1)
    views = []
    for transform, beads in zip(transforms, aligned_at):
        at = (beads - transform[4:]) @ np.linalg.inv(transform[:4].reshape(2, 2)).T
        density = sum(0.6 * np.exp(-((x - width / 2 - u) ** 2 + (y - height / 2 - v) ** 2)
                                   / (2 * 5.0 ** 2)) for u, v in at)
        views.append(800 * np.exp(-density) + random.normal(0, 5, x.shape))
    return np.array(views, np.float32)


def write_public_series(folder, beads):
    """Makes the folder of a public series of eTomo (tests/data/convert/imod_1 in the repository
    uermel/cryoet-alignment) at a sixteenth of its lengths. Its entries, angles and rotations are those
    of the public files, whose images are not public. Beads lie at voxels [bead, (x, y, row)] of the
    .rec, in unbinned pixels. Returns the size of the aligned stack and the thickness."""
    name, shape = os.path.join(folder, "mka2018-10-01-1"), (232, 240, 125)
    tilts = -52.24 + 2 * np.arange(59)
    part = np.linspace(0, 1, 59)[:, None]
    matrix = (1 - part) * [-0.1813379, -0.9834202] + part * [-0.1653824, -0.9862289]
    matrix /= np.linalg.norm(matrix, axis=1, keepdims=True)
    transforms = np.hstack([matrix, matrix[:, ::-1] * [-1, 1],
                            ((1 - part) * [-58.17, 69.816] + part * [213.511, -120.539]) / 16])
    at = np.array([[imod_projection(*bead, tilt, 0.41, shape, 0, 0) for bead in beads]
                   for tilt in tilts])
    views = rotated_views(transforms, at + 0.5 - np.array(shape[:2]) / 2, (230, 240))
    harness.write_stack(name + ".mrc", views)
    np.savetxt(name + ".tlt", tilts, fmt="%.2f")
    np.savetxt(name + ".xf", transforms, fmt="%.7f")
    np.savetxt(name + ".xtilt", np.full(59, 0.41), fmt="%.2f")
    write_command_files(folder, os.path.basename(name), "mrc",
                        ["IMAGEBINNED 4", "XTILTFILE mka2018-10-01-1.xtilt", "THICKNESS 125",
                         "XAXISTILT 0.0", "LOG 0.0", "FULLIMAGE 230 240", "SUBSETSTART -1 0",
                         "OFFSET 0.0", "SHIFT 0.0 0.0"],
                        ["SizeToOutputInXandY\t58,60", "BinByFactor\t4"])
    return shape


def test_a_public_series_of_etomo_is_reconstructed():
    """Its tilt axis lies almost along x, so that width and height of the views change places, its
    intensities have their logarithm taken, and its aligned stack is a little wider than its views."""
    folder = fresh_directory("public")
    beads = [(70, 60, 40), (150, 175, 70), (110, 120, 90)]
    width, height, thickness = write_public_series(folder, beads)
    results, printed = reconstruct("of_public", folder, "--bead-diameter", 0, "--tv-penalty",
                                   "smooth", "--epochs", 10, "--no-fixed-pattern")
    for setting in ("--bin 4", "--thickness 125", "--log true", "--xtilt", "--xf", "--tlt"):
        assert setting in printed.stdout, printed.stdout
    for setting in ("--roi", "--center", "--shift-z", "--tilt-offset", "--x-axis-tilt"):
        assert setting not in printed.stdout, printed.stdout
    volume = -results.volume  # specimens are dark, as in the views
    assert volume.shape == (31, 60, 57)  # whole voxels of a volume of 125 × 240 × 230 pixels
    for x, y, row in beads:
        expected = np.array([thickness / 2 - row - 0.5, y + 0.5 - height / 2, x + 0.5 - width / 2]) / 4
        near = np.round(expected + np.array(volume.shape) / 2 - 0.5).astype(int)
        around = volume[tuple(slice(n - 4, n + 5) for n in near)]
        weight = (around - np.median(volume)).clip(0.3 * (around.max() - np.median(volume)))
        weight -= weight.min()
        found = np.array([np.average(np.arange(-4, 5), weights=weight.sum(tuple({0, 1, 2} - {axis})))
                          for axis in range(3)]) + near + 0.5 - np.array(volume.shape) / 2
        assert np.abs(found - expected).max() < 0.35, (expected, found)
    # The data are said to be bright: they have no logarithm.
    again = harness.succeed("info", folder, "--contrast", "bright").stdout
    assert "(not used: --contrast bright is given)" in again


def test_the_raw_stack_is_read_though_the_aligned_one_is_there():
    """Moves views by fractions of a pixel as newstack -linear does, which leaves coloured noise in the
    aligned stack. The noise of the raw one, which the program moves itself, stays white."""
    folder = fresh_directory("raw_and_aligned")
    harness.succeed("simulate", folder, "--size", 64, "--thickness", 38, "--yardstick", "c", "--contrast",
                    "dark", "--noise", 0.3, "--seed", 32, "--gold", 0, "--misalign", 2, "--overwrite")
    for before, after in (("mrc", "st"), ("tlt", "tlt"), ("xf", "xf")):
        os.rename(os.path.join(folder, f"tilt_series.{before}"), os.path.join(folder, f"TS_01.{after}"))
    shifts = np.loadtxt(os.path.join(folder, "TS_01.xf"))[:, :3:-1]  # y, x
    raw = harness.read_volume(os.path.join(folder, "TS_01.st"))
    aligned = [scipy.ndimage.shift(view, shift, order=1, mode="nearest")
               for view, shift in zip(raw, shifts)]
    harness.write_stack(os.path.join(folder, "TS_01_ali.mrc"), np.float32(aligned))
    write_command_files(folder, "TS_01", "st", ["THICKNESS 38"], [])
    options = ["--contrast", "dark", "--bead-diameter", 0, "--tv-penalty", "smooth", "--tv", 5,
               "--view-scale", "on", "--epochs", 3, "--coarse-epochs", 40]

    def most_alike_neighbours(stack, *more):
        results, printed = reconstruct(stack, folder, *options, *more)
        assert f"stack {os.path.join(folder, stack)} from" in printed.stdout, printed.stdout
        with open(results.json_path, encoding="utf-8") as file:
            return max(json.load(file)["metrics"]["verdict"]["views"]["residual_correlation"])

    assert most_alike_neighbours("TS_01.st") < 0.06
    assert most_alike_neighbours("TS_01_ali.mrc", "--ignore", "TransformFile") > 0.15


# ----------------------------------------------------------------------------------- AreTomo

def aretomo(folder, kept, sections, dark):
    rows = [f"{section:5d} 2.5000 1.00000 {0.5 * i:9.3f} -1.000 1.00 1.00 1.00 0.00 {TILTS[i]:8.2f}"
            for i, section in zip(kept, sections)]
    return write(folder, "TS_01.aln", "# AreTomo Alignment / Priims bprmMn",
                 f"# RawSize = {WIDTH} {HEIGHT} {NUM_VIEWS}", "# NumPatches = 1", *dark,
                 "# AlphaOffset =     0.00", "# BetaOffset =     0.00", f"# Thickness = {THICKNESS}",
                 "# SEC     ROT         GMAG       TX          TY      SMEAN     SFIT    SCALE     "
                 "BASE     TILT", *rows, "# Local Alignment",
                 *(f"{i:4d}   0   -10.42     -8.00      0.00      0.00   1.0"
                   for i in range(len(rows))))


def test_an_alignment_of_aretomo_has_its_thickness_and_dark_frames(series):
    folder = fresh_directory("aretomo")
    stack = os.path.join(folder, "TS_01.mrc")
    shutil.copy(series.stack, stack)
    kept = [i for i in range(NUM_VIEWS) if i not in (0, 7)]
    aln = aretomo(folder, kept, [i + 1 for i in kept],
                  [f"# DarkFrame = {i:5d} {i + 1:4d} {TILTS[i]:8.2f}" for i in (0, 7)])
    by_hand, _ = reconstruct("aligned", stack, "--aln", aln, "--thickness", THICKNESS, *REST)
    # AreTomo3 leaves the sections of dark frames at 0.
    aretomo(folder, kept, range(1, len(kept) + 1),
            [f"# DarkFrame = {i:5d}    0 {TILTS[i]:8.2f}" for i in (0, 7)])
    imported, printed = reconstruct("of_aretomo", folder, *REST)
    assert imported.volume.shape[0] == THICKNESS
    assert harness.read_bytes(imported.volume_path) == harness.read_bytes(by_hand.volume_path)
    assert f"--thickness {THICKNESS} from {aln}: Thickness" in printed.stdout
    assert f"local alignment of '{aln}' in {len(kept)} views" in printed.stderr
    os.remove(stack)
    refuse(["TS_01.aln", "TS_01.mrc", "--aln"], aln, *REST)


# ---------------------------------------------------------------------------------- SerialEM

def write_mdoc(folder, name, axis, image_file=""):
    sections = []
    for i, tilt in enumerate(TILTS):
        sections += [f"[ZValue = {i}]", f"TiltAngle = {tilt}", "RotationAngle = 175.2",
                     f"SubFramePath = X:\\frames\\TS_01_{i:03d}.eer", ""]
    return write(folder, name, f"PixelSpacing = {PIXEL_SIZE}", f"ImageFile = {image_file}", "",
                 f"[T =     Tilt axis angle = {axis}, binning = 1  spot = 8  camera = 0]", "",
                 *sections)


def assert_same_voxels(one, other):
    """Compares volumes whose labels name different files."""
    np.testing.assert_array_equal(one.volume, other.volume)


def test_an_mdoc_brings_its_stack_its_angles_and_its_axis(series):
    folder = fresh_directory("serialem")
    stack = os.path.join(folder, "TS_01.st")
    shutil.copy(series.stack, stack)
    xf = write(folder, "TS_01.xf", *SHIFTS)
    mdoc = write_mdoc(folder, "TS_01.st.mdoc", 84.7)
    common = ["--thickness", THICKNESS, *REST]
    refuse(["TS_01.st.mdoc", "84.7", "--xf", "--ignore TiltAxisAngle"], mdoc, *common)
    refuse(["84.7"], stack, "--mdoc", mdoc, *common)
    by_hand, _ = reconstruct("mdoc_by_hand", stack, "--tlt", series.tlt, "--xf", xf, *common)
    imported, _ = reconstruct("of_mdoc", mdoc, "--xf", xf, *common)
    assert_same_voxels(imported, by_hand)
    refuse(["TS_01.st", "is one series", "--series"], stack, "--series", "TS_02", "--tlt", series.tlt,
           *common)
    aligned, _ = reconstruct("aligned_mdoc", folder, "--ignore", "TiltAxisAngle", *common)
    plain, _ = reconstruct("plain", stack, "--tlt", series.tlt, *common)
    assert_same_voxels(aligned, plain)


def test_views_in_single_files_are_a_stack(series):
    folder = fresh_directory("frames")
    averages = fresh_directory("averages")
    mdoc = write_mdoc(folder, "TS_01.mdoc", 0.4)
    for i, view in enumerate(series.views.astype(np.float32)):
        name = os.path.join(averages, f"TS_01_{i:03d}")
        if i % 2:
            tifffile.imwrite(name + ".tif", view[::-1], resolution=(1e8 / PIXEL_SIZE,) * 2,
                             resolutionunit="CENTIMETER")
        else:
            with mrcfile.new(name + "_DW.mrc") as file:
                file.set_data(view)
                file.voxel_size = PIXEL_SIZE
    common = ["--thickness", THICKNESS, *REST]
    stacked, _ = reconstruct("stacked", series.stack, "--tlt", series.tlt, *common)
    single, _ = reconstruct("single", averages, "--mdoc", mdoc, *common)
    assert_same_voxels(single, stacked)
    shutil.copy(mdoc, averages)
    beside, printed = reconstruct("beside", averages, *common)
    assert_same_voxels(beside, stacked)
    assert "SubFramePath" in printed.stdout
    os.remove(os.path.join(averages, "TS_01_003.tif"))
    refuse(["TS_01.mdoc", "ZValue = 3", "TS_01_003"], averages, *common)


# -------------------------------------------------------------------------------------- TIFF

def test_tiff_stacks_of_every_kind(series):
    folder = fresh_directory("tiff")
    counts = np.round(3 * (series.views - series.views.min())).clip(0, 127)
    whole = ["baseline", "wbp", "--thickness", THICKNESS, "--contrast", "bright", "--tlt", series.tlt,
             "--pixel-size", PIXEL_SIZE, "--overwrite"]
    output = os.path.join(folder, "out.mrc")

    def volume(stack):
        harness.succeed(*whole[:2], stack, *whole[2:], "-o", output)
        return harness.read_bytes(output)[1024:]  # labels name the files

    mrc = os.path.join(folder, "a.mrc")
    harness.write_stack(mrc, counts.astype(np.float32))
    expected = volume(mrc)
    tif = os.path.join(folder, "a.tif")
    for kind, options in (("uint8", {}), ("int8", {"compression": "zlib"}),
                          ("uint16", {"compression": "zlib"}), ("int16", {"byteorder": ">"}),
                          ("uint32", {"rowsperstrip": 7}), ("int32", {"bigtiff": True}),
                          ("float32", {"tile": (16, 32), "compression": "zlib"})):
        tifffile.imwrite(tif, counts[:, ::-1].astype(kind), photometric="minisblack", **options)
        assert volume(tif) == expected, kind
    for kind, white in (("uint8", 255), ("uint16", 65535)):
        tifffile.imwrite(tif, (white - counts[:, ::-1]).astype(kind), photometric="miniswhite")
        assert volume(tif) == expected, kind
    # Rows may begin at the bottom (Orientation 4).
    tifffile.imwrite(tif, counts.astype("uint16"), photometric="minisblack",
                     extratags=[(274, "H", 1, 4, False)])
    assert volume(tif) == expected
    info = harness.succeed("info", tif).stdout
    assert f"{WIDTH} × {HEIGHT} × {NUM_VIEWS}" in info


def test_tiff_files_that_are_no_stack(series):
    folder = fresh_directory("bad_tiff")
    tif = os.path.join(folder, "a.tif")
    common = ["--tlt", series.tlt, "--thickness", THICKNESS, *REST]
    tifffile.imwrite(tif, np.zeros((8, 8, 3), np.uint8), photometric="rgb")
    refuse(["a.tif", "3 values of 8 bits"], tif, *common)
    tifffile.imwrite(tif, np.zeros((8, 8), np.uint8), photometric="palette",
                     colormap=np.zeros((3, 256), np.uint16))
    refuse(["a.tif", "palette"], tif, *common)
    tifffile.imwrite(tif, np.zeros((8, 8), np.int16), photometric="miniswhite")
    refuse(["a.tif", "from white"], tif, *common)
    tifffile.imwrite(tif, np.zeros((8, 8), np.float64))
    refuse(["a.tif", "64 bits"], tif, *common)
    for orientation in (2, 3, 5, 6, 7, 8):
        tifffile.imwrite(tif, np.zeros((8, 8), np.uint16), extratags=[(274, "H", 1, orientation, True)])
        refuse(["a.tif", f"Orientation {orientation}"], tif, *common)
    tifffile.imwrite(tif, np.zeros((5, 32, 32), np.uint16), photometric="minisblack", contiguous=False)
    with open(tif, "r+b") as file:
        file.truncate(os.path.getsize(tif) - 1500)
    refuse(["a.tif", "truncated or damaged"], tif, *common)
    plain = dict(photometric="minisblack", resolutionunit="CENTIMETER")
    for across, down in ((1e7, 5e6), (5e6, 1e7), (1e7, 1e3)):  # pixels an inch of 10 and 20 Å
        tifffile.imwrite(tif, np.zeros((20, 16, 16), np.uint16), resolution=(across, down), **plain)
        refuse(["a.tif", "pixels of"], tif, *common)
    with tifffile.TiffWriter(tif) as file:
        for per_cm in (1e7, 2e7):
            file.write(np.zeros((16, 16), np.uint16), resolution=(per_cm, per_cm), **plain)
    refuse(["a.tif", "several kinds", "5 × 5 Å"], tif, *common)
    with tifffile.TiffWriter(tif) as writer:
        for size in (8, 9):
            writer.write(np.zeros((size, 8), np.uint8), photometric="minisblack")
    refuse(["a.tif", "page 2", "8 × 9"], tif, *common)
    tifffile.imwrite(tif, np.ones((NUM_VIEWS, HEIGHT, WIDTH), np.float32), photometric="minisblack")
    with open(tif, "r+b") as file:
        file.truncate(5000)
    refuse(["a.tif"], tif, *common)
    # The page says that it is 16 million pixels wide and high, in one strip.
    tifffile.imwrite(tif, np.zeros((8, 8), np.uint8))
    contents = bytearray(harness.read_bytes(tif))
    for tag in (256, 257, 278):
        at = re.search(tag.to_bytes(2, "little") + b"[\3\4]\0\1\0\0\0", contents).start()
        contents[at + 2] = 4
        contents[at + 8 : at + 12] = (1 << 24).to_bytes(4, "little")
    pathlib.Path(tif).write_bytes(contents)
    refuse(["a.tif", "16777216"], tif, *common)


# -------------------------------------------------------------------------------------- page

def prepare_page(folder, series):
    """Makes the projects that the commands of docs/projects.md name."""
    write_etomo(os.path.join(folder, "etomo"), series, "THICKNESS 24", "EXCLUDELIST2 3")
    write_etomo(os.path.join(folder, "local"), series, "THICKNESS 24", "LOCALFILE TS_01local.xf")
    for name in ("aretomo", "serialem", "averages"):
        os.makedirs(os.path.join(folder, name))
    shutil.copy(series.stack, os.path.join(folder, "aretomo/TS_01.mrc"))
    aretomo(os.path.join(folder, "aretomo"), range(NUM_VIEWS), range(1, NUM_VIEWS + 1), [])
    shutil.copy(series.stack, os.path.join(folder, "serialem/TS_01.mrc"))
    write_mdoc(os.path.join(folder, "serialem"), "TS_01.mrc.mdoc", 84.7)
    write_mdoc(os.path.join(folder, "serialem"), "TS_01.mdoc", 84.7)
    write(os.path.join(folder, "serialem"), "TS_01.xf", *SHIFTS)
    for i, view in enumerate(series.views.astype(np.float32)):
        with mrcfile.new(os.path.join(folder, f"averages/TS_01_{i:03d}.mrc")) as file:
            file.set_data(view)
            file.voxel_size = PIXEL_SIZE
    star_projects.write_relion(folder, series)
    star_projects.write_warp(folder, series)


def test_the_commands_of_the_page_run(series):
    """Runs each command of docs/projects.md in a folder that has what it names."""
    folder = fresh_directory("page")
    prepare_page(folder, series)
    commands = re.findall(r"^tomofield (.*)$", PAGE.read_text("utf-8"), re.MULTILINE)
    assert len(commands) >= 6
    for command in commands:
        words = shlex.split(command)
        quick = [] if words[0] == "info" else REST
        harness.succeed(*words, *quick, cwd=folder)
        if "-o" in words:
            with mrcfile.open(os.path.join(folder, words[words.index("-o") + 1])) as file:
                assert np.isfinite(file.data).all() and file.data.std() > 0
