"""Compares reconstructions of views that are resampled, with and without a contrast transfer, to those
of the same specimen in views that need no resampling."""

import json
import os

import harness
import numpy as np
import pytest

SIZE, THICKNESS = 64, 38
FIT = ["--epochs", 6, "--coarse-epochs", 60, "--tv-penalty", "smooth", "--tv", 5, "--view-scale", "on",
       "--bead-diameter", 0]
MISALIGNED = ["--misalign", 2, "--misalign-rotation", 0.5, "--misalign-magnification", 0.3]


def simulate(name, options):
    folder = os.path.join(harness.fresh_directory(name), "cell")
    # Its gains make views differ in brightness by far more than their contrast.
    harness.succeed("simulate", folder, "--size", SIZE, "--thickness", THICKNESS, "--yardstick", "c",
                    "--contrast", "dark", "--noise", 0.3, "--seed", 31, "--voxel-size", 10, "--gold", 0,
                    *options)
    return folder


class Scores:
    """Reconstructs a series and reads what came out. The PSNR is that at the best scale and offset, in
    dB, of the voxels that no border spoils."""

    def __init__(self, folder, *options):
        def path(name):
            return os.path.join(folder, name)
        files = ["--xf", path("tilt_series.xf")] if os.path.exists(path("tilt_series.xf")) else []
        harness.succeed("reconstruct", path("tilt_series.mrc"), "--tlt", path("tilt_series.tlt"),
                        *files, "--thickness", THICKNESS, "--contrast", "dark", "--overwrite",
                        "-o", path("tomogram.mrc"), *FIT, *options)
        with open(path("tomogram.json"), encoding="utf-8") as file:
            verdict = json.load(file)["metrics"]["verdict"]
        self.residual = verdict["residual"]
        self.neighbours = max(map(abs, verdict["views"]["residual_correlation"]))
        found = harness.read_volume(path("tomogram.mrc"))[4:-4, 8:-8, 8:-8].ravel().astype(float)
        truth = harness.read_volume(path("truth.mrc"))[4:-4, 8:-8, 8:-8].ravel().astype(float)
        scale, offset = np.polyfit(found, truth, 1)
        self.psnr = 10 * np.log10(np.ptp(truth) ** 2 / np.mean((scale * found + offset - truth) ** 2))


@pytest.mark.parametrize("imaging", [[], ["--defocus", 3]], ids=["projections", "ctf"])
def test_an_alignment_that_is_applied_costs_nothing(imaging):
    def scores(name, options):
        folder = simulate(f"resampled_{name}_{len(imaging)}", [*imaging, *options])
        transfer = ["--ctf", os.path.join(folder, "tilt_series_ctf.txt")] if imaging else []
        return Scores(folder, *transfer)
    aligned, misaligned = scores("aligned", []), scores("misaligned", MISALIGNED)
    # Views differ in brightness. A density cannot explain that once a contrast transfer is applied.
    assert aligned.residual < 1.2, aligned.__dict__
    assert abs(misaligned.residual / aligned.residual - 1) < 0.05, (misaligned.__dict__, aligned.__dict__)
    assert misaligned.psnr > aligned.psnr - 0.3, (misaligned.__dict__, aligned.__dict__)
    assert misaligned.neighbours < aligned.neighbours + 0.05, (misaligned.__dict__, aligned.__dict__)
