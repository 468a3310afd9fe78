"""Tests bench/wide: its analytic truth, and a whole run of a small series."""

import os
import re
import subprocess
import sys

import mrcfile
import numpy as np
import pytest

import harness

BENCH = os.path.abspath(os.path.join(os.path.dirname(__file__), "../../bench"))
sys.path.insert(0, BENCH)

import phantom_truth  # pylint: disable=wrong-import-position


def test_boxes_of_the_truth_are_those_of_the_simulated_one():
    folder = harness.fresh_directory("truth")
    harness.succeed("simulate", os.path.join(folder, "s"), "--yardstick", "b", "--size", 64,
                "--thickness", 40, "--seed", 3)
    whole = mrcfile.read(os.path.join(folder, "s", "truth.mrc"))
    truth = phantom_truth.PhantomTruth(os.path.join(folder, "s", "phantom.json"), whole.shape)
    np.testing.assert_allclose(truth.box((5, 10, 20), (35, 60, 64)), whole[5:35, 10:60, 20:64],
                               atol=1e-6)


def test_a_small_series_is_reconstructed_and_scored_again():
    pytest.importorskip("matplotlib", reason="bench/wide draws sections")
    folder = harness.fresh_directory("wide")
    command = ["/usr/bin/python3", os.path.join(BENCH, "wide"), folder, "--program",
               harness.PROGRAM, "--quick"]
    first = subprocess.run(command, capture_output=True, text=True, check=True)
    decibels = [float(found) for found in re.findall(r"^\| [^|]+ \| ([\d.]+) \|", first.stdout, re.M)]
    assert len(decibels) == 9 and min(decibels) > 12, first.stdout
    assert os.path.getsize(os.path.join(folder, "sections.png")) > 10000
    again = subprocess.run([*command, "--table"], capture_output=True, text=True, check=True)
    assert again.stdout == first.stdout
