"""Tests that what alignment programs put outside rotated images is masked, whatever it is."""

import json
import os

import numpy as np
import pytest
import scipy.ndimage

import harness

WIDTH, HEIGHT = 200, 168
TILTS = np.arange(-40, 41, 20.0)
ROTATION = 4.0
OFFSETS = (12, 13, 12, 13)  # left, right, bottom, top


def depth():
    """Returns how far each pixel [y, x] lies within the rotated image."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    angle = np.radians(ROTATION)
    u = (x - WIDTH / 2) * np.cos(angle) + (y - HEIGHT / 2) * np.sin(angle)
    v = -(x - WIDTH / 2) * np.sin(angle) + (y - HEIGHT / 2) * np.cos(angle)
    left, right, bottom, top = OFFSETS
    return np.minimum.reduce([u + WIDTH / 2 - left, WIDTH / 2 - right - u,
                              v + HEIGHT / 2 - bottom, HEIGHT / 2 - top - v])


def images():
    """Returns views of random structure and noise that cover everything."""
    random = np.random.default_rng(3)
    views = []
    for _ in TILTS:
        structure = scipy.ndimage.gaussian_filter(random.normal(size=(HEIGHT, WIDTH)), 3)
        views.append(100 + structure / structure.std()
                     + 0.5 * random.normal(size=structure.shape))
    return np.array(views)


def random_fill(view):
    """Replaces the outside by pixels of the image, drawn at random."""
    random, outside = np.random.default_rng(4), depth() < 0
    return np.where(outside, random.choice(view[~outside], size=view.shape), view)


def dithered_fill(view):
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    return np.where(depth() < 0, view.mean() + 0.1 * ((x + 2 * y) % 4 - 1.5), view)


def tapered_fill(view):
    """Fades the image to a constant over 8 pixels within its edge."""
    part = np.clip(depth() / 8, 0, 1)
    return view.mean() + part * (view - view.mean())


# The last number is the width of the border that is no good image either.
@pytest.mark.parametrize("fill,border", [(random_fill, 0), (dithered_fill, 0), (tapered_fill, 7)])
def test_what_lies_outside_is_masked(fill, border):
    directory = harness.fresh_directory(fill.__name__)
    stack, tlt = os.path.join(directory, "a.ali"), os.path.join(directory, "a.tlt")
    harness.write_stack(stack, np.array([fill(view) for view in images()], dtype=np.float32))
    np.savetxt(tlt, TILTS, fmt="%.1f")
    output = os.path.join(directory, "out.mrc")
    harness.succeed("reconstruct", stack, "--tlt", tlt, "-o", output, "--contrast", "dark",
                    "--thickness", 16, "--field", "grid", "--epochs", 1, "--coarse-epochs", 0,
                    "--tv-penalty", "smooth", "--bead-diameter", 0)
    mask = json.load(open(harness.Results(output).json_path))["metrics"]["mask"]
    for view in mask["views"]:
        assert np.mean(depth() < 0.95 * border) - 0.01 < view["masked_part"] \
            < np.mean(depth() < border + 5) + 0.02, view


def test_images_without_fill_stay_whole():
    directory = harness.fresh_directory("whole")
    stack, tlt = os.path.join(directory, "a.ali"), os.path.join(directory, "a.tlt")
    harness.write_stack(stack, images().astype(np.float32))
    np.savetxt(tlt, TILTS, fmt="%.1f")
    said = harness.succeed("reconstruct", stack, "--tlt", tlt, "-o",
                           os.path.join(directory, "out.mrc"), "--thickness", 16, "--field", "grid",
                           "--epochs", 1, "--coarse-epochs", 0, "--tv-penalty", "smooth",
                           "--bead-diameter", 0)
    assert "masked: 0.0 %" in said.stdout + said.stderr
