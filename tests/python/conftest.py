"""Makes a small series with its reconstruction by the program, and finds the module to test."""

import pathlib
import subprocess
import sys

import mrcfile
import numpy as np
import pytest


def pytest_configure(config):
    """Finds the module that was built beside the program."""
    sys.path.insert(0, str(config.getoption("--program").resolve().parent / "python"))


class Series:
    """Holds a simulated series in a folder: s.mrc, s.tlt, truth.mrc, and the program's tomogram."""

    def __init__(self, program: str, folder: pathlib.Path):
        self.program, self.folder = program, folder
        self.run("simulate", "cell", "--size", 32, "--thickness", 16, "--noise", 0.05, "--seed", 1)
        (folder / "cell" / "tilt_series.mrc").rename(folder / "s.mrc")
        (folder / "cell" / "tilt_series.tlt").rename(folder / "s.tlt")
        (folder / "cell" / "truth.mrc").rename(folder / "truth.mrc")
        self.run("reconstruct", "s.mrc", "--tlt", "s.tlt", "--thickness", 16, "--contrast",
                 "bright", "--no-margin", "-o", "tomogram.mrc")
        self.views = mrcfile.read(folder / "s.mrc")
        self.tilt_deg = np.loadtxt(folder / "s.tlt")
        self.tomogram = mrcfile.read(folder / "tomogram.mrc")
        self.truth = mrcfile.read(folder / "truth.mrc")

    def run(self, *arguments):
        subprocess.run([self.program, *map(str, arguments)], cwd=self.folder, check=True,
                       capture_output=True, text=True)


@pytest.fixture(scope="session")
def series(program, tmp_path_factory):
    return Series(program, tmp_path_factory.mktemp("series"))


@pytest.fixture
def quick():
    """Returns options of a fit that takes a moment."""
    return {"thickness": 16, "contrast": "bright", "pixel_size_A": 10.0, "leaf_size": 16, "rank": 4, "epochs": 3,
            "coarse_epochs": 0, "vertex_epochs": 0, "penalty": "concave",
            "fit_view_scale": False}
