"""Tests baseline tensorf: one leaf holds everything, and the fit is that of reconstruct."""

import json
import os

import numpy as np
import pytest

import harness
from harness import HEIGHT, THICKNESS, TILTS, WIDTH, psnr, read_bytes

QUICK = ["--thickness", THICKNESS, "--contrast", "bright", "--no-margin", "--rank", 10, "--epochs", 8,
         "--coarse-epochs", 12]


@pytest.fixture(scope="module")
def series():
    """Returns a small simulated series."""
    return harness.Series("series")


@pytest.fixture(scope="module", name="tensorf")
def make_tensorf(series):
    def tensorf(name, *options, source=series, run=harness.succeed):
        output = os.path.join(harness.fresh_directory(name), "out.mrc")
        result = run("baseline", "tensorf", *source.input, "-o", output, *harness.merge(QUICK, options))
        return harness.Results(output), result

    return tensorf


def record_of(results):
    with open(results.json_path, encoding="utf-8") as file:
        return json.load(file)


@pytest.fixture(scope="module")
def plain(tensorf):
    """Returns the results of QUICK options alone."""
    return tensorf("plain")[0]


def test_specimen_is_found(plain, series):
    flat = psnr(np.full_like(series.truth, series.truth.mean()), series.truth)
    gain = psnr(plain.volume, series.truth) - flat
    print(f"{gain:.2f} dB above a flat volume")
    assert plain.volume.shape == (THICKNESS, HEIGHT, WIDTH) and gain > 2.5, gain
    assert all(os.path.exists(path) for path in plain.all_paths)


def test_one_node_holds_everything(plain):
    record = record_of(plain)
    options = record["options"]
    assert options["field"]["leaf_size"] >= WIDTH and options["field"]["depth"] == 0
    assert options["fit"]["boundary"] == 0 and options["fit"]["penalty"] == "smooth"
    n, nz, rank = options["field"]["leaf_size"] + 1, THICKNESS, 10
    # The parameters are VX, VY, VZ, MYZ, MXZ and MXY; the decoder has a few more.
    count = rank * (2 * n + nz + n * n + 2 * n * nz)
    assert 0 <= record["metrics"]["parameters"] - count < 10, count


def test_variation_smooths_and_prior_takes_from_the_axes(plain, tensorf):
    def roughness(volume):
        return np.abs(np.diff(volume, axis=2)).mean()

    def axes(volume):
        spectrum = np.abs(np.fft.fft2(volume)) ** 2
        return (spectrum[:, 0, 2:-1].sum() + spectrum[:, 2:-1, 0].sum()) / spectrum[:, 1:, 1:].sum()

    without, _ = tensorf("without-tv", "--tv", 0)
    assert roughness(without.volume) > 1.1 * roughness(plain.volume)
    prior, _ = tensorf("ifp", "--ifp", 1000)
    assert axes(prior.volume) < 0.95 * axes(plain.volume)


def test_densities_are_not_negative_unless_allowed(series, tensorf):
    negative = series.with_views("negative", -series.views)
    kept, _ = tensorf("kept", source=negative)
    free, _ = tensorf("free", "--non-negative", "off", source=negative)
    assert kept.volume.min() >= 0 > free.volume.mean()


def test_held_out_views_are_scored(tensorf):
    results, run = tensorf("held-out", "--hold-out", 5)
    held_out = record_of(results)["metrics"]["held_out"]
    assert len(held_out["views"]) == len(TILTS) // 5 and "held out:" in run.stderr


def test_it_goes_on_where_it_was_stopped(plain, series):
    for _ in range(10):  # a run may be quicker than its signal
        output = os.path.join(harness.fresh_directory("resumed"), "out.mrc")
        command = ["baseline", "tensorf", *series.input, "-o", output, *QUICK, "--resume"]
        run, errors = harness.stop_after_first_step(command)
        if run.returncode != 0:
            break
    assert run.returncode == 143 and not os.path.exists(output), (run.returncode, errors)
    harness.succeed(*command)
    # The optimiser's moments are in the checkpoint.
    assert read_bytes(output) == read_bytes(plain.volume_path)


def test_dry_run_writes_nothing(tensorf):
    results, run = tensorf("dry", "--dry-run")
    assert "1 leaf," in run.stdout and "GiB" in run.stdout, run.stdout
    assert not os.path.exists(results.volume_path)


def test_mistakes_get_a_sentence(tensorf):
    for options, expected in ((["--rank", 0], "rank"), (["--tv", -1], "tv"), (["--ifp", "nan"], "ifp"),
                              (["--hold-out", 1], "hold-out"), (["--coarse-epochs", -1], "coarse-epochs"),
                              (["--roi", "0,0,4000,10"], "--roi"), (["--thickness", 0], "thickness")):
        results, run = tensorf("bad", *options, run=harness.tomofield)
        assert run.returncode == 2 and expected in run.stderr, (options, run.stderr)
        assert "internal" not in run.stderr and not os.path.exists(results.volume_path)
