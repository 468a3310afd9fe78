"""Tests compact models: `tomofield export --compact` and `reconstruct --budget`."""

import json
import os

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


def test_a_budget_in_bytes_is_kept(folder, tmp_path):
    changes = []
    for kilobytes in (10, 40):
        model = tmp_path / f"{kilobytes}.h5"
        harness.succeed("export", os.path.join(folder, "fit.h5"), "--compact", model, "--budget",
                        f"{kilobytes}kB")
        assert os.path.getsize(model) < 1000 * kilobytes + 20000  # the tree and the options
        changes.append(change_of(folder, model, tmp_path))
    assert changes[0] > 1.3 * changes[1]


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


def test_wrong_requests_get_a_sentence(folder, tmp_path):
    fit, compact = os.path.join(folder, "fit.h5"), tmp_path / "compact.h5"
    refuse("export", fit, "--compact", compact, "--budget", "3 apples", says="is no budget")
    assert not compact.exists()
    harness.succeed("export", fit, "--compact", compact)
    refuse("export", compact, "--compact", tmp_path / "twice.h5", says="model of factors")
    refuse("export", fit, "--compact", compact, says="--overwrite")
    refuse(*fit_arguments(folder), "--field", "vm", "--budget", "1dB", "-o", tmp_path / "vm.mrc",
           says="give --field grid")
    volume = tmp_path / "volume.mrc"
    harness.succeed(*fit_arguments(folder), "--budget", "1dB", "-o", volume)
    refuse(*fit_arguments(folder), "--budget", "1dB", "-o", volume, "--resume",
           says="is no checkpoint")


def test_a_damaged_code_gets_a_sentence(folder, tmp_path):
    compact = tmp_path / "compact.h5"
    harness.succeed("export", os.path.join(folder, "fit.h5"), "--compact", compact)
    with h5py.File(compact, "r+", libver="latest") as file:
        code = file["field/code/bytes"]
        code[200] ^= 0xFF
    refuse("export", compact, "-o", tmp_path / "volume.mrc", says="compact.h5")
    assert not (tmp_path / "volume.mrc").exists()
