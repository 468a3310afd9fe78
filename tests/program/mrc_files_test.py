"""Tests `tomofield info` on MRC files that mrcfile wrote, and on damaged ones."""

import os

import mrcfile
import numpy as np
import pytest

import harness

MODES = {0: ("i1", "8-bit"), 1: ("i2", "16-bit integers"), 2: ("f4", "32-bit floats"),
         6: ("u2", "unsigned"), 12: ("f2", "16-bit floats")}


@pytest.fixture(autouse=True)
def in_scratch(scratch, monkeypatch):
    """Runs every test in its own folder, with a stack and its tilts."""
    monkeypatch.chdir(scratch)
    write_stack("f2")
    write("good.tlt", b"-30\n0\n30.5\n")


def write(name, contents):
    with open(name, "wb") as file:
        file.write(contents)


def write_stack(dtype):
    values = np.random.default_rng(1).integers(0, 100, (3, 20, 30))
    with mrcfile.new("stack.mrc", overwrite=True) as file:
        file.set_data(values.astype(dtype))
        file.set_image_stack()
        file.voxel_size = 13.25
        file.add_label("a label of this test")


def info(*arguments):
    return harness.tomofield("info", *arguments)


def expect_refusal(parts, *arguments):
    result = info(*arguments)
    assert result.returncode == 2, (arguments, result)
    for part in parts:
        assert part in result.stderr, (part, result.stderr)


@pytest.mark.parametrize("mode", MODES)
def test_stacks_of_every_mode_are_described(mode):
    dtype, name = MODES[mode]
    write_stack(dtype)
    result = info("stack.mrc")
    assert result.returncode == 0, result.stderr
    for part in ("image stack", "30 × 20 × 3", name, "13.25", "a label of this test"):
        assert part in result.stdout, (part, result.stdout)


def test_a_tilt_series_has_a_line_for_each_view():
    result = info("stack.mrc", "--tlt", "good.tlt", "--exclude", "2")
    assert result.returncode == 0, result.stderr
    assert "2 views" in result.stdout and "30.50" in result.stdout, result.stdout


def test_series_that_do_not_fit_are_refused():
    write("short.tlt", b"-30\n0\n")
    expect_refusal(["short.tlt", "2 angles", "stack.mrc", "3 sections"], "stack.mrc", "--tlt",
                   "short.tlt")
    write("steep.tlt", b"-30\n0\n81\n")
    expect_refusal(["steep.tlt", "line 3", "81"], "stack.mrc", "--tlt", "steep.tlt")
    expect_refusal(["absent.tlt"], "stack.mrc", "--tlt", "absent.tlt")
    expect_refusal(["--log"], "stack.mrc", "--tlt", "good.tlt", "--contrast", "bright", "--log")
    assert info("stack.mrc", "--contrast", "grey").returncode == 2


def test_damaged_and_foreign_files_are_refused():
    whole = harness.read_bytes("stack.mrc")
    write("torn.mrc", whole[:2000])
    expect_refusal(["torn.mrc", str(len(whole)), "2000"], "torn.mrc")
    write("empty.mrc", b"")
    expect_refusal(["empty.mrc", "0 bytes"], "empty.mrc")
    write("text.mrc", b"no MRC file at all " * 100)
    expect_refusal(["text.mrc"], "text.mrc")
    write("model.h5", b"\x89HDF\r\n\x1a\n" + bytes(2000))
    expect_refusal(["model.h5"], "model.h5")
    expect_refusal(["absent.mrc"], "absent.mrc")
    expect_refusal([os.getcwd()], os.getcwd())
