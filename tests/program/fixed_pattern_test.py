"""Tests that a pattern that stays at one place of the detector is found and removed."""

import json
import os

import numpy as np
import pytest

import harness

WIDTH, HEIGHT = 96, 72
TILTS = np.arange(-60, 61, 5.0)
QUICK = ["--thickness", 24, "--contrast", "bright", "--leaf-size", 16, "--field", "grid",
         "--epochs", 2, "--coarse-epochs", 10, "--tv-penalty", "smooth"]


def clean_views():
    """Returns views [tilt, y, x] of soft bodies in a slab that extends beyond the views."""
    random = np.random.default_rng(1)
    bodies = random.uniform([-130, -10, -10, 3], [130, HEIGHT + 10, 10, 7], size=(250, 4))
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    views = []
    for tilt in np.radians(TILTS):
        view = random.normal(size=x.shape)
        for body_x, body_y, body_z, radius in bodies:
            at = WIDTH / 2 + body_x * np.cos(tilt) + body_z * np.sin(tilt)
            view += 3 * np.exp(-((x - at) ** 2 + (y - body_y) ** 2) / (2 * radius**2))
        views.append(100 + view)
    return np.array(views)


@pytest.fixture(scope="module", name="volume_of")
def make_volume_of():
    directory = harness.fresh_directory("fixed_pattern")
    tlt = os.path.join(directory, "a.tlt")
    np.savetxt(tlt, TILTS, fmt="%.1f")

    def volume_of(name, views, *options):
        """Reconstructs and returns the results, what was removed, and the program's words."""
        stack = os.path.join(directory, name + ".st")
        harness.write_stack(stack, views.astype(np.float32))
        output = os.path.join(harness.fresh_directory(name), "out.mrc")
        run = harness.succeed("reconstruct", stack, "--tlt", tlt, "-o", output, *QUICK, *options)
        results = harness.Results(output)
        pattern = json.load(open(results.json_path))["metrics"]["mask"]["fixed_pattern"]
        return results, pattern, run.stdout + run.stderr

    return volume_of


def test_columns_are_removed_and_reported(volume_of):
    views = clean_views()
    pattern = np.random.default_rng(2).normal(size=WIDTH)
    clean, nothing, _ = volume_of("clean", views)
    removed, found, said = volume_of("removed", views + pattern)
    left, kept, _ = volume_of("left", views + pattern, "--no-fixed-pattern")
    assert nothing == kept == {"column_deviation": 0, "row_deviation": 0, "pixels": 0}
    np.testing.assert_allclose(found["column_deviation"], pattern.std(), rtol=0.15)
    assert "fixed pattern" in said
    error = {name: np.sqrt(np.mean((results.volume - clean.volume) ** 2))
             for name, results in [("removed", removed), ("left", left)]}
    assert error["removed"] < 0.5 * error["left"], error


def test_nothing_changes_without_a_pattern(volume_of):
    views = clean_views()
    looked_for, _, _ = volume_of("looked_for", views)
    not_looked_for, _, _ = volume_of("not_looked_for", views, "--no-fixed-pattern")
    np.testing.assert_array_equal(looked_for.volume, not_looked_for.volume)
