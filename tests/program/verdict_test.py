"""Tests the verdict of reconstruct: every misuse of a small series has its warning, in the log and
in the JSON, and right input has none."""

import json
import os

import numpy as np
import pytest

import harness

THICKNESS = 38
QUICK = ["--field", "vm", "--epochs", 12, "--vertex-epochs", 0, "--coarse-epochs", 8, "--rank", 8,
         "--tv-penalty", "concave"]


def simulate(name, *options):
    """Returns the folder of a simulated series of 64 × 64 pixels."""
    directory = os.path.join(harness.fresh_directory(name), "cell")
    harness.succeed("simulate", directory, "--size", 64, "--no-truth", *options)
    return directory


@pytest.fixture(scope="module", name="cell")
def make_cell():
    """A cell that ends in the field of view, with noise."""
    return simulate("cell", "--yardstick", "a", "--noise", 0.1, "--seed", 4)


@pytest.fixture(scope="module", name="slab")
def make_slab():
    """An extended specimen, dark and with much noise, whose views are shifted."""
    return simulate("slab", "--yardstick", "b", "--noise", 0.2, "--contrast", "dark", "--misalign", 2,
                    "--seed", 5)


def reconstruct(series, *options):
    """Returns the verdict of the JSON and the run with its log."""
    output = os.path.join(harness.fresh_directory("run"), "out.mrc")
    defaults = ["--tlt", f"{series}/tilt_series.tlt", "--thickness", THICKNESS, *QUICK]
    result = harness.succeed("reconstruct", f"{series}/tilt_series.mrc", "-o", output,
                             *harness.merge(defaults, options))
    with open(output.replace(".mrc", ".json"), encoding="utf-8") as file:
        return json.load(file)["metrics"]["verdict"], result


CELL = ["--contrast", "bright", "--no-margin"]
SLAB = ["--contrast", "dark"]


def check_codes(verdict, result, *codes):
    """Checks the warnings of a run, with which its log ends."""
    assert [warning["code"] for warning in verdict["warnings"]] == list(codes), verdict
    messages = [f"warning: {warning['message']}" for warning in verdict["warnings"]]
    lines = result.stderr.splitlines()
    assert lines[len(lines) - len(messages):] == messages, result.stderr
    assert lines[len(lines) - len(messages) - 1].startswith("verdict: residual"), result.stderr


def test_right_input_has_no_warning(cell, slab):
    verdict, result = reconstruct(cell, *CELL, "--hold-out", 8)
    check_codes(verdict, result)
    errors = verdict["held_out"]
    assert 0.8 < errors["median"] <= errors["worst"] < 2 and not errors["of_trials"], errors
    along_x, along_y = verdict["views"]["residual_correlation"]
    assert abs(along_x) < 0.2 and abs(along_y) < 0.2  # white noise
    expected = (f"residual {verdict['residual']:.2f} of the noise's variance; correlation of "
                f"neighbours {along_x:.2f}, {along_y:.2f}; held out: median "
                f"{errors['median']:.2f}, worst {errors['worst']:.2f} "
                f"(at {errors['worst_tilt_deg']:.1f}°); speckle {100 * verdict['speckle']:.3f} %; "
                f"faces {verdict['face_jump']['both']:.2f}; {verdict['seconds']:.1f} s, ")
    assert expected in result.stderr, (expected, result.stderr)
    assert 0 < verdict["peak_GiB"] < 8
    check_codes(*reconstruct(slab, *SLAB, "--xf", f"{slab}/tilt_series.xf"))


def test_wrong_contrast(cell, slab):
    check_codes(*reconstruct(cell, *harness.merge(CELL, ["--contrast", "dark"])), "contrast")
    xf = ["--xf", f"{slab}/tilt_series.xf"]
    verdict, result = reconstruct(slab, *xf, "--contrast", "bright")
    check_codes(verdict, result, "contrast")
    assert "give --contrast dark" in result.stderr


def test_shuffled_angles(cell):
    tilts = np.random.default_rng(3).permutation(np.loadtxt(f"{cell}/tilt_series.tlt"))
    np.savetxt(f"{cell}/shuffled.tlt", tilts, fmt="%.1f")
    check_codes(*reconstruct(cell, *CELL, "--tlt", f"{cell}/shuffled.tlt"), "tilt-order")


def test_alignment_that_is_missing_or_applied_twice_or_of_another_stack(cell, slab):
    check_codes(*reconstruct(slab, *SLAB), "unaligned")
    xf = np.loadtxt(f"{slab}/tilt_series.xf")
    other = np.column_stack([xf[:, :4], 0.5 * xf[::-1, 4:]])
    np.savetxt(f"{slab}/other.xf", other, fmt="%.4f")
    check_codes(*reconstruct(slab, *SLAB, "--xf", f"{slab}/other.xf"), "misaligned")
    np.savetxt(f"{cell}/of_cell.xf", np.resize(xf, (94, 6)), fmt="%.4f")
    check_codes(*reconstruct(cell, *CELL, "--xf", f"{cell}/of_cell.xf"), "aligned-twice")


def test_thickness_that_is_too_small_or_too_large(cell):
    verdict, result = reconstruct(cell, *CELL, "--thickness", THICKNESS // 2)
    check_codes(verdict, result, "thin")
    verdict, result = reconstruct(cell, *CELL, "--thickness", 2 * THICKNESS)
    check_codes(verdict, result, "thick")
    suggested = int(verdict["warnings"][0]["message"].split("--thickness ")[1].split()[0])
    assert THICKNESS <= suggested <= 1.3 * THICKNESS, verdict["warnings"]


def test_an_axis_that_is_not_vertical(cell):
    angle = np.radians(40)
    row = [np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle), 0, 0]
    np.savetxt(f"{cell}/turned.xf", np.tile(row, (94, 1)), fmt="%.6f")
    verdict, result = reconstruct(cell, *CELL, "--xf", f"{cell}/turned.xf")
    check_codes(verdict, result, "tilt-axis")
    assert abs(verdict["views"]["axis"]["direction_deg"] - 40) <= 6, verdict["views"]["axis"]


def test_views_without_the_specimen(cell):
    dark = os.path.join(harness.fresh_directory("dark"), "tilt_series.mrc")
    views = harness.read_volume(f"{cell}/tilt_series.mrc").copy()
    noise = np.random.default_rng(9).normal(0, 1, views[::2].shape)
    views[::2] = views.min() + noise * np.std(np.diff(views[:, :, :4], axis=2)) / np.sqrt(2)
    harness.write_stack(dark, views.astype(np.float32))
    output = dark.replace("tilt_series", "out")
    result = harness.succeed("reconstruct", dark, "--tlt", f"{cell}/tilt_series.tlt", "--thickness",
                             THICKNESS, *QUICK, *CELL, "-o", output)
    with open(output.replace(".mrc", ".json"), encoding="utf-8") as file:
        verdict = json.load(file)["metrics"]["verdict"]
    check_codes(verdict, result, "views")
