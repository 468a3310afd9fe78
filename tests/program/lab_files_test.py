"""Tests that what a lab's own files state is read, and that what they do not say is asked for: the
tilt axis, eTomo's defaults, the microscope, tables that have not one row a section, and names. The
beads of these series lie at known places by the formulas of the other programs."""

import json
import os
import re
import shutil

import mrcfile
import numpy as np
import pytest
import tifffile

import harness
from harness import fresh_directory

TILTS = np.arange(-42, 43, 6.0)
BEADS = [(12, 6, 5), (-14, 8, -6), (3, -15, 6), (-7, -10, -3)]  # from the centre: x, y, z
PIXEL_A = 10.0


def write(folder, name, text, encoding="utf-8"):
    path = os.path.join(folder, name)
    with open(path, "w", encoding=encoding, newline="") as file:
        file.write(text)
    return path


def bead_views(axis, shape, tilts=TILTS, shift=(0.0, 0.0), beads=BEADS):
    """Returns raw views [tilt, y, x] of beads: IMOD projects a bead to (X cos + Z sin, Y), and its
    transforms turn that by the axis, counter-clockwise from +Y, about the middle of the view."""
    height, width = shape
    y, x = np.mgrid[:height, :width] + 0.5
    cosine, sine = np.cos(np.radians(axis)), np.sin(np.radians(axis))
    views = np.zeros((len(tilts), height, width), np.float32)
    for view, tilt in zip(views, np.radians(tilts)):
        for bead in beads:
            u, v = bead[0] * np.cos(tilt) + bead[2] * np.sin(tilt), bead[1]
            at_x = width / 2 + cosine * u - sine * v + shift[0]
            at_y = height / 2 + sine * u + cosine * v + shift[1]
            view += 100 * np.exp(-((x - at_x) ** 2 + (y - at_y) ** 2) / (2 * 1.5 ** 2))
    return views + np.random.default_rng(1).normal(0, 1, views.shape).astype(np.float32)


def write_series(name, axis=0.0, shape=(56, 72), tilts=TILTS, stack="TS_01.mrc", **keywords):
    """Writes a raw stack and its angles, and returns its folder."""
    folder = fresh_directory(name)
    harness.write_stack(os.path.join(folder, stack), bead_views(axis, shape, tilts, **keywords),
                        PIXEL_A)
    np.savetxt(os.path.join(folder, "TS_01.rawtlt"), tilts, fmt="%.2f")
    return folder


def mdoc_text(tilts=TILTS, head="", entries=lambda i: ""):
    text = head + "\n"
    for i, tilt in enumerate(tilts):
        text += f"\n[ZValue = {i}]\nTiltAngle = {tilt:.2f}\n{entries(i)}"
    return text


def transforms(axis, count=len(TILTS), shift=(0, 0)):
    cosine, sine = np.cos(np.radians(axis)), np.sin(np.radians(axis))
    return f"{cosine:.7f} {sine:.7f} {-sine:.7f} {cosine:.7f} {shift[0]} {shift[1]}\n" * count


def dry(folder, *arguments, status=0):
    result = harness.tomofield("reconstruct", *arguments, "--thickness", 24, "--contrast", "bright",
                               "--dry-run", cwd=folder)
    assert result.returncode == status, (arguments, result.stderr)
    return result.stdout + result.stderr


def expect(text, *parts):
    for part in parts:
        assert part in text, (part, text)


def back_projection(folder, *arguments):
    """Returns a back-projection of the series in a folder."""
    output = os.path.join(folder, "wbp.mrc")
    harness.succeed("baseline", "wbp", *arguments, "--contrast", "bright", "--bead-diameter", 0,
                    "--overwrite", "-o", output, cwd=folder)
    return harness.read_volume(output)


def distances(volume):
    return harness.distances_of_beads(volume, BEADS)


# ------------------------------------------------------------------------------------ tilt axis

AXES = {
    "serialem.mdoc": ("[T =     Tilt axis angle = 85.3, binning = 1  spot = 8  camera = 2]", ""),
    "tomography.mdoc": ("[T =   TiltAxisAngle = -175.30  Binning = 1  SpotSize = 6]",
                        "RotationAngle = 85.30\n"),
    "tomography_other.mdoc": ("[T =   TiltAxisAngle = 85.30  Binning = 1  SpotSize = 6]",
                              "RotationAngle = 175.30\n"),
    "entry.mdoc": ("TiltAxisAngle = 85.3", ""),
    "windows.mdoc": ("\ufeffPixelSpacing = 10\r\n[T = Tilt axis angle = 85.3, binning = 1]\r", ""),
}


@pytest.mark.parametrize("name", AXES)
def test_the_axis_of_an_mdoc_is_used(name):
    folder = write_series("axis", 85.3)
    title, entry = AXES[name]
    write(folder, "TS_01.mdoc", mdoc_text(head=title, entries=lambda i: entry))
    expect(dry(folder, "TS_01.mdoc", status=2), "85.3°", "TS_01.mrc", "--align full")
    expect(dry(folder, "TS_01.mdoc", "--align", "full"), "tilt axis of the views: 85.3° from")
    expect(dry(folder, "TS_01.mrc", "--mdoc", "TS_01.mdoc", status=2), "85.3°")
    dry(folder, "TS_01.mdoc", "--ignore", "TiltAxisAngle")


def write_titles(path, titles, extended=b"", shorts=(0, 0), kind=b"\0\0\0\0"):
    """Replaces the titles of an MRC file, and gives it an extended header."""
    content = bytearray(harness.read_bytes(path))
    content[220:224] = len(titles).to_bytes(4, "little")
    for i, title in enumerate(titles):
        content[224 + 80 * i:304 + 80 * i] = title.encode().ljust(80)
    content[92:96] = len(extended).to_bytes(4, "little")
    content[104:108] = kind
    content[128:132] = b"".join(n.to_bytes(2, "little", signed=True) for n in shorts)
    with open(path, "wb") as file:
        file.write(content[:1024] + extended + content[1024:])


def float_records(axis):
    """Returns records of Xplore3D: 32 floats, of which the first is the tilt, the 11th the axis and
    the 12th the pixel size in metres."""
    records = np.zeros((len(TILTS), 32), "<f4")
    records[:, 0], records[:, 10], records[:, 11] = TILTS, axis, 1e-10 * PIXEL_A
    return records.tobytes()


@pytest.mark.parametrize("titles, extended", [
    (["    Tilt axis angle = 85.3, binning = 1  spot = 8  camera = 2"], b""),
    (["Fei Company (C) Copyright 2003"], float_records(-85.3)),
    (["UCSF"], float_records(85.3))])
def test_the_axis_of_a_header_is_used(titles, extended):
    folder = write_series("header", 85.3)
    stack = os.path.join(folder, "TS_01.mrc")
    write_titles(stack, titles, extended, (0, 32) if extended else (0, 0))
    words = ["TS_01.mrc"] if extended else ["TS_01.mrc", "--tlt", "TS_01.rawtlt"]
    expect(dry(folder, *words, status=2), "the header of 'TS_01.mrc'", "85.3°")
    expect(dry(folder, *words, "--align", "full"), "tilt axis of the views: 85.3° from")
    # An aligned stack keeps the titles of the raw one.
    write_titles(stack, titles + ["NEWSTACK: Images copied, transformed   27-Nov-26"])
    dry(folder, "TS_01.mrc", "--tlt", "TS_01.rawtlt")


def test_views_are_turned_by_the_axis():
    folder = write_series("turned", 85.3)
    words = ["TS_01.mrc", "--tlt", "TS_01.rawtlt", "--thickness", 24]
    volume = back_projection(folder, *words, "--tilt-axis", 85.3)
    assert volume.shape == (24, 72, 56)
    assert distances(volume).max() < 0.5
    assert distances(back_projection(folder, *words, "--tilt-axis", 75.3)).max() > 1
    write(folder, "TS_01.xf", transforms(85.3))
    expect(dry(folder, "TS_01.mrc", "--tlt", "TS_01.rawtlt", "--xf", "TS_01.xf", "--tilt-axis", 85,
               status=2), "--tilt-axis", "--xf")


def test_an_alignment_begins_with_the_axis():
    """Views that are shifted at random come back from one command."""
    tilts = np.arange(-60, 61, 6.0)
    folder = fresh_directory("raw")
    random = np.random.default_rng(3)
    beads = np.column_stack([random.uniform(-24, 24, 30), random.uniform(-24, 24, 30),
                             random.uniform(-8, 8, 30)])
    shifts = random.normal(0, 2, (len(tilts), 2))
    views = [bead_views(85.3, (72, 72), [tilt], shift, beads)[0] for tilt, shift in zip(tilts, shifts)]
    harness.write_stack(os.path.join(folder, "TS_01.mrc"), views, PIXEL_A)
    write(folder, "TS_01.mdoc",
          mdoc_text(tilts, "[T = Tilt axis angle = 85.3, binning = 1]"))
    harness.succeed("align", "TS_01.mdoc", "--align", "full", "--thickness", 24, "--contrast", "bright",
                    "--bead-diameter", 0, "-o", "a.mrc", cwd=folder)
    rows = np.loadtxt(os.path.join(folder, "a_align.xf"))
    axis = np.degrees(np.arctan2(rows[:, 1] - rows[:, 2], rows[:, 0] + rows[:, 3]))
    assert np.abs(axis - 85.3).max() < 2
    # The shift along the axis is what remains of -A shift; a common one is no error.
    along = rows[:, 5] + rows[:, 2] * shifts[:, 0] + rows[:, 3] * shifts[:, 1]
    assert np.std(along) < 0.5 < np.std(rows[:, 5])
    harness.succeed("reconstruct", "TS_01.mdoc", "--align", "full", "--thickness", 24, "--contrast",
                    "bright", "--bead-diameter", 0, "--epochs", 1, "--coarse-epochs", 2, "-o", "r.mrc",
                    cwd=folder)
    with open(os.path.join(folder, "r.json"), encoding="utf-8") as file:
        record = json.load(file)
    assert record["options"]["input"]["tilt_axis_deg"] == 85.3
    axis_of_file = [o for o in record["origins"] if o["option"] == "--tilt-axis"]
    assert len(axis_of_file) == 1 and "TS_01.mdoc" in axis_of_file[0]["file"]


def test_what_the_axis_cannot_be_told_from_is_asked_for():
    folder = write_series("unclear", 85.3)
    write(folder, "TS_01.mdoc",
          mdoc_text(head="[T =   TiltAxisAngle = -175.30  Binning = 1  SpotSize = 6]"))
    for more in ([], ["--align", "full"]):
        expect(dry(folder, "TS_01.mdoc", *more, status=2), "TiltAxisAngle = -175.3", "--tilt-axis", "85.3")
    dry(folder, "TS_01.mdoc", "--align", "full", "--tilt-axis", 85.3)
    os.remove(os.path.join(folder, "TS_01.mdoc"))
    expect(dry(folder, "TS_01.mrc", "--tlt", "TS_01.rawtlt", "--align", "full"),
           "warning: no file states the tilt axis of 'TS_01.mrc'")


def test_a_given_axis_that_contradicts_the_files_is_said():
    folder = write_series("contradiction", 85.3)
    write(folder, "TS_01.mdoc", mdoc_text(head="[T = Tilt axis angle = 85.3, binning = 1]"))
    said = dry(folder, "TS_01.mdoc", "--tilt-axis", 40)
    expect(said, "warning: --tilt-axis turns the views by 40°, and 'TS_01.mdoc', line 1 states 85.3°")
    assert "--tilt-axis turns" not in dry(folder, "TS_01.mdoc", "--tilt-axis", 86)
    expect(dry(folder, "TS_01.mdoc", "--tilt-axis", 85.3 - 180), "--tilt-axis turns")  # mirrors the tomogram
    nominal = write_series("nominal_axis", 85.3, stack="TS_01.mrcs")
    write(nominal, "TS_01.star", "\ndata_TS_01\n\nloop_\n_rlnMicrographName\n"
          "_rlnTomoNominalStageTiltAngle\n_rlnTomoNominalTiltAxisAngle\n"
          + "".join(f"{i + 1:06}@TS_01.mrcs {tilt:.2f} 85.3\n" for i, tilt in enumerate(TILTS)))
    expect(dry(nominal, "TS_01.star", "--tilt-axis", 40), "turns the views by 40°", "states 85.3°")


@pytest.mark.parametrize("nominal_deg, said", [(3, ""), (86.2, "are they of one series?"), (-178, "mirrored in z")])
def test_a_nominal_axis_that_contradicts_the_refined_one_is_said(nominal_deg, said):
    folder = write_series("refined_axis", 0, stack="TS_01.mrcs")
    write(folder, "TS_01.star", "\ndata_TS_01\n\nloop_\n_rlnMicrographName\n_rlnTomoNominalTiltAxisAngle\n_rlnTomoYTilt\n"
          "_rlnTomoZRot\n_rlnTomoXShiftAngst\n_rlnTomoYShiftAngst\n"
          + "".join(f"{i + 1:06}@TS_01.mrcs {nominal_deg} {tilt:.2f} 2 0 0\n" for i, tilt in enumerate(TILTS)))
    found = dry(folder, "TS_01.star")
    assert said in found and ("rlnTomoNominalTiltAxisAngle" in found) == bool(said), found


@pytest.mark.parametrize("words", (["info"], ["baseline", "wbp", "-o", "x.mrc"],
                                   ["compare", "--methods", "wbp", "-o", "x"]))
def test_commands_without_align_name_those_that_have_it(words):
    folder = write_series("no_align", 85.3)
    write(folder, "TS_01.mdoc", mdoc_text(head="[T = Tilt axis angle = 85.3, binning = 1]"))
    more = [] if words[0] == "info" else ["--thickness", 24]
    refused = harness.tomofield(*words, "TS_01.mdoc", *more, cwd=folder)
    assert refused.returncode == 2
    expect(refused.stderr, "`tomofield reconstruct` and `align` begin with this axis if --align full")


def test_a_pixel_size_of_1_A_is_not_taken_in_silence():
    folder = write_series("one_angstrom")
    path = os.path.join(folder, "TS_01.mrc")
    harness.write_stack(path, bead_views(0, (56, 72)), 1.0)
    said = dry(folder, "TS_01.mrc", "--tlt", "TS_01.rawtlt")
    expect(said, "warning: 'TS_01.mrc' states pixels of 1 Å", "--pixel-size")
    assert "--pixel-size" not in dry(folder, "TS_01.mrc", "--tlt", "TS_01.rawtlt", "--pixel-size", 1)


@pytest.mark.parametrize("cell, parts", [
    ((720, 0), ["10 × 0 Å", "--pixel-size"]),
    ((0, 560), ["0 × 10 Å", "--pixel-size"]),
    ((720, -560), ["10 × 0 Å", "--pixel-size"]),
    ((-720, -560), ["warning", "states pixels of -10 × -10 Å", "1 Å is assumed"]),
    ((np.inf, np.inf), ["warning", "states pixels of inf × inf Å"]),
    ((7.2e30, 5.6e30), ["warning", "states pixels of 1e+29 × 1e+29 Å"]),
    ((0, 0), ["warning", "has no pixel size"])])
def test_a_pixel_size_that_cannot_be_is_said(cell, parts):
    folder = write_series("cell")
    with open(os.path.join(folder, "TS_01.mrc"), "r+b") as file:
        file.seek(40)
        file.write(np.array([*cell, 10], "<f4").tobytes())
    refused = "warning" not in parts
    files = ["TS_01.mrc", "--tlt", "TS_01.rawtlt"]
    expect(dry(folder, *files, status=2 if refused else 0), "TS_01.mrc", *parts)
    assert "states pixels" not in dry(folder, *files, "--pixel-size", 10)


def test_a_stack_that_is_longer_than_its_header_says():
    folder = write_series("long")
    files = ["TS_01.mrc", "--tlt", "TS_01.rawtlt"]
    for count, is_said in ((100, False), (4 * 72 * 56 * 2, True)):  # bytes; two sections
        with open(os.path.join(folder, "TS_01.mrc"), "ab") as file:
            file.write(b"\0" * count)
        assert ("'TS_01.mrc' is longer" in dry(folder, *files)) == is_said
    expect(dry(folder, *files), "after the 15 sections", "room for 2 more")


def test_a_series_of_relion_that_is_not_aligned_yet():
    folder = write_series("nominal", 85.3, stack="TS_01.mrcs")
    rows = "".join(f"{i + 1:06}@TS_01.mrcs {tilt:.2f} 85.3\n" for i, tilt in enumerate(TILTS))
    write(folder, "TS_01.star", "data_TS_01\n\nloop_\n_rlnMicrographName #1\n"
          "_rlnTomoNominalStageTiltAngle #2\n_rlnTomoNominalTiltAxisAngle #3\n" + rows)
    expect(dry(folder, "TS_01.star", status=2), "not aligned yet", "85.3°", "--align full")
    expect(dry(folder, "TS_01.star", "--align", "full"), "tilt axis of the views: 85.3° from",
           "tilts -42.0° to 42.0°")
    with open(os.path.join(folder, "TS_01.star"), encoding="utf-8") as file:
        text = file.read()
    write(folder, "TS_01.star", text.replace(" 85.3\n", " 0\n", 1))
    expect(dry(folder, "TS_01.star", "--align", "full", status=2), "nominal tilt axes of 0° and 85.3°")


# ---------------------------------------------------------------------------------------- eTomo

def write_etomo(name, axis=85.3, shape=(56, 72), newst="", tilt="", with_newst=True):
    folder = write_series(name, axis, shape, stack="TS.st")
    write(folder, "TS.xf", transforms(axis))
    np.savetxt(os.path.join(folder, "TS.tlt"), TILTS, fmt="%.2f")
    write(folder, "tilt.com", "$tilt -StandardInput\nInputProjections TS_ali.mrc\nOutputFile a.rec\n"
          f"TILTFILE TS.tlt\nTHICKNESS 24\n{tilt}")
    if with_newst:
        write(folder, "newst.com", "$newstack -StandardInput\nInputFile\tTS.st\nOutputFile\tTS_ali.mrc\n"
              f"TransformFile\tTS.xf\n{newst}")
    return folder


@pytest.mark.parametrize("newst", ["", "SizeToOutputInXandY\t,,\n", "SizeToOutputInXandY\t/\n",
                                   "SizeToOutputInXandY\t72,/\n", "SizeToOutputInXandY ,56\n",
                                   "SizeToOutputInXandY\t72,56\nOffsetsInXandY\t,\n"])
def test_an_aligned_stack_without_a_size_has_that_of_the_raw_one(newst):
    folder = write_etomo("sizes", newst=newst, tilt="FULLIMAGE 72 56\nSUBSETSTART 0 0\n")
    assert "--center" not in harness.succeed("info", "tilt.com", cwd=folder).stdout
    volume = back_projection(folder, "tilt.com")
    assert volume.shape[1:] == (56, 56)  # what both the views and the aligned stack cover
    assert distances(volume).max() < 0.5


@pytest.mark.parametrize("tilt", ["FULLIMAGE 72 56\n", "FULLIMAGE 56 72\nSUBSETSTART 0 0\n", "FULLIMAGE\n",
                                  "", "FULLIMAGE /\nSHIFT ,\nOFFSET /\n"])
def test_tilt_com_alone_has_the_axis_in_the_middle(tilt):
    folder = write_etomo("alone", with_newst=False, tilt=tilt)
    assert distances(back_projection(folder, "tilt.com")).max() < 0.5


def test_a_part_without_newst_com():
    """SUBSETSTART counts from the whole aligned views, in which the aligned stack has 40 × 60 pixels
    from (10, 4) on: its middle is 2 pixels right of the axis and 2 below the middle of the views."""
    folder = write_etomo("part", with_newst=False, tilt="FULLIMAGE 56 72\nSUBSETSTART 10 4\n")
    expect(dry(folder, "tilt.com", status=2), "SUBSETSTART", "newst.com")
    harness.write_stack(os.path.join(folder, "TS_ali.mrc"), np.ones((len(TILTS), 60, 40), np.float32))
    volume = back_projection(folder, "tilt.com")
    assert volume.shape == (24, 60, 40)
    beads = [(x - 2, y + 2, z) for x, y, z in BEADS]
    assert harness.distances_of_beads(volume, beads).max() < 0.5


def test_files_are_found_beside_a_folder_that_was_moved():
    folder = write_etomo("moved", newst="")
    np.savetxt(os.path.join(folder, "TS.xtilt"), np.zeros(len(TILTS)), fmt="%.2f")
    for name in ("tilt.com", "newst.com"):
        path = os.path.join(folder, name)
        text = harness.read_bytes(path).decode().replace("TS.", "/old/cluster/TS.")
        write(folder, name, text.replace("\n", "\r\n"))  # with the line ends of Windows
    with open(os.path.join(folder, "tilt.com"), "a", encoding="utf-8") as file:
        file.write("XTILTFILE C:\\old\\TS.xtilt\r\n")
    printed = harness.succeed("info", "tilt.com", cwd=folder).stdout
    expect(printed, "stack TS.st", "--xf TS.xf", "--tlt TS.tlt", "--xtilt TS.xtilt")


def test_a_dataset_of_etomo():
    folder = write_series("dataset", 85.3, stack="TS_01.st")
    edf = write(folder, "TS_01.edf", "#Wed Jan 01\nSetup.DatasetName=TS_01\nSetup.AxisType=Single Axis\n"
                "Setup.ImageRotationA=85.3\nSetup.PixelSize=1.0\nSetup.ViewType=Single View\n")
    words = ["TS_01.edf", "--thickness", 24]
    assert distances(back_projection(folder, *words)).max() < 0.5
    expect(harness.succeed("info", ".", cwd=folder).stdout, "--tilt-axis 85.3 from", "TS_01.rawtlt")
    edf_text = "Setup.DatasetName=TS_01\nSetup.AxisType=Single Axis\n"
    write(folder, "TS_01.edf", edf_text + "Setup.ImageRotationA=265\n")
    expect(harness.succeed("info", ".", cwd=folder).stdout, "--tilt-axis -95 from")
    write(folder, "TS_01.edf", edf_text + "Setup.ImageRotationA=83,9\n")
    expect(dry(folder, "TS_01.edf", status=2), "Setup.ImageRotationA", "83,9")
    write(folder, "TS_01.edf", edf_text + "Setup.ViewType=Montage\n")
    expect(dry(folder, "TS_01.edf", status=2), "montage")
    write(folder, "TS_01.xf", transforms(85.3))
    write(folder, "TS_01.edf", edf_text + "Setup.AxisA.ExcludeProjections=3,5-6\nSetup.PixelSize=0.5\n")
    expect(harness.succeed("info", ".", cwd=folder).stdout, "--xf ./TS_01.xf")
    expect(dry(folder, "TS_01.edf"), "--exclude 3,5-6", "states pixels of 5 Å")
    ranged = "Setup.AxisA.TiltAngle.Type=Range\nSetup.AxisA.TiltAngle.RangeMin=-30\n"
    write(folder, "TS_01.edf", edf_text + ranged)
    assert "TiltAngle.Type" not in dry(folder, "TS_01.edf"), "a .rawtlt is there"
    os.rename(os.path.join(folder, "TS_01.rawtlt"), os.path.join(folder, "kept"))
    expect(dry(folder, "TS_01.edf", status=2), "Setup.AxisA.TiltAngle.Type is Range", "--tlt")
    os.rename(os.path.join(folder, "kept"), os.path.join(folder, "TS_01.rawtlt"))
    write(folder, "TS_01.edf", edf_text + "Setup.ImageRotationA=5.3\n")
    expect(dry(folder, "TS_01.edf"), "TS_01.xf' turns the views", "85.3°", "Setup.ImageRotationA", "5.3°")
    write(folder, "TS_01.edf", "Setup.DatasetName=TS_01\nSetup.AxisType=Dual Axis\n")
    expect(dry(folder, "TS_01.edf", status=2), "two axes", "tilta.com")
    os.remove(os.path.join(folder, "TS_01.st"))
    write(folder, "TS_01.edf", "Setup.DatasetName=TS_01\n")
    expect(dry(folder, edf, status=2), "TS_01.st", "tilt.com")


# ----------------------------------------------------------------------------------- microscope

def ctf_text(defoci):
    return "# Columns: #1 - micrograph number; #2 - defocus 1 [A]\n" + "".join(
        f"{i + 1} {d} {d} 0 0 0.1 20\n" for i, d in enumerate(defoci))


def test_the_voltage_of_an_mdoc_counts():
    folder = write_series("voltage")
    write(folder, "TS_01.mdoc", mdoc_text(head="Voltage = 120\nImageFile = TS_01.mrc"))
    expect(dry(folder, "TS_01.mdoc", "--defocus", 3), "--voltage 120 from TS_01.mdoc: Voltage")
    expect(dry(folder, "TS_01.mdoc", "--defocus", 3, "--voltage", 200), "not used: --voltage 200 is given")
    expect(dry(folder, "TS_01.mrc", "--mdoc", "TS_01.mdoc", "--defocus", 3),
           "voltage: 120 kV from 'TS_01.mdoc'")
    write(folder, "ctf.txt", "# acceleration voltage: 300.0 keV\n" + ctf_text([30000] * len(TILTS)))
    expect(dry(folder, "TS_01.mdoc", "--ctf", "ctf.txt"), "warning: 'ctf.txt'", "300 kV", "120 kV")


def test_the_pixel_size_of_a_binned_record():
    folder = write_series("pixels")
    harness.write_stack(os.path.join(folder, "TS_01.mrc"), bead_views(0, (56, 72)), 1.0)
    write(folder, "TS_01.mdoc", mdoc_text(head="PixelSpacing = 5.4\nImageSize = 18 14"))
    expect(dry(folder, "TS_01.mdoc"), "pixels of 1.35 Å")
    harness.write_stack(os.path.join(folder, "TS_01.mrc"), bead_views(0, (56, 72)), 5.4)
    expect(dry(folder, "TS_01.mdoc"), "states pixels of 1.35 Å", "of 5.4 Å: the latter is taken")


@pytest.mark.parametrize("spacing_A, is_other", [(7, True), (20, True), (5, False), (9.7, False)])
def test_an_mdoc_of_another_pixel_size_is_doubted(spacing_A, is_other):
    """The stack has pixels of 10 Å. One that is twice binned, or calibrated, is that of the .mdoc."""
    folder = write_series("other_pixels")
    write(folder, "TS_01.mdoc", mdoc_text(head=f"PixelSpacing = {spacing_A}"))
    said = dry(folder, "TS_01.mrc", "--mdoc", "TS_01.mdoc", "--tlt", "TS_01.rawtlt")
    assert ("the latter is taken" in said) == is_other, said
    expect(said, "pixels of 10 Å")


def test_the_contrast_transfer_beside_a_project_is_used():
    folder = write_etomo("etomo_ctf", 0.0, newst="", tilt="FULLIMAGE 72 56\n")
    defocus = "".join(f"{i + 1} {i + 1} {tilt:.2f} {tilt:.2f} 3000{' 2' if i == 0 else ''}\n"
                      for i, tilt in enumerate(TILTS))
    write(folder, "TS.defocus", defocus)
    write(folder, "ctfcorrection.com", "$ctfphaseflip -StandardInput\nInputStack TS_ali.mrc\n"
          "DefocusFile TS.defocus\nVoltage 200\nSphericalAberration 2.2\nAmplitudeContrast 0.1\n")
    expect(dry(folder, "."), "--ctf ./TS.defocus from", "--voltage 200 from ./ctfcorrection.com: Voltage",
           "--cs 2.2 from", "--amplitude-contrast 0.1 from", "the defocus of each view from")
    for off in (["--ctf", "none"], ["--ignore", "CTF"], ["--engine", "ray"]):
        assert "the defocus of each view from" not in dry(folder, ".", *off)
    expect(dry(folder, ".", "--ignore", "CTF", "--defocus", 3), "--cs 2.2 from")
    # An aligned stack whose phases IMOD flipped.
    os.remove(os.path.join(folder, "TS.st"))
    aligned = os.path.join(folder, "TS_ali.mrc")
    harness.write_stack(aligned, bead_views(0, (56, 72)), PIXEL_A)
    assert "--ctf-phase-flipped" not in dry(folder, ".")
    write_titles(aligned, ["NEWSTACK: Images copied, transformed", "ctfPhaseFlip: CTF correction"])
    expect(dry(folder, "."), "--ctf-phase-flipped true from ./TS_ali.mrc: ctfphaseflip")


@pytest.mark.parametrize("ending", ["_CTF.txt", "_ctf.star"])
def test_the_contrast_transfer_beside_an_alignment_is_used(ending):
    folder = write_series("beside")
    write(folder, "TS_01.aln", "# RawSize = 72 56 15\n" + "".join(
        f"{i + 1} 0 1 0 0 1 1 1 0 {tilt}\n" for i, tilt in enumerate(TILTS)))
    star = "data_\n\nloop_\n_rlnDefocusU #1\n_rlnDefocusV #2\n" + "30000 29000\n" * len(TILTS)
    write(folder, "TS_01" + ending, ctf_text([30000] * len(TILTS)) if ending[-1] == "t" else star)
    mtf = "data_\n\nloop_\n_rlnResolutionInversePixel #1\n_rlnMtfValue #2\n0 1\n0.5 0.4\n"
    write(folder, "K3_mtf.star", mtf)
    printed = dry(folder, "TS_01.aln")
    expect(printed, f"--ctf TS_01{ending} from", "--mtf K3_mtf.star from", "what the detector passes")
    write(folder, "other_mtf.star", mtf)
    assert "--mtf" not in dry(folder, "TS_01.aln")  # nothing says which
    write(folder, "TS_01.mrc.mdoc", mdoc_text())
    expect(dry(folder, "TS_01.mrc.mdoc"), f"--ctf TS_01{ending} from")


# --------------------------------------------------------------- tables and sections that differ

def exposure_line(printed):
    return [line for line in printed.splitlines() if line.startswith("dose:")]


def test_the_mdoc_of_the_uncut_stack_is_matched_by_tilt():
    all_tilts = np.arange(-60, 61, 6.0)
    folder = write_series("uncut")
    doses = "ExposureDose = 3\nDateTime = 12-Mar-21 10:{:02}:00\n"
    write(folder, "all.mdoc", mdoc_text(all_tilts, "PixelSpacing = 10",
                                        lambda i: doses.format(59 - i)))
    words = ["TS_01.mrc", "--mdoc", "all.mdoc", "--defocus", 3]
    printed = dry(folder, *words, "--tlt", "TS_01.rawtlt")
    assert exposure_line(printed) == ["dose: from 'all.mdoc'"]
    assert "warning" not in printed
    expect(dry(folder, *words, status=2), "all.mdoc", "21 sections", "TS_01.mrc", "15 sections")
    np.savetxt(os.path.join(folder, "odd.tlt"), TILTS + 3, fmt="%.2f")
    expect(dry(folder, *words, "--tlt", "odd.tlt", status=2), "all.mdoc", "21", "15")


def test_times_that_give_no_order_are_named():
    folder = write_series("untimed")
    times = [f"12-Mar-21 10:{i:02}:00" for i in range(len(TILTS))]
    times[3] = "12/03/21 10:03"
    write(folder, "TS_01.mdoc", mdoc_text(
        TILTS, "PixelSpacing = 10", lambda i: f"ExposureDose = 3\nDateTime = {times[i]}\n"))
    words = ["TS_01.mrc", "--mdoc", "TS_01.mdoc", "--tlt", "TS_01.rawtlt", "--defocus", 3]
    printed = dry(folder, *words)
    expect(printed, "warning: 'TS_01.mdoc': line", "DateTime is not a date and a time", "not used")
    assert exposure_line(printed) == []
    expect(dry(folder, *words, "--dose-per-tilt", 3, status=2), "TS_01.mdoc", "line", "DateTime")


def test_doses_that_no_specimen_bears_are_refused():
    folder = write_series("burnt")
    write(folder, "TS_01.mdoc", mdoc_text(
        TILTS, "PixelSpacing = 10", lambda i: f"PriorRecordDose = {300 * i}\n"))
    words = ["TS_01.mrc", "--tlt", "TS_01.rawtlt", "--defocus", 3]
    expect(dry(folder, *words, "--dose-per-tilt", 300, status=2), "--dose-per-tilt add up to 4500")
    expect(dry(folder, *words, "--mdoc", "TS_01.mdoc", status=2), "'TS_01.mdoc' add up to 4500")
    expect(dry(folder, *words, "--mdoc", "TS_01.mdoc", "--dose-per-tilt", 0), "an underfocus of 3")


def test_a_defocus_file_that_ends_early_goes_on():
    folder = write_series("defocus")
    words = ["TS_01.mrc", "--tlt", "TS_01.rawtlt", "--ctf", "TS.defocus"]
    lines = [f"{i + 1} {i + 1} {tilt:.2f} {tilt:.2f} {3000 + 10 * i}" for i, tilt in enumerate(TILTS)]
    write(folder, "TS.defocus", "\n".join([lines[0] + " 2"] + lines[1:10]) + "\n")
    expect(dry(folder, *words), "the defocus of each view from 'TS.defocus'")
    more = [f"{i + 16} {i + 16} {tilt:.2f} {tilt:.2f} 4000" for i, tilt in enumerate([48, 54])]
    write(folder, "TS.defocus", "\n".join([lines[0] + " 2"] + lines[1:] + more) + "\n")
    expect(dry(folder, *words), "the defocus of each view from 'TS.defocus'")  # matched by tilt


def test_the_table_of_aretomo_3_has_no_dark_frames():
    folder = write_series("dark", tilts=TILTS)
    kept = [i for i in range(len(TILTS)) if i not in (2, 9)]
    head = "# RawSize = 72 56 15\n# DarkFrame = 2 0 -30\n# DarkFrame = 9 0 12\n# AlphaOffset = 6\n"
    write(folder, "TS_01.aln", head + "".join(
        f"{i + 1} 0 1 0 0 1 1 1 0 {TILTS[i] + 6}\n" for i in kept))
    write(folder, "TS_01_CTF.txt", ctf_text([30000 + 100 * i for i in kept]))
    words = ["TS_01.aln", "--epochs", 1, "--coarse-epochs", 2, "--contrast", "bright", "--thickness", 24,
             "--bead-diameter", 0]
    volumes = []
    write(folder, "full.txt", ctf_text([30000 + 100 * i for i in range(len(TILTS))]))
    for table in ("TS_01_CTF.txt", "full.txt"):
        output = os.path.join(folder, table + ".mrc")
        harness.succeed("reconstruct", *words, "--ctf", table, "-o", output, cwd=folder)
        volumes.append(harness.read_volume(output))
    assert np.array_equal(*volumes)
    write(folder, "short.txt", ctf_text([30000] * 4))
    expect(dry(folder, "TS_01.aln", "--ctf", "short.txt", status=2), "short.txt", "4 sections", "15")


SHORT = ["--epochs", 1, "--coarse-epochs", 0, "--contrast", "bright", "--thickness", 24, "--bead-diameter", 0]


def test_the_table_of_aretomo_has_the_order_of_its_alignment():
    """AreTomo 2 sorts the views by tilt; the stack stays in the order of recording."""
    recorded = sorted(range(len(TILTS)), key=lambda i: abs(TILTS[i]))  # [section]: its place by tilt
    folder = write_series("recorded", tilts=[TILTS[i] for i in recorded])
    write(folder, "TS_01.aln", "# RawSize = 72 56 15\n# NumPatches = 0\n" + "".join(
        f"{recorded.index(i)} 0 1 0 0 1 1 1 0 {TILTS[i]}\n" for i in range(len(TILTS))))
    write(folder, "TS_01_CTF.txt", ctf_text([30000 + 1000 * i for i in range(len(TILTS))]))
    write(folder, "ctffind.txt", "# Output from CTFFind version 4.1.14\n" +
          ctf_text([30000 + 1000 * i for i in recorded]))
    volumes = []
    for table in ("TS_01_CTF.txt", "ctffind.txt"):
        output = os.path.join(folder, table + ".mrc")
        harness.succeed("reconstruct", "TS_01.aln", *SHORT, "--ctf", table, "-o", output, cwd=folder)
        volumes.append(harness.read_volume(output))
    assert np.array_equal(*volumes)
    volumes = []
    for table in ("TS_01_CTF.txt", "ctffind.txt"):  # without the alignment
        output = os.path.join(folder, table + ".mrc")
        said = harness.succeed("reconstruct", "TS_01.mrc", "--tlt", "TS_01.rawtlt", *SHORT, "--ctf", table,
                               "--overwrite", "-o", output, cwd=folder)
        assert ("count as those of AreTomo" in said.stderr) == (table == "TS_01_CTF.txt"), said.stderr
        volumes.append(harness.read_volume(output))
    assert np.array_equal(*volumes)
    refused = harness.tomofield("reconstruct", "TS_01.mrc", "--tlt", "TS_01.rawtlt", *SHORT, "--exclude", 2,
                                "--ctf", "TS_01_CTF.txt", "-o", "x.mrc", cwd=folder)
    assert refused.returncode == 2 and "--aln" in refused.stderr, refused.stderr


def test_a_defocus_file_without_the_first_views_is_placed_by_tilt():
    folder = write_series("late_defocus")
    volumes = []
    for name, first in (("late", 3), ("whole", 0)):
        lines = [f"{row + 1} {row + 1} {TILTS[i]} {TILTS[i]} {3000 + 100 * max(i, 3)}"
                 for row, i in enumerate(range(first, len(TILTS)))]
        write(folder, name + ".defocus", "\n".join([lines[0] + " 2"] + lines[1:]) + "\n")
        output = os.path.join(folder, name + ".mrc")
        harness.succeed("reconstruct", "TS_01.mrc", "--tlt", "TS_01.rawtlt", *SHORT, "--ctf", name + ".defocus",
                        "-o", output, cwd=folder)
        volumes.append(harness.read_volume(output))
    assert np.array_equal(*volumes)


def test_a_defocus_that_no_view_has_is_named():
    folder = write_series("micrometres")
    for defocus, part in ((3.2, "a defocus of 3.2 Å"), (-30000, "a defocus of -3e+04 Å")):
        write(folder, "TS_ctf.txt", ctf_text([defocus] * len(TILTS)))
        said = harness.succeed("reconstruct", "TS_01.mrc", "--tlt", "TS_01.rawtlt", "--ctf", "TS_ctf.txt",
                               "--thickness", 24, "--epochs", 1, "--coarse-epochs", 0, "--tv", 5, "--prior", "tv",
                               "--tv-penalty", "smooth", "--overwrite", "-o", "out.mrc", cwd=folder)
        expect(said.stderr, "warning:", part, "under focus", "in 15 of its sections")


def test_the_angles_of_aretomo_3_have_three_columns():
    folder = write_series("columns")
    order = np.argsort(np.argsort(np.abs(TILTS), kind="stable"), kind="stable") + 1
    write(folder, "TS_01_TLT.txt", "".join(f"{t:8.2f} {n:4d} {3:8.2f}\n" for t, n in zip(TILTS, order)))
    printed = dry(folder, "TS_01.mrc", "--tlt", "TS_01_TLT.txt", "--defocus", 3)
    expect(printed, "tilts -42.0° to 42.0° from TS_01_TLT.txt", "dose: from 'TS_01_TLT.txt'")


# --------------------------------------------------------------------------- late and contradictory

def test_a_black_half_is_refused():
    folder = write_series("halves")
    views = bead_views(0, (56, 72))
    harness.write_stack(os.path.join(folder, "even.mrc"), views)
    odd = views.copy()
    odd[3:5] = 7
    harness.write_stack(os.path.join(folder, "odd.mrc"), odd)
    result = harness.tomofield("reconstruct", "TS_01.mrc", "--tlt", "TS_01.rawtlt", "--even", "even.mrc",
                               "--odd", "odd.mrc", "--thickness", 24, "--contrast", "bright", "-o",
                               "o.mrc", cwd=folder)
    assert result.returncode == 2 and not os.path.exists(os.path.join(folder, "o.mrc"))
    expect(result.stderr, "sections 4,5 of 'odd.mrc' are constant")


def test_a_tomogram_is_no_stack():
    folder = write_series("own", stack="TS_01.st")
    write(folder, "TS_01.aln", "# RawSize = 72 56 15\n" + "".join(
        f"{i + 1} 0 1 0 0 1 1 1 0 {tilt}\n" for i, tilt in enumerate(TILTS)))
    words = ["reconstruct", "TS_01.aln", "--thickness", 24, "--contrast", "bright", "--epochs", 1,
             "--coarse-epochs", 2, "--tv", 5, "-o", "TS_01.mrc"]
    harness.succeed(*words, cwd=folder)
    harness.succeed(*words, "--overwrite", cwd=folder)
    expect(dry(folder, "TS_01.mrc", "--tlt", "TS_01.rawtlt", status=2), "'TS_01.mrc'", "tomofield wrote")


def test_a_batch_takes_a_stack_once():
    folder = write_series("batch")
    write(folder, "TS_01.mrc.mdoc", mdoc_text())
    words = ["batch", "TS_01.mr*", "--tlt", "TS_01.rawtlt", "--thickness", 24, "--contrast", "bright",
             "-o", "res"]
    result = harness.tomofield(*words, "--dry-run", cwd=folder)
    assert result.returncode == 2
    expect(result.stderr, "'TS_01.mrc' and 'TS_01.mrc.mdoc'", "the same stack", "leave one of them out")
    # Rows of a table may try several settings on one stack.
    write(folder, "two.csv", "stack,bin,name\nTS_01.mrc,1,a\nTS_01.mrc,2,b\n")
    words[1] = "two.csv"
    harness.succeed(*words, "--dry-run", cwd=folder)


# ------------------------------------------------------------------------------------ the program

def test_the_program_alone_shows_its_help():
    result = harness.succeed()
    expect(result.stdout, "Usage: tomofield", "reconstruct")


def test_a_dry_run_needs_no_output():
    folder = write_series("dry")
    before = sorted(os.listdir(folder))
    expect(dry(folder, "TS_01.mrc", "--tlt", "TS_01.rawtlt"), "tomogram 72 × 56 × 24 voxels")
    assert sorted(os.listdir(folder)) == before
    result = harness.tomofield("reconstruct", "TS_01.mrc", "--tlt", "TS_01.rawtlt", "--thickness", 24,
                               cwd=folder)
    assert result.returncode == 2
    assert re.search("--output is required", result.stderr)


def test_a_table_in_another_order_than_the_views_is_named():
    """The angles of a .defocus, and those of an .aln beside --tlt, belong to other views."""
    folder = write_series("other_order")
    defocus = "".join(f"{i + 1} {i + 1} {-tilt} {-tilt} {3000 + 10 * i}{' 2' if i == 0 else ''}\n"
                      for i, tilt in enumerate(TILTS))
    write(folder, "TS.defocus", defocus)
    short = ["--thickness", 24, "--epochs", 1, "--coarse-epochs", 0, "--tv", 5, "--tv-penalty", "smooth",
             "--prior", "tv", "--pixel-size", 10, "--overwrite", "-o", "out.mrc"]
    said = harness.succeed("reconstruct", "TS_01.mrc", "--tlt", "TS_01.rawtlt", "--ctf", "TS.defocus",
                           *short, cwd=folder)
    expect(said.stderr, "the tilt angles of", "'TS.defocus'", "order of the sections")
    order = sorted(range(len(TILTS)), key=lambda i: abs(TILTS[i]))
    write(folder, "TS.defocus", "".join(
        f"{row + 1} {row + 1} {TILTS[i]} {TILTS[i]} {3000 + 10 * i}{' 2' if row == 0 else ''}\n"
        for row, i in enumerate(order)))
    said = harness.succeed("reconstruct", "TS_01.mrc", "--tlt", "TS_01.rawtlt", "--ctf", "TS.defocus",
                           *short, cwd=folder)
    expect(said.stderr, "warning: 'TS.defocus' lists the views in another order", "matched by their tilts")
    rows = "".join(f"{i + 1} 0 1 0 0 1 1 1 0 {-tilt}\n" for i, tilt in enumerate(TILTS))
    write(folder, "TS.aln", f"# RawSize = 72 56 {len(TILTS)}\n# NumPatches = 0\n" + rows)
    said = dry(folder, "TS_01.mrc", "--tlt", "TS_01.rawtlt", "--aln", "TS.aln")
    expect(said, "the tilt angles of", "'TS.aln'", "order of the sections")


def test_another_axis_in_the_header_is_named():
    folder = write_series("two_axes")
    with mrcfile.open(os.path.join(folder, "TS_01.mrc"), "r+") as file:
        file.header.label[0], file.header.nlabl = "Tilt axis angle = 85.3, binning = 1", 1
    write(folder, "TS_01.mdoc", mdoc_text(head="[T = Tilt axis angle = 0.2, binning = 1]\n"))
    expect(dry(folder, "TS_01.mrc", "--mdoc", "TS_01.mdoc"), "85.3", "--tilt-axis")


def said_of_label(label, *options):
    """Returns what a short run says of a stack with this label."""
    folder = write_series("label")
    write_titles(os.path.join(folder, "TS_01.mrc"), [label])
    return harness.succeed("reconstruct", "TS_01.mrc", "--tlt", "TS_01.rawtlt", "--thickness", 24, "--epochs", 1,
                           "--coarse-epochs", 0, "--tv", 5, "--tv-penalty", "smooth", "--prior", "tv",
                           "-o", "out.mrc", *options, cwd=folder).stderr


def test_a_stack_that_was_phase_flipped_is_named():
    words = ["ctfPhaseFlip: CTF correction", "--defocus", 3]
    expect(said_of_label(*words), "ctfphaseflip", "--ctf-phase-flipped")
    assert "ctfphaseflip" not in said_of_label(*words, "--ctf-phase-flipped")


def test_a_stack_that_was_weighted_by_the_dose_is_named():
    expect(said_of_label("MTFFILTER: Dose weight filtered", "--dose-per-tilt", 3),
           "weighted by the dose already", "--dose-weighted")


def test_a_stack_that_was_divided_by_the_transfer_of_the_detector_is_named():
    folder = write_series("divided")
    write_titles(os.path.join(folder, "TS_01.mrc"), ["MTFFILTER: Filtered by inverse of MTF"])
    with open(os.path.join(folder, "camera.star"), "w", encoding="utf-8") as file:
        file.write("data_mtf\nloop_\n_rlnResolutionInversePixel #1\n_rlnMtfValue #2\n0 1\n0.5 0.2\n")
    expect(dry(folder, "TS_01.mrc", "--tlt", "TS_01.rawtlt", "--mtf", "camera.star"),
           "mtffilter", "divides by it again")
    assert "mtffilter" not in dry(folder, "TS_01.mrc", "--tlt", "TS_01.rawtlt")


def test_the_flag_of_imod_for_a_corrected_stack_counts_without_a_title():
    folder = write_series("flag")
    for flags, is_said in ((4 | 32, True), (4, False)):
        with open(os.path.join(folder, "TS_01.mrc"), "r+b") as file:
            file.seek(152)
            file.write(np.array([1146047817, flags], "<i4").tobytes())
        said = dry(folder, "TS_01.mrc", "--tlt", "TS_01.rawtlt", "--defocus", 3)
        assert ("ctfphaseflip" in said) == is_said, said


@pytest.mark.parametrize("unit, per_A", [(2, 1 / 2.54e8), (3, 1e-8), (4, None), (5, None), (1, None)])
def test_the_unit_of_a_tiff_resolution_is_known_or_the_size_is_not(unit, per_A, tmp_path):
    views = (1000 + 100 * bead_views(0, (56, 72))).astype(np.uint16)
    per_unit = round(1 / (3.5 * (per_A or 1e-8)), 3)
    tifffile.imwrite(tmp_path / "a.tif", views, photometric="minisblack", resolution=(per_unit, per_unit),
                     resolutionunit=unit)
    tilts = os.path.join(write_series("unit_of_tiff"), "TS_01.rawtlt")
    said = dry(str(tmp_path), "a.tif", "--tlt", tilts)
    stated_A = float(re.search(r"pixels, ([\d.]+) Å", said)[1])
    assert stated_A == pytest.approx(3.5 if per_A else 1, rel=0.01), said  # tifffile rounds
    assert ("--pixel-size" in said) == (per_A is None), said


def test_a_stack_that_newstack_aligned_is_not_aligned_again_in_silence():
    folder = write_series("twice")
    with open(os.path.join(folder, "TS_01.xf"), "w", encoding="utf-8") as file:
        file.write("1 0 0 1 0 0\n" * len(open(os.path.join(folder, "TS_01.rawtlt"), encoding="utf-8").readlines()))
    options = ["TS_01.mrc", "--tlt", "TS_01.rawtlt", "--xf", "TS_01.xf"]
    assert "aligns it again" not in dry(folder, *options)
    write_titles(os.path.join(folder, "TS_01.mrc"), ["NEWSTACK: Images copied, transformed"])
    expect(dry(folder, *options), "aligns it again", "TS_01.xf")
    assert "aligns it again" not in dry(folder, *options[:3])


@pytest.mark.parametrize("kind, low, high, said", [
    ("<i2", 0, 60000, "with sign (mode 1)"), ("<u2", -3000, 9000, "without a sign (mode 6)"),
    ("<i2", -3000, 9000, None), ("<u2", 0, 60000, None)])
def test_values_that_the_mode_cannot_hold_are_named(kind, low, high, said):
    folder = write_series("mode")
    path = os.path.join(folder, "TS_01.mrc")
    views = bead_views(0, (56, 72))
    with mrcfile.new(path, overwrite=True) as file:
        file.set_data((100 + 10 * views).astype(kind))
        file.voxel_size = 10
    with mrcfile.open(path, "r+") as file:
        file.header.dmin, file.header.dmax = low, high
    text = dry(folder, "TS_01.mrc", "--tlt", "TS_01.rawtlt")
    assert (said in text) if said else "16-bit numbers" not in text, text


def test_the_description_of_a_tiff_stack_states_its_axis(tmp_path):
    """SerialEM writes there what the labels of an MRC file have."""
    views = np.random.default_rng(1).normal(1000, 50, (11, 48, 48)).astype(np.uint16)
    with tifffile.TiffWriter(tmp_path / "s.tif") as file:
        for i, view in enumerate(views):
            file.write(view, photometric="minisblack", metadata=None, description=None if i else
                       "SerialEM: Digitized on Titan\n    Tilt axis angle = 86.1, binning = 1")
    np.savetxt(tmp_path / "s.tlt", np.linspace(-60, 60, 11))
    said = harness.tomofield("info", tmp_path / "s.tif", "--tlt", tmp_path / "s.tlt")
    assert said.returncode == 2 and "turned by 86.1" in said.stderr, said.stderr
    for first, others, part in (("400.0", "400.0", "axis of '400.0'"), ("0.5", "85.0", "85° on page 2")):
        with tifffile.TiffWriter(tmp_path / "s.tif") as file:
            for i, view in enumerate(views):
                file.write(view, photometric="minisblack", metadata=None,
                           description=f"SerialEM: x\n    Tilt axis angle = {others if i else first}, binning = 1")
        said = harness.succeed("info", tmp_path / "s.tif", "--tlt", tmp_path / "s.tlt")
        assert part in said.stderr, said.stderr


@pytest.mark.parametrize("with_commands", [False, True])
def test_what_lies_beside_a_dataset_of_etomo_counts_with_tilt_com_and_without(with_commands):
    folder = write_series("beside_edf", 0.0, stack="TS_01.st")
    write(folder, "TS_01.xf", transforms(0.0))
    shutil.copy(os.path.join(folder, "TS_01.rawtlt"), os.path.join(folder, "TS_01.tlt"))
    write(folder, "TS_01.edf", "Setup.DatasetName=TS_01\nSetup.AxisType=Single Axis\nSetup.PixelSize=0.5\n")
    write(folder, "TS_01.defocus", f"1 {len(TILTS)} 0 0 3000 2\n")
    write(folder, "ctfcorrection.com", "$ctfphaseflip -StandardInput\nVoltage 200\n")
    if with_commands:
        write(folder, "tilt.com", "$tilt -StandardInput\nInputProjections TS_01_ali.mrc\nIMAGEBINNED 1\n"
                                  "TILTFILE TS_01.tlt\nTHICKNESS 24\n")
    said = dry(folder, "TS_01.edf")
    expect(said, "--ctf TS_01.defocus", "--voltage 200 from", "states pixels of 5 Å")


def test_halves_that_their_mode_cannot_hold_are_named():
    folder = write_series("half_modes")
    views = 100 + 10 * bead_views(0, (56, 72))
    for name in ("TS_01.mrc", "even.mrc", "odd.mrc"):
        with mrcfile.new(os.path.join(folder, name), views.astype("<i2"), overwrite=True) as file:
            file.voxel_size = 10
            if name == "odd.mrc":
                file.header.dmin, file.header.dmax = 0, 60000
    said = harness.tomofield("reconstruct", "TS_01.mrc", "--tlt", "TS_01.rawtlt", "--even", "even.mrc", "--odd", "odd.mrc",
                             "--thickness", 24, "--contrast", "bright", "--no-margin", "--epochs", 1, "--coarse-epochs", 2,
                             "--tv", 5, "--prior", "tv", "--view-scale", "off", "-o", "o.mrc", cwd=folder)
    expect(said.stderr, "odd.mrc' has 16-bit numbers with sign", "misread")
    assert "even.mrc' has" not in said.stderr


def test_imagej_writes_numbers_with_a_sign_by_a_calibration(tmp_path):
    views = np.random.default_rng(1).normal(1000, 50, (11, 48, 48)).astype(np.int16)
    np.savetxt(tmp_path / "s.tlt", np.linspace(-60, 60, 11))
    def volume(stored, lines):
        with tifffile.TiffWriter(tmp_path / "s.tif") as file:
            for i, view in enumerate(stored):
                file.write(view, photometric="minisblack", metadata=None,
                           description=None if i else "ImageJ=1.53t\nimages=11\nslices=11\n" + lines)
        harness.succeed("baseline", "wbp", tmp_path / "s.tif", "--tlt", tmp_path / "s.tlt", "--thickness", 8,
                        "--contrast", "bright", "-o", tmp_path / "o.mrc", "--overwrite")
        return mrcfile.read(tmp_path / "o.mrc")
    plain = volume(views.astype(np.uint16), "")
    signed = volume((views.astype(np.int32) + 32768).astype(np.uint16), "cf=0\nc0=-32768.0\nc1=1.0\n")
    np.testing.assert_array_equal(plain, signed)
    assert not np.array_equal(plain, volume(views.astype(np.uint16), "cf=0\nc0=0\nc1=-1.0\n"))
    curve = harness.tomofield("info", tmp_path / "s.tif")
    assert curve.returncode == 0
    with tifffile.TiffWriter(tmp_path / "s.tif") as file:
        file.write(views[0], photometric="minisblack", metadata=None, description="ImageJ=1.53t\ncf=2\nc0=1\nc1=2\n")
    curve = harness.tomofield("info", tmp_path / "s.tif")
    assert curve.returncode == 2 and "no straight line" in curve.stderr, curve


def test_a_defocus_for_other_pixels_is_warned_of(tmp_path):
    views = np.random.default_rng(1).normal(1000, 50, (11, 48, 48)).astype(np.float32)
    harness.write_stack(tmp_path / "s.mrc", views, 5.0)
    np.savetxt(tmp_path / "s.tlt", np.linspace(-60, 60, 11))
    for pixel, is_said in ((5.0, False), (2.5, False), (3.11, True)):
        rows = "".join(f"{i + 1} 30000 29500 42 0 0.15 10\n" for i in range(11))
        (tmp_path / "c.txt").write_text(
            f"# Output from CTFFind version 4.1.14\n# Pixel size: {pixel} Angstroms ; acceleration voltage: 300.0 keV\n"
            f"# Columns: #1 - micrograph number; #2 - defocus 1 [Angstroms]\n{rows}", encoding="utf-8")
        said = harness.succeed("reconstruct", tmp_path / "s.mrc", "--tlt", tmp_path / "s.tlt", "--ctf", tmp_path / "c.txt",
                               "--thickness", 24, "--dry-run")
        assert ("defocus for pixels of 3.11" in said.stderr) == is_said, said.stderr
