"""Runs the cases of other labs' files in the shared folder (data/cases): each README there says what
is expected. Tests that make their own files of the same kinds are in lab_files_test.py."""

import json
import os
import shutil

import numpy as np
import pytest

import harness


@pytest.fixture
def case(shared_data, scratch, monkeypatch):
    """Returns a function that copies a case and makes it the current folder."""
    def enter(name):
        source = shared_data / "cases" / name
        if not source.is_dir():
            pytest.skip(f"there is no case {source}")
        folder = scratch / name
        shutil.copytree(source, folder)
        monkeypatch.chdir(folder)
        return folder
    return enter


def output_of(*arguments, status=0):
    """Runs the program in the current folder and returns what it printed, errors last."""
    result = harness.tomofield(*arguments)
    assert result.returncode == status, (arguments, result.returncode, result.stderr)
    return result.stdout + result.stderr


def expect(text, *parts):
    for part in parts:
        assert part in text, (part, text)


def dry(*arguments, status=0):
    return output_of("reconstruct", *arguments, "-o", "o.mrc", "--dry-run", status=status)


def sections_of(text):
    """Returns the sections of the table that info prints, with their tilts."""
    rows = [line.split() for line in text.splitlines()]
    return {int(row[0]): float(row[1]) for row in rows if len(row) == 4 and row[0].isdigit()}


def test_aln_value_out_of_range(case):
    case("aln_value_out_of_range")
    expect(output_of("info", "s.aln", status=2), "TILT", "1567301525373690323140608.00")
    np.savetxt("s.tlt", np.arange(-60, 61, 6), fmt="%d")
    expect(output_of("info", "s.aln", "--tlt", "s.tlt"), "21 views")


def test_angles_of_two_sources_disagree(case):
    case("angles_of_two_sources_disagree")
    for words in (["TS_01.st", "--tlt", "sorted.rawtlt", "--thickness", 24], ["TS_01.aln"]):
        expect(dry(*words), "warning: the tilt angles of", "20 of 21 sections", "common offset")


def test_aretomo3_ctf_with_dark_frames(case):
    case("aretomo3_ctf_with_dark_frames")
    expect(dry("TS_01.aln", "--ctf", "TS_01_CTF.txt"), "28 of 31 sections",
           "the defocus of each view from 'TS_01_CTF.txt'")


def test_aretomo3_dark_section_zero_with_offset(case):
    case("aretomo3_dark_section_zero_with_offset")
    found = sections_of(output_of("info", "TS_01.aln"))
    assert sorted(found) == [s for s in range(1, 32) if s not in (3, 6, 21)]


def test_batch_halves(case):
    """Options of halves hold on the command line of batch."""
    case("batch_halves")
    frames = ["--even", "{folder}/{name}_EVN.mrc", "--odd", "{folder}/{name}_ODD.mrc"]
    for options in (frames, [*frames, "--denoising-halves"], ["--split-tilts"]):
        expect(output_of("batch", "*.aln", *options, "-o", "res", "--dry-run"),
               "2 of 2 series to reconstruct")


def test_black_half_stack(case):
    case("black_half_stack")
    expect(output_of("reconstruct", "ALL.mrc", "--even", "EVN.mrc", "--odd", "ODD.mrc", "--tlt",
                     "s.tlt", "--thickness", 24, "--epochs", 1, "--coarse-epochs", 4, "-o", "o.mrc",
                     status=2), "'ODD.mrc'", "constant")
    assert not os.path.exists("o.mrc")


def test_edf_as_project(case):
    case("edf_as_project")
    for path in ("TS_01.edf", "."):
        expect(output_of("info", path), "Setup.DatasetName", "21 views of 48 × 48")


def test_equal_tilts(case):
    case("equal_tilts")
    expect(dry("s.mrc", "--tlt", "zeros.tlt", "--thickness", 24, status=2), "all 21 sections", "0°")


def test_etomo_newst_without_size(case):
    case("etomo_newst_without_size")
    assert "--center" not in output_of("info", "tilt.com")
    output_of("baseline", "wbp", "tilt.com", "--bead-diameter", 0, "-o", "o.mrc")
    volume = harness.read_volume("o.mrc")
    beads = [(12, 6, 5), (-14, 8, -6), (3, -15, 6), (-7, -10, -3)]
    assert np.max(harness.distances_of_beads(-volume, beads)) < 0.5


def test_fei_extended_headers(case):
    case("fei_extended_headers")
    for name in ("fei1.mrc", "fei_old.mrc", "agard.mrc"):
        printed = dry(name, "--thickness", 24)
        expect(printed, "11 of 11 sections, tilts -60.0° to 60.0°", "pixels of 3.5 Å")
        assert "1 Å is assumed" not in printed


def test_hdf_stack(case):
    case("hdf_stack")
    expect(output_of("info", "s.hdf", status=2), "HDF5 file", "no model of tomofield",
           "newstack -format MRC", "e2proc2d.py")


def test_mdoc_axis_align_full(case):
    case("mdoc_axis_align_full")
    output_of("align", "TS_01.mrc.mdoc", "--align", "full", "--thickness", 24, "-o", "o.mrc")
    rows = np.loadtxt("o_align.xf")
    axis = np.degrees(np.arctan2(rows[:, 1] - rows[:, 2], rows[:, 0] + rows[:, 3]))
    assert np.abs(axis - 86.2).max() < 5


def test_mdoc_incomplete_prior_dose(case):
    case("mdoc_incomplete_prior_dose")
    words = ["--defocus", 3, "--thickness", 24, "--bead-diameter", 0, "--epochs", 1,
             "--coarse-epochs", 2]
    printed = output_of("reconstruct", "TS_01.mrc", "--mdoc", "some.mdoc", *words, "-o", "o.mrc")
    expect(printed, "warning: 'some.mdoc': PriorRecordDose is missing in sections 1, 4, 7, 10")
    assert "dose: from" not in printed
    output_of("reconstruct", "TS_01.mrc", "--mdoc", "number.mdoc", *words, "-o", "number.mrc")
    assert not np.array_equal(harness.read_volume("o.mrc"), harness.read_volume("number.mrc"))


def test_mdoc_names_of_averages(case):
    case("mdoc_names_of_averages")
    for folder in ("case", "relion"):
        expect(dry(folder, "--mdoc", "P_1.mdoc", "--thickness", 24), "11 of 11 sections")


def test_mdoc_voltage_200(case):
    case("mdoc_voltage_200")
    words = ["TS_01.mrc.mdoc", "--ctf", "TS_01_CTF.txt", "--thickness", 24, "--epochs", 1,
             "--coarse-epochs", 2]
    expect(output_of("reconstruct", *words, "-o", "stated.mrc"),
           "--voltage 200 from TS_01.mrc.mdoc: Voltage")
    for voltage in (200, 300):
        output_of("reconstruct", *words, "--voltage", voltage, "-o", f"{voltage}.mrc")
    stated, low, high = (harness.read_volume(f"{name}.mrc") for name in ("stated", 200, 300))
    assert np.array_equal(stated, low) and not np.array_equal(stated, high)


def test_moved_folder_absolute_tlt(case):
    case("moved_folder_absolute_tlt")
    expect(output_of("info", "tilt.com"), "--tlt g5a.tlt", "--xtilt g5a.xtilt", "15 views")


def test_newst_default_lists(case):
    folder = case("newst_default_lists")
    text = (folder / "newst.com").read_text()
    for size in (",,", "56,/", "/", ",56"):
        (folder / "newst.com").write_text(text.replace(",,", size))
        expect(output_of("info", "tilt.com"), "15 views of 56 × 56")
    tilt = (folder / "tilt.com").read_text()
    (folder / "tilt.com").write_text(tilt.replace("FULLIMAGE 56 56", "FULLIMAGE"))
    expect(output_of("info", "tilt.com"), "15 views of 56 × 56")


def test_one_fault_at_a_time(case):
    case("one_fault_at_a_time")
    expect(dry("s.mrc", "--tlt", "s.tlt", "--thickness", 24, status=2), "--exclude 1,16")


def test_own_output_as_input(case):
    case("own_output_as_input")
    words = ["reconstruct", "TS_01.mdoc", "--thickness", 24, "--epochs", 1, "--coarse-epochs", 2, "-o",
             "TS_01.mrc"]
    output_of(*words)
    expect(output_of("info", "TS_01.mdoc"), "stack TS_01.st from", "21 views")
    output_of(*words, "--overwrite")


def test_relion4_or_warp_tomograms_star(case):
    case("relion4_or_warp_tomograms_star")
    expect(output_of("info", "tomograms.star", status=2), "rlnTomoProjX", "RELION 4", "Warp",
           ".tomostar", "--xf")


def test_relion_other_series_missing(case):
    case("relion_other_series_missing")
    output_of("reconstruct", "tomograms.star", "--series", "TS_02", "--epochs", 1, "--coarse-epochs", 2,
              "-o", "o.mrc")
    with open("o.json", encoding="utf-8") as file:
        assert json.load(file)["origins"]
    with open("o.star", encoding="utf-8") as file:
        rows = [line.split() for line in file if line.startswith("TS_")]
    assert [row[0] for row in rows] == ["TS_02"]


def test_tomo5_mdoc_axis(case):
    case("tomo5_mdoc_axis")
    words = ["Position_1.mdoc", "--thickness", 24]
    expect(dry(*words, status=2), "86.2°", "Position_1.mrc", "--align full")
    expect(dry(*words, "--align", "full"), "tilt axis of the views: 86.2° from 'Position_1.mdoc'")
