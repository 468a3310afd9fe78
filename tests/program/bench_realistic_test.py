"""Tests bench/realistic: its deconvolution filter, and a whole run of a small series."""

import json
import os
import subprocess
import sys

import mrcfile
import numpy as np
import pytest

import harness

BENCH = os.path.abspath(os.path.join(os.path.dirname(__file__), "../../bench"))
sys.path.insert(0, BENCH)

import wiener_deconvolution  # pylint: disable=wrong-import-position


def test_deconvolution_takes_back_the_transfer_where_there_is_signal_and_stops_noise():
    frequency = np.linspace(0, 0.05, 500)
    transfer = wiener_deconvolution.transfer(frequency, 30000)
    gain = wiener_deconvolution.gain(frequency, 10.0, 30000)
    assert abs(transfer[0] - 0.07) < 1e-9 and gain[0] == 0
    strong = (frequency > 0.012) & (frequency < 0.02)
    np.testing.assert_allclose((gain * transfer)[strong], 1, atol=0.12)
    assert abs(gain * transfer)[frequency > 0.045].max() < 0.3
    assert (gain * transfer >= -1e-12).all()


def test_a_small_series_is_reconstructed_scored_and_drawn():
    pytest.importorskip("PIL", reason="bench/realistic draws sections")
    folder = harness.fresh_directory("realistic")
    command = ["/usr/bin/python3", os.path.join(BENCH, "realistic"), folder, "--program",
               harness.PROGRAM, "--size", "64", "--seeds", "4", "--doses", "3", "--only", "^wbp"]
    first = subprocess.run(command, capture_output=True, text=True, check=True)
    series = os.path.join(folder, "seed4_dose3")
    figures = json.load(open(os.path.join(series, "wbp_run.json")))
    assert 5 < figures["psnr"] < 40 and 0 < figures["dice"] < 1
    assert 0.2 < figures["fsc_100"] < 1
    rows = [line for line in first.stdout.splitlines() if line.startswith("| wbp")]
    assert len(rows) == 2 and "wbp-deconvolved" in rows[1], first.stdout
    deconvolved = mrcfile.read(os.path.join(series, "wbp-deconvolved.mrc"))
    assert deconvolved.shape == mrcfile.read(os.path.join(series, "truth.mrc")).shape
    assert os.path.getsize(os.path.join(folder, "sections_dose3.png")) > 10000
    again = subprocess.run([*command, "--table"], capture_output=True, text=True, check=True)
    assert again.stdout == first.stdout
