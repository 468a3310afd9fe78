"""Tests compact models: `tomofield export --compact` and `reconstruct --budget`."""

import json
import os
import signal

import h5py
import mrcfile
import numpy as np
import pytest

import harness

SIZE, THICKNESS = 64, 38


@pytest.fixture(scope="module")
def folder():
    """Returns a folder with a series, and with fit.mrc and fit.h5 of a short fit to it."""
    folder = harness.fresh_directory("compact")
    series = os.path.join(folder, "series")
    harness.succeed("simulate", series, "--size", SIZE, "--thickness", THICKNESS, "--tilts", "-60:60:6")
    harness.succeed(*fit_arguments(folder), "-o", os.path.join(folder, "fit.mrc"))
    return folder


def fit_arguments(folder):
    series = os.path.join(folder, "series", "tilt_series")
    return ("reconstruct", series + ".mrc", "--tlt", series + ".tlt", "--thickness", THICKNESS,
            "--contrast", "bright", "--no-margin", "--tv-penalty", "concave", "--epochs", 1)


def refuse(*arguments, says):
    """Expects that the program ends with status 2 and this part of a sentence."""
    result = harness.tomofield(*arguments)
    assert result.returncode == 2, result.stderr
    assert says in result.stderr, result.stderr


def read(path):
    with mrcfile.open(path, permissive=True) as volume:
        return np.array(volume.data, float)


def change_of(folder, model, tmp_path):
    """Returns the rms difference between the volumes of a model and of the fit, over the standard
    deviation of the latter."""
    volume = tmp_path / "volume.mrc"
    harness.succeed("export", model, "-o", volume, "--overwrite")
    fit = read(os.path.join(folder, "fit.mrc"))
    return np.sqrt(np.mean((read(volume) - fit) ** 2)) / fit.std()


def test_a_budget_in_decibels_is_the_change_that_the_documents_state(folder, tmp_path):
    model = tmp_path / "compact.h5"
    harness.succeed("export", os.path.join(folder, "fit.h5"), "--compact", model, "--budget", "0.1dB")
    allowed = np.sqrt((10**0.01 - 1) * 0.3)
    assert 0.5 * allowed < change_of(folder, model, tmp_path) < 1.1 * allowed
    assert os.path.getsize(model) < os.path.getsize(os.path.join(folder, "fit.h5")) / 4


def test_a_budget_in_decibels_holds_against_the_truth(folder, tmp_path):
    truth = read(os.path.join(folder, "series", "truth.mrc"))
    best = harness.psnr(read(os.path.join(folder, "fit.mrc")), truth)
    half_float = 2 * truth.size  # bytes of a volume of mode 12
    for budget, times_smaller in ((0.1, 6), (1, 10)):
        model, volume = tmp_path / f"{budget}.h5", tmp_path / f"{budget}.mrc"
        harness.succeed("export", os.path.join(folder, "fit.h5"), "--compact", model, "--budget",
                        f"{budget}dB")
        harness.succeed("export", model, "-o", volume)
        assert 0 < best - harness.psnr(read(volume), truth) <= budget
        assert os.path.getsize(model) < half_float / times_smaller


def test_a_budget_in_bytes_is_kept(folder, tmp_path):
    changes = []
    for kilobytes in (30, 60):
        model = tmp_path / f"{kilobytes}.h5"
        harness.succeed("export", os.path.join(folder, "fit.h5"), "--compact", model, "--budget",
                        f"{kilobytes}kB")
        assert 700 * kilobytes < os.path.getsize(model) <= 1000 * kilobytes
        changes.append(change_of(folder, model, tmp_path))
    assert changes[0] > 1.3 * changes[1]
    refuse("export", os.path.join(folder, "fit.h5"), "--compact", tmp_path / "5.h5", "--budget", "5kB",
           says="whose tree and options alone take")
    # A fit of a run is kept if no model is within the budget.
    volume = tmp_path / "run.mrc"
    refuse(*fit_arguments(folder), "--budget", "5kB", "-o", volume, says="the finished fit is kept in")
    harness.succeed(*fit_arguments(folder), "--budget", "60kB", "-o", volume, "--resume")
    assert os.path.getsize(tmp_path / "run.h5") <= 60000


def test_a_run_ends_with_a_compact_model(folder, tmp_path):
    volume = tmp_path / "volume.mrc"
    harness.succeed(*fit_arguments(folder), "--budget", "0.1dB", "-o", volume)
    with open(tmp_path / "volume.json") as file:
        report = json.load(file)["metrics"]["compact"]
    assert 0 < report["decibels"] <= 0.1
    again = tmp_path / "again.mrc"
    harness.succeed("export", tmp_path / "volume.h5", "-o", again)
    assert np.array_equal(read(volume), read(again))
    same = tmp_path / "same.h5"  # the fit is the same as without a budget
    harness.succeed("export", os.path.join(folder, "fit.h5"), "--compact", same)
    harness.succeed("export", same, "-o", again, "--overwrite")
    assert np.array_equal(read(volume), read(again))


@pytest.fixture(scope="module")
def tall():
    """Returns the command of a short fit to a thin series of 128 rows, two bands of leaves."""
    folder = harness.fresh_directory("compact_tiles")
    series = os.path.join(folder, "series")
    harness.succeed("simulate", series, "--size", 128, "--thickness", 12, "--tilts", "-60:60:10")
    series = os.path.join(series, "tilt_series")
    return ("reconstruct", series + ".mrc", "--tlt", series + ".tlt", "--thickness", 12, "--contrast",
            "bright", "--no-margin", "--tv-penalty", "concave", "--epochs", 2, "--hold-out", 6,
            "--budget", "0.1dB")


def test_tiles_are_much_the_same_as_the_whole_region(tall, tmp_path):
    whole, tiles = tmp_path / "whole.mrc", tmp_path / "tiles.mrc"
    harness.succeed(*tall, "--tile-rows", 0, "-o", whole)
    harness.succeed(*tall, "--tile-rows", 64, "-o", tiles)
    change = np.sqrt(np.mean((read(whole) - read(tiles)) ** 2)) / read(whole).std()
    assert change < 0.15
    with open(tmp_path / "tiles.json") as file:
        metrics = json.load(file)["metrics"]
    assert [tile["rows"] for tile in metrics["tiles"]] == [[0, 64], [64, 128]]
    assert metrics["compact"]["bytes"] == sum(tile["bytes"] for tile in metrics["tiles"])
    assert all(tile["held_out_error"] > 0 for tile in metrics["tiles"])
    assert metrics["size_px"] == [128, 128, 12]
    again = tmp_path / "again.mrc"
    harness.succeed("export", tmp_path / "tiles.h5", "-o", again)
    assert np.array_equal(read(tiles), read(again))
    assert not (tmp_path / "tiles_tiles.h5").exists()


def test_tiles_go_on_after_a_stop(tall, tmp_path):
    tiles, stopped = tmp_path / "tiles.mrc", tmp_path / "stopped.mrc"
    harness.succeed(*tall, "--tile-rows", 64, "-o", tiles)
    run = harness.start(*tall, "--tile-rows", 64, "-o", stopped)
    for line in run.stderr:
        if line.startswith("rows 0 to 64:"):
            break
    run.send_signal(signal.SIGTERM)
    run.communicate()
    if run.returncode == 0:
        pytest.skip("the run ended before its signal")
    assert run.returncode == 143
    refuse(*tall[:-1], "1dB", "--tile-rows", 64, "-o", stopped, "--resume", says="give the same")
    refuse(*tall, "--tile-rows", 128, "-o", stopped, "--resume", says="with --tile-rows 64: give the same")
    said = harness.succeed(*tall, "--tile-rows", 64, "-o", stopped, "--resume").stderr
    assert "after row 64" in said
    assert np.array_equal(read(tiles), read(stopped))
    metrics = []  # of the middle tile, which the first session has finished
    for volume in (tiles, stopped):
        with open(volume.with_suffix(".json"), encoding="utf-8") as file:
            metrics.append(json.load(file)["metrics"])
    assert metrics[0]["example_tile"] == metrics[1]["example_tile"]
    assert metrics[0]["views"] == metrics[1]["views"]


def test_requests_that_tiles_cannot_meet_get_a_sentence(tall, tmp_path):
    volume = tmp_path / "volume.mrc"
    refuse(*tall[:-2], "--tile-rows", 64, "-o", volume, says="give --budget as well")
    refuse(*tall, "--tile-rows", 64, "--coarse-epochs", 0, "-o", volume, says="coarse stages")
    refuse(*tall, "--tile-rows", 64, "--defocus", 3, "-o", volume, says="across tiles")
    said = harness.succeed(*tall, "--tile-rows", 64, "-o", volume, "--dry-run").stdout
    assert "tiles: 2 of 64 rows" in said


def test_wrong_requests_get_a_sentence(folder, tmp_path):
    fit, compact = os.path.join(folder, "fit.h5"), tmp_path / "compact.h5"
    refuse("export", fit, "--compact", compact, "--budget", "3 apples", says="is no budget")
    assert not compact.exists()
    refuse("export", fit, "--compact", compact, "--budget", 50, says="give a larger budget")
    assert not compact.exists()
    harness.succeed("export", fit, "--compact", compact)
    refuse("export", compact, "--compact", tmp_path / "twice.h5", says="is compact already")
    factors = tmp_path / "factors.mrc"
    harness.succeed(*fit_arguments(folder), "--field", "vm", "--coarse-epochs", 1, "-o", factors)
    refuse("export", tmp_path / "factors.h5", "--compact", tmp_path / "twice.h5",
           says="model of factors")
    assert "default: 0.1dB" in harness.succeed("export", "--help").stdout
    refuse("export", fit, "--compact", compact, says="--overwrite")
    refuse(*fit_arguments(folder), "--field", "vm", "--budget", "1dB", "-o", tmp_path / "vm.mrc",
           says="give --field grid")
    volume = tmp_path / "volume.mrc"
    harness.succeed(*fit_arguments(folder), "--budget", "1dB", "-o", volume)
    refuse(*fit_arguments(folder), "--budget", "1dB", "-o", volume, "--resume",
           says="is no checkpoint")
    kept = tmp_path / "kept.mrc"
    refuse(*fit_arguments(folder), "--budget", 50, "-o", kept, says="the finished fit is kept in")
    harness.succeed(*fit_arguments(folder), "--budget", "1dB", "-o", kept, "--resume")
    assert np.ptp(harness.read_volume(kept)) > 0
    # It is refused before the alignment, which takes long.
    refuse(*fit_arguments(folder), "--align", "refine", "-o", volume, "--resume",
           says="it has no state of a fit, as no compact model has one")
    assert not (tmp_path / "volume_align.json").exists()


def test_plain_vertices_have_no_ranks(folder, tmp_path):
    assert "ranks" not in harness.succeed("info", os.path.join(folder, "fit.h5")).stdout
    compact = tmp_path / "compact.h5"
    harness.succeed("export", os.path.join(folder, "fit.h5"), "--compact", compact)
    assert "ranks" in harness.succeed("info", compact).stdout
    plan = (*fit_arguments(folder), "--dry-run", "-o", tmp_path / "plan.mrc")
    assert "--rank changes nothing" in harness.succeed(*plan, "--rank", 8).stderr
    assert "--rank" not in harness.succeed(*plan).stderr
    assert "--rank" not in harness.succeed(*plan, "--rank", 8, "--field", "vm").stderr


def test_a_damaged_code_gets_a_sentence(folder, tmp_path):
    compact = tmp_path / "compact.h5"
    harness.succeed("export", os.path.join(folder, "fit.h5"), "--compact", compact)
    with h5py.File(compact, "r+", libver="latest") as file:
        code = file["field/code/bytes"]
        code[200] ^= 0xFF
    refuse("export", compact, "-o", tmp_path / "volume.mrc", says="compact.h5")
    assert not (tmp_path / "volume.mrc").exists()
