"""Tests that a pattern that stays at one place of the detector is found and removed."""

import numpy as np

import harness

WIDTH, HEIGHT = 96, 72
TILTS = np.arange(-60, 61, 5.0)
QUICK = ["--thickness", 24, "--contrast", "bright", "--leaf-size", 16, "--field", "grid",
         "--epochs", 2, "--coarse-epochs", 10, "--tv-penalty", "smooth"]


def clean_views():
    """Returns views [tilt, y, x] of soft bodies in a slab that extends beyond the views."""
    return 100 + harness.views_of_bodies(TILTS, WIDTH, HEIGHT, [-130, -10, -10, 3],
                                         [130, HEIGHT + 10, 10, 7], 250)


def volume_of(name, views, *options):
    """Reconstructs and returns the results, what was removed, and the program's words."""
    run, results, metrics = harness.reconstruct_views(name, views, TILTS, *QUICK, *options)
    return results, metrics["mask"]["fixed_pattern"], run.stdout + run.stderr


def test_columns_are_removed_and_reported():
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


def test_nothing_changes_without_a_pattern():
    views = clean_views()
    looked_for, _, _ = volume_of("looked_for", views)
    not_looked_for, _, _ = volume_of("not_looked_for", views, "--no-fixed-pattern")
    np.testing.assert_array_equal(looked_for.volume, not_looked_for.volume)
