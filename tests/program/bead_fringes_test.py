"""Compares a series of gold beads with a contrast transfer to the same specimen without them."""

import json
import os

import harness
import numpy as np

SIZE, THICKNESS, DIAMETER = 96, 40, 10  # pixels of 5 Å
FIT = ["--epochs", 6, "--coarse-epochs", 40, "--tv-penalty", "smooth", "--tv", 5]
SERIES = ["--yardstick", "c", "--contrast", "dark", "--size", SIZE, "--thickness", THICKNESS,
          "--voxel-size", 5, "--defocus", 4, "--gold", 2, "--gold-diameter", 5 * DIAMETER, "--noise", 0.2,
          "--gain", 0, "--seed", 33]


def simulate(name, density):
    folder = os.path.join(harness.fresh_directory(name), "series")
    harness.succeed("simulate", folder, *SERIES, "--gold-density", density)
    return folder


def beads_of(folder):
    with open(os.path.join(folder, "phantom.json"), encoding="utf-8") as file:
        return np.array([bead["center_px"] for bead in json.load(file)["gold_beads"]])


def write_mask(folder):
    """Writes a mask that hides what a search for beads hides, and returns its path."""
    tilts = np.radians(np.loadtxt(os.path.join(folder, "tilt_series.tlt")))
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5 - SIZE / 2
    counts = np.ones((len(tilts), SIZE, SIZE), np.float32)
    for view, tilt in zip(counts, tilts):
        for bead in beads_of(folder):
            place = bead[0] * np.cos(tilt) + bead[2] * np.sin(tilt)
            view[np.hypot(x - place, y - bead[1]) <= 1.2 * DIAMETER] = 0
    path = os.path.join(folder, "mask.mrc")
    harness.write_stack(path, counts, pixel_size=5)
    return path


def errors_of(folder, *options):
    """Returns the root mean square errors beside the beads, at 0.8 to 2 diameters, and elsewhere."""
    def path(name):
        return os.path.join(folder, name)
    harness.succeed("reconstruct", path("tilt_series.mrc"), "--tlt", path("tilt_series.tlt"),
                    "--thickness", THICKNESS, "--contrast", "dark", "--invert", "--ctf",
                    path("tilt_series_ctf.txt"), "-o", path("tomogram.mrc"), *FIT, *options)
    found, truth = (harness.read_volume(path(name)).astype(float) for name in ("tomogram.mrc", "truth.mrc"))
    z, y, x = np.ogrid[tuple(slice(n) for n in found.shape)]
    middle = [x + 0.5 - SIZE / 2, y + 0.5 - SIZE / 2, z + 0.5 - THICKNESS / 2]
    distance = np.sqrt(np.min([sum((place - at) ** 2 for place, at in zip(middle, bead))
                               for bead in beads_of(folder)], axis=0)) / DIAMETER
    far = distance > 2
    scale, offset = np.polyfit(found[far], truth[far], 1)
    squares = (scale * found + offset - truth) ** 2
    return np.sqrt(squares[(distance > 0.8) & ~far].mean()), np.sqrt(squares[far].mean())


def test_fringes_of_beads_go_with_them():
    """Without fringes, less of the views must be masked than a search for beads hides: the tomogram is
    better than that of the specimen without beads whose views are masked as widely."""
    bare = simulate("without_beads", 0)
    near_bare, far_bare = errors_of(bare, "--bead-diameter", 0, "--mask", write_mask(bare))
    near, far = errors_of(simulate("with_beads", 5), "--bead-diameter", 5)
    assert near < 0.96 * near_bare, (near, near_bare)
    assert far < far_bare, (far, far_bare)
