"""Tests that every command works with files whose names are not UTF-8, and that the texts that it
writes are UTF-8 all the same."""

import glob
import json
import os

import h5py
import pytest

import harness
from harness import QUICK, THICKNESS

ODD = os.fsdecode(b"st\xffck")  # Python's form of a name with the byte 0xff
SHOWN = r"st\xffck"


def succeed(*arguments):
    return harness.succeed(*arguments, errors="surrogateescape")


@pytest.fixture(scope="module")
def series():
    """Returns a simulated series in a folder with such a name, and under such names."""
    source = harness.Series("series")
    folder = os.path.join(source.directory, ODD)
    os.mkdir(folder)
    named = [os.path.join(folder, ODD + suffix) for suffix in (".mrc", ".tlt")]
    os.rename(source.stack, named[0])
    os.rename(source.tlt, named[1])
    source.stack, source.tlt = named
    source.input = [source.stack, "--tlt", source.tlt]
    return source


@pytest.fixture(scope="module")
def volume(series):
    """Returns the path of a reconstruction with such a name."""
    path = os.path.join(harness.fresh_directory("fits"), ODD + ".mrc")
    said = succeed("reconstruct", *series.input, *QUICK, "-o", path)
    assert f"{SHOWN}.mrc" in said.stdout, said.stdout
    (said.stdout + said.stderr).encode()  # it is UTF-8
    return path


def read_json(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def test_reconstruct_and_info(series, volume):
    written = read_json(volume[:-4] + ".json")["options"]["input"]
    assert written["stack"].endswith(f"{SHOWN}/{SHOWN}.mrc")
    assert written["tlt"].endswith(f"{SHOWN}.tlt")
    with h5py.File(os.fsencode(volume[:-4] + ".h5")) as model:
        options = model.attrs["options_json"]
        text = options.decode() if isinstance(options, bytes) else options
        assert json.loads(text)["input"]["stack"] == written["stack"]
    assert len(glob.glob(glob.escape(volume[:-4]) + "_*.png")) == 4
    for file, ending in ((series.stack, ".mrc"), (volume[:-4] + ".h5", ".h5")):
        assert SHOWN + ending in succeed("info", file).stdout
    succeed("info", *series.input)


def test_warnings_and_errors_are_utf8(series):
    gone = harness.tomofield("info", ODD + ".mrc")  # the harness decodes UTF-8 alone
    assert gone.returncode == 2 and SHOWN + ".mrc" in gone.stderr, gone.stderr


def test_an_interrupted_run_goes_on(series, volume):
    path = os.path.join(harness.fresh_directory("resumed"), ODD + ".mrc")
    command = ["reconstruct", *series.input, *QUICK, "-o", path, "--checkpoint-minutes", 0]
    run, errors = harness.stop_after_first_step(command)
    assert run.returncode in (0, 143), errors
    succeed(*command, "--resume")
    assert harness.read_bytes(path) == harness.read_bytes(volume)


def test_baseline_export_and_evaluate(series, volume):
    folder = harness.fresh_directory("others")
    other = os.path.join(folder, ODD + ".mrc")
    succeed("baseline", "sirt", *series.input, "--thickness", THICKNESS, "--contrast", "bright",
            "--no-margin", "-o", other)
    assert read_json(other[:-4] + ".json")["options"]["input"]["stack"].endswith(SHOWN + ".mrc")
    exported = os.path.join(folder, "box" + ODD + ".mrc")
    succeed("export", volume[:-4] + ".h5", "-o", exported)
    assert harness.read_bytes(exported)[1024:] == harness.read_bytes(volume)[1024:]
    scores = os.path.join(folder, ODD + "_scores.json")
    succeed("evaluate", other, volume, "--fsc", volume, "--series", *series.input, "--contrast",
            "bright", "--no-margin", "--json", scores)
    metrics = read_json(scores)
    for name in (metrics["reconstruction"], metrics["truth"], metrics["fsc"]["second"],
                 metrics["reprojection"]["series"]):
        assert name.endswith(SHOWN + ".mrc"), name


def test_simulate(scratch):
    folder = os.path.join(scratch, ODD)
    succeed("simulate", folder, "--size", 24, "--thickness", 16, "--tilts=-40:40:20")
    read_json(os.path.join(folder, "phantom.json"))


def test_compare_goes_on_and_reports(series, scratch):
    folder = os.path.join(scratch, ODD)
    mask = os.path.join(scratch, ODD + "_mask.mrc")
    harness.write_stack(mask, series.views.astype("f4") * 0 + 1)
    command = ["compare", *series.input, "--mask", mask, "--thickness", THICKNESS, "--contrast",
               "bright", "--no-margin", "--methods", "wbp,sirt", "-o", folder]
    succeed(*command)
    again = succeed(*command)
    assert again.stderr.count("already done") == 2, again.stderr
    comparison = read_json(os.path.join(folder, "comparison.json"))
    assert comparison["series"].endswith(SHOWN + ".mrc")
    assert comparison["methods"][0]["volume"].endswith(f"{SHOWN}/wbp.mrc")
    with open(os.path.join(folder, "report.html"), encoding="utf-8") as page:
        assert f"{SHOWN}.mrc" in page.read()
