"""A project of another program gives the same files from the command line, Python and C++."""

import json
import os
import shutil
import subprocess

import numpy as np
import pytest

import tomofield

ENTRIES = ["$tilt -StandardInput", "InputProjections TS_01_ali.mrc", "TILTFILE TS_01.tlt",
           "THICKNESS 16", "OFFSET 0.5", "FULLIMAGE 32 32"]
QUICK = {"contrast": "bright", "with_margin": False, "epochs": 2, "coarse_epochs": 4}


@pytest.fixture(scope="module")
def folder(series, tmp_path_factory):
    """Returns a folder as eTomo writes it."""
    path = tmp_path_factory.mktemp("etomo")
    shutil.copy(series.folder / "s.mrc", path / "TS_01.st")
    np.savetxt(path / "TS_01.tlt", series.tilt_deg, fmt="%.2f")
    (path / "TS_01.xf").write_text("1 0 0 1 0.5 -1\n" * len(series.tilt_deg))
    (path / "newst.com").write_text("$newstack -StandardInput\nInputFile TS_01.st\n"
                                    "OutputFile TS_01_ali.mrc\nTransformFile TS_01.xf\n")
    (path / "tilt.com").write_text("\n".join(ENTRIES) + "\n")
    return path


def without_times(path):
    """Returns the metrics without what differs from run to run."""
    volatile = ("seconds", "peak_GiB", "line", "threads", "fingerprint", "output")

    def strip(value):
        if isinstance(value, dict):
            return {k: strip(v) for k, v in value.items() if not k.startswith(volatile)}
        return [strip(v) for v in value] if isinstance(value, list) else value

    return strip(json.loads(path.read_text()))


def test_the_files_are_those_of_the_command_line(program, folder, tmp_path):
    subprocess.run([program, "reconstruct", folder, "--contrast", "bright", "--no-margin",
                    "--epochs", "2", "--coarse-epochs", "4", "-o", tmp_path / "cli.mrc"],
                   check=True, capture_output=True)
    tomofield.reconstruct(folder, output=tmp_path / "py.mrc", **QUICK)
    by_program = {path.name.removeprefix("cli") for path in tmp_path.glob("cli*")}
    assert by_program == {path.name.removeprefix("py") for path in tmp_path.glob("py*")}
    assert {".mrc", ".h5", ".json", "_report.html", "_xy.png", "_mask.png"} <= by_program
    for end in by_program:
        if end.endswith((".png", ".mrc")):
            assert (tmp_path / f"cli{end}").read_bytes() == (tmp_path / f"py{end}").read_bytes(), end
    assert without_times(tmp_path / "cli.json") == without_times(tmp_path / "py.json")
    for page in ("cli_report.html", "py_report.html"):
        assert "THICKNESS" in (tmp_path / page).read_text()


def test_a_project_says_what_its_files_set(folder):
    project = tomofield.open_project(folder)
    settings = {setting.option: setting for setting in project.settings}
    assert settings["--thickness"].value == "16"
    assert settings["--thickness"].file == folder / "tilt.com"
    assert settings["--thickness"].entry == "THICKNESS"
    assert project.thickness == 16 and project.tilt_offset_deg == 0.5
    assert project.stack == folder / "TS_01.st" and project.epochs is None
    with pytest.raises(AttributeError, match=r"epochz' \(did you mean epochs\?\)"):
        project.epochz
    project.thickness = 12  # goes over what the files say
    assert project.thickness == 12
    with pytest.raises(TypeError, match=r"no option 'thicknes' \(did you mean thickness\?\)"):
        project.thicknes = 12


def test_options_go_over_a_project(folder, tmp_path):
    tomofield.reconstruct(folder, output=tmp_path / "o.mrc", tilt_offset_deg=0.25, **QUICK)
    record = tomofield.read_record(tmp_path / "o.mrc")
    assert record.options["input"]["tilt_offset_deg"] == 0.25
    settings = {setting.option: setting for setting in record.settings}
    assert settings["--tilt-offset"].value == "0.5"
    assert settings["--tilt-offset"].instead == "--tilt-offset 0.25"
    assert settings["--thickness"].instead == ""
    report = (tmp_path / "o_report.html").read_text()
    assert f"given, in place of 0.5 ({folder / 'tilt.com'}: OFFSET)" in report


def test_a_stack_is_a_project_of_itself(series):
    project = tomofield.open_project(series.folder / "s.mrc")
    assert project.settings == [] and project.stack == series.folder / "s.mrc"


def star(path, name, columns, rows):
    """Writes a STAR file with one table."""
    head = "".join(f"_{column} #{i}\n" for i, column in enumerate(columns, 1))
    path.write_text(f"\ndata_{name}\n\nloop_\n{head}"
                    + "".join(" ".join(map(str, row)) + "\n" for row in rows) + "\n")


@pytest.fixture(scope="module")
def tomograms(series, tmp_path_factory):
    """Returns the tomograms.star of a RELION project with two series; the second is the first one
    moved by four pixels."""
    path = tmp_path_factory.mktemp("relion")
    shutil.copy(series.folder / "s.mrc", path / "s.mrcs")
    for name, shift_A in (("TS_01", 0), ("TS_02", 40)):
        star(path / f"{name}.star", name,
             ["rlnMicrographName", "rlnTomoXTilt", "rlnTomoYTilt", "rlnTomoZRot",
              "rlnTomoXShiftAngst", "rlnTomoYShiftAngst"],
             [[f"{i + 1:06d}@s.mrcs", 0, tilt, 0, 0, shift_A]
              for i, tilt in enumerate(series.tilt_deg)])
    star(path / "tomograms.star", "global",
         ["rlnTomoName", "rlnTomoTiltSeriesStarFile", "rlnTomoTiltSeriesPixelSize", "rlnTomoSizeX",
          "rlnTomoSizeY", "rlnTomoSizeZ"],
         [[name, f"{name}.star", 10.0, 32, 32, 16] for name in ("TS_01", "TS_02")])
    return path / "tomograms.star"


def likeness(one, other):
    return np.corrcoef(one.ravel(), other.ravel())[0, 1]


def test_one_of_several_series_is_named_in_every_function(tomograms, tmp_path):
    with pytest.raises(tomofield.Error, match="TS_01.*TS_02|--series"):
        tomofield.reconstruct(tomograms, **QUICK)
    project = tomofield.open_project(tomograms, series="TS_02")
    assert {s.row for s in project.settings if s.option == "stack"} == {"TS_02"}
    by_project = tomofield.reconstruct(project, **QUICK).tomogram
    by_name = tomofield.reconstruct(tomograms, series="TS_02", **QUICK).tomogram
    other = tomofield.reconstruct(tomograms, series="TS_01", **QUICK).tomogram
    np.testing.assert_array_equal(by_name.values, by_project.values)
    back = tomofield.baseline(tomograms, series="TS_02", contrast="bright", with_margin=False)
    first = tomofield.baseline(tomograms, series="TS_01", contrast="bright", with_margin=False)
    for moved, still in ((by_name, other), (back.tomogram, first.tomogram)):
        assert likeness(moved[:, 4:24], still[:, 8:28]) > 0.97 > likeness(moved[:], still[:])
    assert tomofield.align(tomograms, series="TS_01", output=tmp_path / "a.mrc", contrast="bright",
                           with_margin=False)
    assert (tmp_path / "a_align.xf").exists()


def test_a_project_shows_its_settings_and_its_warnings(folder, caplog):
    tilt_com = folder / "tilt.com"
    entries = tilt_com.read_text()
    try:
        tilt_com.write_text(entries + "SOMETHINGNEW 3\n")
        project = tomofield.open_project(folder)
    finally:
        tilt_com.write_text(entries)
    assert len(project.warnings) == 1 and "SOMETHINGNEW" in project.warnings[0]
    assert project.warnings[0] in [record.getMessage() for record in caplog.records]
    shown = project._repr_html_()
    assert "<td>--thickness</td><td>16</td>" in shown and "SOMETHINGNEW" in shown
    assert tomofield.open_project(folder).warnings == []


def test_projects_that_cannot_be_read_are_named(tmp_path):
    with pytest.raises(tomofield.Error, match="has no project"):
        tomofield.open_project(tmp_path)


def test_align_writes_the_alignment_alone(series, tmp_path):
    assert tomofield.align(series.folder / "s.mrc", tlt=series.folder / "s.tlt", thickness=16,
                           contrast="bright", with_margin=False, output=tmp_path / "a.mrc")
    names = {path.name for path in tmp_path.iterdir()}
    assert {"a_align.xf", "a_align.tlt", "a_align.json"} <= names and "a.mrc" not in names


def test_names_that_are_not_utf8_are_said(folder, tmp_path):
    """Folders of old systems have names in Latin-1, and sentences say them."""
    latin = os.path.join(os.fsencode(tmp_path), b"Z\xfcrich")
    shutil.copytree(os.fsencode(folder), latin)
    with open(os.path.join(latin, b"newst.com"), "ab") as file:
        file.write(b"NoSuchEntry 1\n")
    name = os.fsdecode(latin)
    project = tomofield.open_project(name)
    assert any("Z\\xfcrich" in warning and "NoSuchEntry" in warning for warning in project.warnings)
    transforms = [s.value for s in project.settings if s.option == "--xf"]
    assert transforms == [os.path.join(name, "TS_01.xf")] and os.path.exists(transforms[0])
    made = tomofield.reconstruct(name, **QUICK)
    assert json.loads(made.metrics) if isinstance(made.metrics, str) else made.metrics
    for refused in (lambda: tomofield.read_mrc(name + "/none.mrc"),
                    lambda: tomofield.open_project(name + "/none"),
                    lambda: tomofield.Model(name + "/none.h5"),
                    lambda: tomofield.reconstruct(name + "/TS_01.st", thickness=16)):
        with pytest.raises(tomofield.Error, match=r"Z\\xfcrich"):
            refused()
