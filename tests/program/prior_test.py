"""Tests --prior learned, which ends a fit with the network that simulated series taught."""

import os
import signal
import time

import h5py
import numpy as np
import pytest

import harness

SUBSETS = 7
FIT = ["--contrast", "bright", "--tv-penalty", "smooth", "--tv", 4, "--view-scale", "off",
       "--subsets", SUBSETS, "--epochs", 3, "--coarse-epochs", 20]
FIRST_LIGHT_STEP = 23 * SUBSETS
NUM_STEPS = (23 + 2 + 2) * SUBSETS


@pytest.fixture(scope="module")
def cell():
    """Returns the folder of a simulated cell."""
    folder = harness.fresh_directory("prior_cell")
    harness.succeed("simulate", folder, "--yardstick", "b", "--size", 64, "--thickness", 38, "--seed",
                    77, "--noise", 0.15, "--overwrite")
    return folder


@pytest.fixture(scope="module", name="command")
def make_command(cell):
    def command(results, *options):
        return ["reconstruct", os.path.join(cell, "tilt_series.mrc"), "--tlt",
                os.path.join(cell, "tilt_series.tlt"), "--thickness", 38, *FIT, "-o",
                results.volume_path, *options]

    return command


@pytest.fixture(scope="module")
def learned(command):
    results = harness.fresh_results("learned")
    harness.succeed(*command(results, "--prior", "learned"))
    return results


def psnr(volume, truth):
    """Returns the PSNR in dB after the best scale and offset."""
    volume, truth = volume - volume.mean(), truth - truth.mean()
    error = volume * np.sum(volume * truth) / np.sum(volume**2) - truth
    return 10 * np.log10(np.ptp(truth)**2 / np.mean(error**2))


def test_it_is_closer_to_the_truth_than_total_variation(cell, command, learned):
    smooth = harness.fresh_results("smooth")
    harness.succeed(*command(smooth, "--prior", "tv"))
    truth = harness.read_volume(os.path.join(cell, "truth.mrc"))
    low = [(there - here) // 2 for there, here in zip(truth.shape, smooth.volume.shape)]
    truth = truth[tuple(slice(i, i + n) for i, n in zip(low, smooth.volume.shape))]
    assert psnr(learned.volume, truth) > psnr(smooth.volume, truth) + 0.5


def test_the_number_of_threads_changes_no_bit(command, learned):
    one = harness.fresh_results("one_thread")
    harness.succeed(*command(one, "--prior", "learned", "--threads", 1))
    assert one.same_as(learned)


@pytest.mark.parametrize("moment", [FIRST_LIGHT_STEP, FIRST_LIGHT_STEP + 2 * SUBSETS + 1])
def test_a_run_that_was_killed_in_its_last_stages_goes_on_to_the_same_bits(command, learned, moment):
    for _ in range(10):
        results = harness.fresh_results("killed")
        run = harness.start(*command(results, "--prior", "learned", "--checkpoint-minutes", 0))
        while run.poll() is None and results.steps_done() < moment:
            time.sleep(0.001)
        run.kill()
        run.communicate()
        if run.returncode == -signal.SIGKILL and results.steps_done() < NUM_STEPS:
            break
    else:
        raise AssertionError("every run ended before it was killed")
    with h5py.File(results.model_path) as model:
        assert "prior_state" in model["training/floats"]
    harness.succeed(*command(results, "--prior", "learned", "--resume"))
    assert results.same_as(learned)


@pytest.mark.parametrize("options", [["--field", "vm"], ["--vertex-spacing", 2],
                                     ["--tree", "adaptive"], ["--budget", "1/8"]])
def test_fields_that_it_does_not_fit_are_refused(command, options):
    results = harness.fresh_results("refused")
    refused = harness.tomofield(*command(results, "--prior", "learned", *options))
    assert refused.returncode == 2 and "--prior learned" in refused.stderr, refused
    assert not os.path.exists(results.volume_path)
