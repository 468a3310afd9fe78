"""Tests that the local alignments of other programs are applied. Beads are projected by the other
program's formula, written down here from its source, and must be reconstructed in their places."""

import json
import os
import pathlib
import re

import numpy as np
import pytest

import harness
from harness import fresh_directory

WIDTH, HEIGHT, THICKNESS = 96, 88, 24
PIXEL_A = 10.0
TILTS = np.arange(-48, 49, 6.0)
# From the centre: x, y, z. They lie near the middle of the specimen, since local changes of the
# angles hold there.
BEADS = [(26, 20, 4), (-28, 18, -5), (14, -26, 5), (-24, -22, -2), (2, 3, 6)]
FIT = ["--contrast", "bright", "--bead-diameter", 0, "--epochs", 10, "--tv-penalty", "smooth",
       "--tv", 0.3, "--view-scale", "off", "--no-margin", "--overwrite"]


def write(folder, name, text):
    path = os.path.join(folder, name)
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    return path


def view_of(places):
    """Returns an image with beads at places from the middle of the image."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    return sum(np.exp(-((x - WIDTH / 2 - u) ** 2 + (y - HEIGHT / 2 - v) ** 2) / (2 * 1.5 ** 2))
               for u, v in places)


def write_views(folder, place):
    """Writes the stack of beads that place(bead, view) puts into each view, and its angles."""
    views = [view_of([place(bead, i) for bead in BEADS]) for i in range(len(TILTS))]
    harness.write_stack(os.path.join(folder, "TS_01.st"), np.float32(views), PIXEL_A)
    np.savetxt(os.path.join(folder, "TS_01.tlt"), TILTS, fmt="%.2f")


def distances(folder, *arguments):
    printed = harness.succeed("reconstruct", *arguments, "-o", "out.mrc", *FIT, cwd=folder)
    volume = harness.read_volume(os.path.join(folder, "out.mrc"))
    return harness.distances_of_beads(volume, BEADS), printed


# -------------------------------------------------------------------------------------------- IMOD

COLUMNS, ROWS, FIRST, STEP = 3, 3, (20, 18), (28, 26)
RANDOM = np.random.default_rng(3)
TILT_CHANGES = RANDOM.normal(0, 0.3, (ROWS, COLUMNS, len(TILTS)))
X_TILT_CHANGES = RANDOM.normal(0, 0.2, (ROWS, COLUMNS, len(TILTS)))
TURNS = RANDOM.normal(0, 0.3, (ROWS, COLUMNS, len(TILTS)))
SHIFTS = RANDOM.normal(0, 1.6, (ROWS, COLUMNS, len(TILTS), 2))


def local_xf(row, column, view, scale=1.0):
    turn = np.radians(TURNS[row, column, view])
    return np.array([[np.cos(turn), -np.sin(turn), SHIFTS[row, column, view, 0] / scale],
                     [np.sin(turn), np.cos(turn), SHIFTS[row, column, view, 1] / scale]])


def imod_place(bead, view):
    """Returns where IMOD's tilt finds a bead: localProjFactors of tilt.f90, whose positions count
    from 1 and whose z points down."""
    xcen, centre_slice = WIDTH / 2 + 0.5, HEIGHT / 2 + 0.5
    xx, yy, zz = bead[0], bead[1], -bead[2]
    ix = min(max(xx + xcen - FIRST[0], 0), (COLUMNS - 1) * STEP[0])
    iy = min(max(yy + centre_slice - FIRST[1], 0), (ROWS - 1) * STEP[1])
    column, row = min(int(ix / STEP[0]), COLUMNS - 2), min(int(iy / STEP[1]), ROWS - 2)
    fx, fy = ix / STEP[0] - column, iy / STEP[1] - row
    place = np.zeros(2)
    for r, of_row in ((row, 1 - fy), (row + 1, fy)):
        for c, of_column in ((column, 1 - fx), (column + 1, fx)):
            beta = np.radians(TILTS[view] + TILT_CHANGES[r, c, view])
            alpha = np.radians(X_TILT_CHANGES[r, c, view])
            cbeta, sbeta, calf, salf = np.cos(beta), -np.sin(beta), np.cos(alpha), -np.sin(alpha)
            xp = xx * cbeta + yy * salf * sbeta + zz * calf * sbeta + xcen
            yp = yy * calf - zz * salf + centre_slice
            xf = local_xf(r, c, view)
            moved = xf[:, :2] @ [xp - xcen, yp - centre_slice] + xf[:, 2]
            place += of_row * of_column * moved
    return place


def write_local(folder, name="TS_01local.xf", scale=1, num_views=len(TILTS)):
    """Writes LOCALFILE as tiltalign does, for images with pixels `scale` times larger."""
    first, step = (np.array(FIRST) - 0.5) / scale + 0.5, np.array(STEP) / scale
    text = (f"{COLUMNS:7d}{ROWS:7d}{first[0]:9.2f}{first[1]:9.2f}{step[0]:8.2f}{step[1]:8.2f}"
            f"{1:7d}{PIXEL_A * scale:12.5f}{0:4d}\n")
    for row in range(ROWS):
        for column in range(COLUMNS):
            for changes in (TILT_CHANGES, X_TILT_CHANGES):
                values = [f"{x:8.3f}" for x in changes[row, column, :num_views]]
                text += "\n".join("".join(values[i:i + 10]) for i in range(0, num_views, 10)) + "\n"
            for view in range(num_views):
                (a, b, dx), (c, d, dy) = local_xf(row, column, view, scale)
                text += f"{a:12.7f}{b:12.7f}{c:12.7f}{d:12.7f}{dx:12.3f}{dy:12.3f}\n"
    return write(folder, name, text)


def write_etomo(folder, *entries):
    np.savetxt(os.path.join(folder, "TS_01.xf"), [[1, 0, 0, 1, 0, 0]] * len(TILTS), fmt="%.5f")
    write(folder, "newst.com", "$newstack -StandardInput\nInputFile TS_01.st\nOutputFile TS_01.ali\n"
          "TransformFile TS_01.xf\n")
    write(folder, "tilt.com", "\n".join(
        ["$tilt -StandardInput", "InputProjections TS_01.ali", "OutputFile TS_01.rec",
         "TILTFILE TS_01.tlt", f"THICKNESS {THICKNESS}", f"FULLIMAGE {WIDTH} {HEIGHT}",
         "PERPENDICULAR", *entries, ""]))


def test_local_alignments_of_imod_are_applied():
    folder = fresh_directory("imod")
    write_views(folder, imod_place)
    write_local(folder)
    write_etomo(folder, "LOCALFILE TS_01local.xf")
    without, _ = distances(folder, "tilt.com", "--ignore", "LOCALFILE")
    found, printed = distances(folder, "tilt.com")
    assert found.max() < 0.5 and found.mean() < 0.5 * without.mean(), (found, without)
    assert "TS_01local.xf from tilt.com: LOCALFILE" in printed.stdout, printed.stdout
    assert f"in {len(TILTS)} views" in printed.stderr, printed.stderr
    assert "is it the one of this series" not in printed.stderr, printed.stderr
    # The option alone, and alignments of images with pixels twice as large.
    write_local(folder, "binned.xf", scale=2)
    found, _ = distances(folder, "TS_01.st", "--tlt", "TS_01.tlt", "--thickness", THICKNESS,
                         "--local", "binned.xf")
    assert found.max() < 0.5, found


def test_a_corrected_pixel_size_leaves_local_alignments_as_they_are():
    folder = fresh_directory("calibrated")
    write_views(folder, imod_place)
    write_local(folder)
    write_etomo(folder, "LOCALFILE TS_01local.xf")
    said = {size: harness.succeed("reconstruct", "tilt.com", "--pixel-size", size, *FIT, "-o", "out.mrc", "--overwrite",
                                  cwd=folder).stderr for size in (10, 9.3, 5)}
    lines = {re.search(r"local alignment of .*", text)[0] for text in said.values()}
    assert len(lines) == 1, lines


def test_local_alignments_of_another_series_are_refused():
    folder = fresh_directory("other")
    write_views(folder, imod_place)
    write_etomo(folder, "LOCALFILE TS_01local.xf")
    for text, parts in ((None, ["LOCALFILE", "which are not there", "--ignore LOCALFILE"]),
                        ("2 1 3 4 5 6\n", ["line 1", "at least 2 columns"]),
                        ("2 2 3 4 5 6 1 10\n1 2 x\n", ["line 2", "1 2 x"]),
                        ("2 2 3 4 5 6\n" + "0\n" * 40 + "1 0 0 1 0 0\n" * 40, ["280 numbers"])):
        if text is not None:
            write(folder, "TS_01local.xf", text)
        refused = harness.tomofield("reconstruct", "tilt.com", "-o", "out.mrc", *FIT, cwd=folder)
        assert refused.returncode == 2, (text, refused.stdout)
        for part in parts:
            assert part in refused.stderr, (part, refused.stderr)
    with open(write_local(folder), encoding="utf-8") as file:
        whole = file.read().splitlines(keepends=True)
    short = len(whole) - 4  # an odd number of numbers: one of the six of a transform is missing
    for lines, parts in ((whole[:-1], [f"line {len(whole) - 1} on", "are missing"]),
                         ([*whole[:short], whole[short][13:], *whole[short + 1:]],
                          [f"line {short + 1} on", "are missing"]),
                         (whole[:1], ["line 1 on", "has 0 numbers"]),
                         ([whole[0].replace("10.00000", "-10.0"), *whole[1:]],
                          ["line 1", "pixels of -10 Å"]),
                         ([whole[0].replace("10.00000", "0"), *whole[1:]],
                          ["line 1", "pixels of 0 Å"])):
        write(folder, "TS_01local.xf", "".join(lines))
        refused = harness.tomofield("reconstruct", "tilt.com", "-o", "out.mrc", *FIT, cwd=folder)
        assert refused.returncode == 2, (parts, refused)
        for part in ("TS_01local.xf", *parts):
            assert part in refused.stderr, (part, refused.stderr)
    write_local(folder, num_views=len(TILTS) - 1)
    refused = harness.tomofield("reconstruct", "tilt.com", "-o", "out.mrc", *FIT, cwd=folder)
    assert refused.returncode == 2
    assert "are 16 sections, and the stack has 17" in refused.stderr, refused.stderr
    write_local(folder)
    for other in (["--engine", "ray"], ["--align", "refine"]):
        warned = harness.succeed("reconstruct", "tilt.com", "-o", "out.mrc", *other, "--dry-run",
                                 *FIT, cwd=folder)
        assert "TS_01local.xf' aligns parts" in warned.stderr, warned.stderr
        assert "left out" in warned.stderr, warned.stderr


# ----------------------------------------------------------------------------------------- AreTomo

AXIS, GLOBAL_SHIFT = 4.0, np.array([2.5, -1.5])
PATCHES = [(x, y) for y in (-26, 0, 26) for x in (-28, 0, 28)]
PATCH_SHIFTS = np.random.default_rng(5).normal(0, 1.5, (len(TILTS), len(PATCHES), 2))
BAD = 4  # AreTomo calls this patch bad in all views
# The shifts of neighbouring patches are as different as can be, and AreTomo's weights fall off within
# a fifteenth of the view: the spline of the program leaves half a pixel of that beside a patch.


def aretomo_place(bead, view):
    """Returns where AreTomo takes a bead from: GCorrPatchShift.cu."""
    tilt, axis = np.radians(TILTS[view]), np.radians(AXIS)
    x, y = bead[0] * np.cos(tilt) + bead[2] * np.sin(tilt), bead[1]
    turned = np.array([x * np.cos(axis) - y * np.sin(axis), x * np.sin(axis) + y * np.cos(axis)])
    good = [p for p in range(len(PATCHES)) if p != BAD]
    apart = (turned - np.array(PATCHES)[good]) / [WIDTH, HEIGHT]
    weights = np.exp(-100 * (apart ** 2).sum(axis=1))
    return turned + weights @ PATCH_SHIFTS[view, good] / weights.sum() + GLOBAL_SHIFT


def write_aln(folder, with_patches=True):
    text = (f"# AreTomo Alignment / Priims bprmMn\n# RawSize = {WIDTH} {HEIGHT} {len(TILTS)}\n"
            f"# NumPatches = {len(PATCHES) if with_patches else 0}\n"
            "# SEC     ROT         GMAG       TX          TY      SMEAN     SFIT    SCALE     BASE     "
            "TILT\n")
    for i, tilt in enumerate(TILTS):
        text += (f"{i + 1:5d} {AXIS:9.4f} 1.00000 {GLOBAL_SHIFT[0]:9.3f} {GLOBAL_SHIFT[1]:9.3f} 1.00 "
                 f"1.00 1.00 0.00 {tilt:8.2f}\n")
    if with_patches:
        text += "# Local Alignment\n"
        for i in range(len(TILTS)):
            for p, (x, y) in enumerate(PATCHES):
                dx, dy = PATCH_SHIFTS[i, p]
                text += f"{i:4d} {p:3d} {x:8.2f}  {y:8.2f}  {dx:8.2f}  {dy:8.2f}  {float(p != BAD):4.1f}\n"
    return write(folder, "TS_01.aln", text)


def described_for_portal(folder):
    with open(os.path.join(folder, "out_alignment.json"), encoding="utf-8") as file:
        alignment = json.load(file)
    return alignment["alignment_type"], alignment["is_portal_standard"]


def test_patch_shifts_of_aretomo_are_applied():
    folder = fresh_directory("aretomo")
    write_views(folder, aretomo_place)
    arguments = ["TS_01.st", "--aln", "TS_01.aln", "--thickness", THICKNESS, "--alignment-json"]
    write_aln(folder, with_patches=False)
    without, printed = distances(folder, *arguments)
    assert described_for_portal(folder) == ("GLOBAL", True) and "local" not in printed.stderr
    write_aln(folder)
    found, printed = distances(folder, *arguments)
    assert described_for_portal(folder) == ("LOCAL", False)
    assert "out_alignment.json' has no place for local alignments" in printed.stderr, printed.stderr
    assert found.max() < 0.6 and found.mean() < 0.5 * without.mean(), (found, without)
    assert f"local alignment of 'TS_01.aln' in {len(TILTS)} views" in printed.stderr, printed.stderr


def test_patch_shifts_that_no_specimen_has_are_named():
    folder = fresh_directory("impossible")
    write_views(folder, imod_place)
    path = write_aln(folder, with_patches=False)
    text = pathlib.Path(path).read_text(encoding="utf-8")
    with open(path, "w", encoding="utf-8") as file:
        file.write(text.replace("NumPatches = 0", f"NumPatches = {len(PATCHES)}"))
        file.write("# Local Alignment\n" + "".join(
            f"{view} {p} {x} {y} {60 if x > 0 and view == 0 else 0} 0 1.0\n"
            for view in range(len(TILTS)) for p, (x, y) in enumerate(PATCHES)))
    warned = harness.succeed("reconstruct", "TS_01.st", "--aln", "TS_01.aln", "--thickness",
                             THICKNESS, "-o", "out.mrc", *FIT, cwd=folder)
    assert "'TS_01.aln' moves parts of the views by up to 60 px, 600 Å" in warned.stderr, warned.stderr
    assert "is it the one of this series?" in warned.stderr, warned.stderr


@pytest.mark.parametrize("row", ("0 0 1 2 3", "99 0 1 2 0.1 0.2 1.0", "0 0 1 2 x 0.2 1.0"))
def test_rows_of_patches_that_make_no_sense_are_refused(row):
    folder = fresh_directory("malformed")
    write_views(folder, aretomo_place)
    path = write_aln(folder, with_patches=False)
    with open(path, "a", encoding="utf-8") as file:
        file.write("# Local Alignment\n" + row + "\n")
    refused = harness.tomofield("reconstruct", "TS_01.st", "--aln", "TS_01.aln", "--thickness",
                                THICKNESS, "-o", "out.mrc", *FIT, cwd=folder)
    assert refused.returncode == 2 and row in refused.stderr, refused.stderr
    assert "AreTomo's local alignment" in refused.stderr, refused.stderr


def test_rows_of_patches_that_are_missing_are_named():
    folder = fresh_directory("torn")
    write_views(folder, aretomo_place)
    with open(write_aln(folder), encoding="utf-8") as file:
        lines = file.read().splitlines(keepends=True)
    for kept, view in ((lines[:-1], len(TILTS) - 1), (lines[:-2 * len(PATCHES)], len(TILTS) - 2)):
        write(folder, "TS_01.aln", "".join(kept))
        refused = harness.tomofield("reconstruct", "TS_01.st", "--aln", "TS_01.aln", "--thickness",
                                    THICKNESS, "-o", "out.mrc", *FIT, cwd=folder)
        assert refused.returncode == 2, refused
        for part in ("TS_01.aln", f"line {len(kept)}", f"of view {view}",
                     f"NumPatches = {len(PATCHES)}"):
            assert part in refused.stderr, (part, refused.stderr)
