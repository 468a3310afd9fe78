"""Tests bench/alignment_score.py on alignments with known errors, and bench/alignment."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

import harness

BENCH = os.path.abspath(os.path.join(os.path.dirname(__file__), "../../bench"))
sys.path.insert(0, BENCH)

import alignment_rows  # pylint: disable=wrong-import-position
import alignment_score  # pylint: disable=wrong-import-position
from alignment_score import Alignment  # pylint: disable=wrong-import-position

SIZE = 100
TILTS = np.arange(-60.0, 61.0, 3.0)
COS, SIN = np.cos(np.radians(TILTS)), np.sin(np.radians(TILTS))


def lines(rotation_deg, scale, x, y):
    """Returns lines of an .xf file of q = scale R(rotation) p + (x, y)."""
    rotation = np.radians(rotation_deg) + 0 * TILTS
    c, s = scale * np.cos(rotation), scale * np.sin(rotation)
    return np.stack(np.broadcast_arrays(c, -s, s, c, x, y), axis=1)


@pytest.fixture(name="truth")
def make_truth():
    random = np.random.default_rng(4)
    draw = lambda: random.normal(size=len(TILTS))
    return Alignment(lines(draw(), np.exp(0.01 * draw()), 5 * draw(), 5 * draw()), TILTS)


def moved(alignment, rotation_deg=0.0, scale=1.0, x=0.0, y=0.0):
    """Returns the alignment to views that are turned about their centre, scaled and then shifted."""
    step = lines(rotation_deg, scale, x, y)
    matrices = step[:, :4].reshape(-1, 2, 2)
    shifts = np.einsum("vij,vj->vi", matrices, alignment.shifts) + step[:, 4:]
    return Alignment(np.hstack([(matrices @ alignment.matrices).reshape(-1, 4), shifts]),
                     alignment.tilts_deg, alignment.local)


def test_what_moves_the_specimen_costs_nothing(truth):
    gauge = moved(truth, scale=1.003, x=4.5 * COS - 7.1 * SIN, y=2.2)
    gauge.tilts_deg = TILTS + 1.7
    figures = alignment_score.score(truth, gauge, SIZE)
    assert abs(figures.pop("tilt_offset_deg") - 1.7) < 1e-9
    assert all(abs(value) < 1e-6 for value in figures.values()), figures
    assert "local_px" not in figures


def test_an_estimate_is_moved_to_where_the_truth_has_the_specimen(truth):
    gauge = moved(truth, scale=1.003, x=4.5 * COS - 7.1 * SIN, y=2.2)
    gauge.tilts_deg = TILTS + 1.7
    back = alignment_score.in_frame_of(truth, gauge, SIZE)
    assert np.allclose(back.transforms(), truth.transforms(), atol=1e-9)
    assert np.allclose(back.tilts_deg, TILTS, atol=1e-9)
    # Whatever is no motion of the specimen stays.
    wrong = moved(gauge, rotation_deg=0.3 * np.sin(TILTS), x=np.cos(7 * TILTS))
    before, after = (alignment_score.score(truth, estimate, SIZE)
                     for estimate in (wrong, alignment_score.in_frame_of(truth, wrong, SIZE)))
    assert before["x_px"] > 0.3 and before["rotation_deg"] > 0.1
    for name in ("x_px", "y_px", "rotation_deg", "magnification"):
        assert abs(before[name] - after[name]) < 0.004 * before["x_px"], name


def test_known_errors_are_returned(truth):
    # These are orthogonal to what is removed.
    x = np.where(np.arange(len(TILTS)) % 2 == 0, 1.0, -1.0)
    x = x - np.column_stack([COS, SIN]) @ np.linalg.lstsq(np.column_stack([COS, SIN]), x, rcond=None)[0]
    y = np.sin(np.arange(len(TILTS)))
    y -= y.mean()
    turns = y / y.std()
    estimate = moved(truth, 0.3 + 0.04 * turns, np.exp(0.002 * turns), 0.25 * x + 3 * COS, 0.5 * y + 9)
    estimate.tilts_deg = TILTS + 0.6 + 0.1 * turns
    figures = alignment_score.score(truth, estimate, SIZE)
    expected = {"x_px": 0.25 * np.sqrt(np.mean(x**2)), "y_px": 0.5 * y.std(),
                "rotation_deg": np.hypot(0.3, 0.04), "magnification": 0.002, "axis_error_deg": 0.3,
                "tilt_offset_deg": 0.6, "tilt_deg": 0.1}
    assert figures.keys() == expected.keys()
    for name, value in expected.items():
        assert abs(figures[name] - value) < 1e-6, (name, figures[name], value)


def test_local_motion_is_compared_without_its_affine_part(truth):
    line = np.linspace(-50, 50, 5)
    x, y = np.meshgrid(line, line)
    ripple = np.stack([np.sin(x / 11 + y / 7), np.cos(x / 9)], axis=2)
    truth.local = [ripple * (-1)**view for view in range(len(TILTS))]
    missing = Alignment(np.hstack([truth.matrices.reshape(-1, 4), truth.shifts]), TILTS)
    without = alignment_score.score(truth, missing, SIZE)
    assert 0.3 < without["local_px"] < 1.5
    assert without["local_less_specimen_warp_px"] > 0.95 * without["local_px"]

    missing.local = truth.local
    assert max(map(abs, alignment_score.score(truth, missing, SIZE).values())) < 1e-9

    affine = np.stack([0.5 + 0.02 * x - 0.01 * y, 0.3 * np.ones_like(x) + 0.04 * x], axis=2)
    missing.local = [motion + affine * (view % 3) for view, motion in enumerate(truth.local)]
    figures = alignment_score.score(truth, missing, SIZE)
    assert figures["local_px"] < 1e-6 and figures["y_px"] > 0.1 and figures["rotation_deg"] > 0.1


def test_a_fixed_warp_of_the_specimen_is_told_apart(truth):
    # Points of the specimen at X, Y are moved along Y and Z. 33 nodes a side show it at x = X cos.
    x, y = np.meshgrid(np.linspace(-50, 50, 33), np.linspace(-50, 50, 33))
    estimate = Alignment(np.hstack([truth.matrices.reshape(-1, 4), truth.shifts]), TILTS, [])
    for c, s in zip(COS, SIN):
        wave = np.sin(np.clip(x / c, -50, 50) / 31 + y / 23) * np.cos(y / 40)
        estimate.local.append(np.stack([0.8 * s * wave, 0.6 * wave], axis=2))
    figures = alignment_score.score(truth, estimate, SIZE)
    assert figures["local_px"] > 0.1
    assert figures["local_less_specimen_warp_px"] < 0.1 * figures["local_px"], figures


def test_the_script_scores_a_simulated_series():
    folder = harness.fresh_directory("scored")
    harness.succeed("simulate", folder, "--size", 32, "--thickness", 12, "--tilts=-60:60:10",
                    "--misalign", 2, "--misalign-rotation", 1, "--misalign-local", 1, "--no-truth")
    script = ["/usr/bin/python3", os.path.join(BENCH, "alignment_score.py"), folder]

    def score(*arguments):
        done = subprocess.run([*script, *arguments], capture_output=True, text=True, check=True)
        return json.loads(done.stdout)

    xf, record = os.path.join(folder, "tilt_series.xf"), os.path.join(folder, "phantom.json")
    assert max(map(abs, score(xf, "--local", record).values())) < 1e-9
    without = score(xf)
    assert without["x_px"] < 0.005 and without["y_px"] < 0.005
    assert 0.5 < without["local_px"] < 1.1
    unaligned = os.path.join(folder, "unaligned.xf")
    np.savetxt(unaligned, np.tile([1, 0, 0, 1, 0, 0], (13, 1)))
    found = score(unaligned)
    assert found["x_px"] > 0.5 and found["rotation_deg"] > 0.3

    np.savetxt(unaligned, np.tile([1, 0, 0, 1, 0, 0], (12, 1)))
    short = subprocess.run([*script, unaligned], capture_output=True, text=True, check=False)
    assert short.returncode == 1 and "13 views" in short.stderr and "12 transforms" in short.stderr


def test_views_that_were_left_out_stay_out(truth):
    prefix = os.path.join(harness.fresh_directory("estimate"), "tomogram_align")
    gauge = moved(truth, x=4.5 * COS, y=2.2)
    lines = gauge.transforms()
    lines[[3, 17]] = [1, 0, 0, 1, 500, -500]  # of views that nothing is known of
    np.savetxt(f"{prefix}.xf", lines)
    np.savetxt(f"{prefix}.tlt", TILTS)
    with open(f"{prefix}.json", "w", encoding="utf-8") as file:
        json.dump({"views": [{"left_out": view in (3, 17)} for view in range(len(TILTS))]}, file)
    estimate, kept = alignment_rows.read_estimate(prefix)
    exclude = alignment_rows.write_in_frame(truth, estimate, kept, SIZE, f"{prefix}_moved")
    assert exclude == ["--exclude", "4,18"]
    written = np.loadtxt(f"{prefix}_moved.xf")
    assert np.allclose(written[kept], truth.transforms()[kept], atol=1e-6)


def test_rows_are_measured_once_and_shown():
    folder = harness.fresh_directory("rows")

    def bench(*arguments):
        done = subprocess.run(["/usr/bin/python3", os.path.join(BENCH, "alignment"), folder,
                               "--program", harness.PROGRAM, "--quick", *arguments],
                              capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done

    assert "nothing was measured yet" in bench("--table").stdout
    chosen = ("--only", "^(A 3 px refine|B warp)")
    done = bench(*chosen)
    lines = done.stdout.splitlines()
    for name in ("A 3 px refine", "B warp 2 px refine"):
        assert any(line.startswith(f"| {name} | ") for line in lines), done.stdout
    assert len({line.count("|") for line in lines if line.startswith("|")}) == 1, done.stdout
    again = bench(*chosen)
    assert again.stdout == done.stdout and again.stderr == ""
    assert bench("--table").stdout == done.stdout

    with open(os.path.join(folder, "alignment/A_3_px_refine_64_101.json"), encoding="utf-8") as file:
        row = json.load(file)
    for name in ("x_px", "y_px"):
        assert row["start"][name] > 2 and row["found"][name] < 0.5, row
    assert abs(row["found"]["loss_dB"]) < 1 and row["psnr_true_dB"] > 15, row
