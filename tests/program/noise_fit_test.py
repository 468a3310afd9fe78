"""Tests that views and pixels that no volume explains count less."""

import numpy as np

import harness

TILTS = np.arange(-60, 61, 5.0)
QUICK = ["--thickness", 32, "--contrast", "bright", "--leaf-size", 16, "--epochs", 10,
         "--coarse-epochs", 10, "--tv-penalty", "smooth", "--tv", 5, "--no-margin", "--bead-diameter", 0]


def clean_views():
    """Returns views [tilt, y, x] of soft bodies that none of them cuts off across the axis."""
    return harness.views_of_bodies(TILTS, 96, 48, [-30, -10, -6, 2], [30, 58, 6, 4], 80)


def fitted(name, views, *options):
    """Returns the volume of some views and the weight of each view."""
    _, results, metrics = harness.reconstruct_views(name, views, TILTS, *QUICK, *options)
    return results.volume, np.array([view["weight"] for view in metrics["views"]])


def relative_error(volume, reference):
    """Returns the error of a volume after the best scale and offset."""
    slope, offset = np.polyfit(volume.ravel(), reference.ravel(), 1)
    return np.std(slope * volume + offset - reference) / np.std(reference)


def test_hot_pixels_that_come_and_go_do_less_harm():
    views = clean_views()
    hit = np.random.default_rng(2).random(views.shape) < 0.003
    clean, _ = fitted("clean", views)
    spoilt = views + 15 * hit
    limited, _ = fitted("limited", spoilt)
    followed, weights = fitted("followed", spoilt, "--no-noise-fit")
    assert relative_error(limited, clean) < 0.8 * relative_error(followed, clean)
    np.testing.assert_allclose(weights, 1, rtol=1e-6)


def test_a_view_that_no_volume_explains_counts_less():
    views = clean_views()
    clean, weights = fitted("as_it_is", views)
    assert weights.min() > 0.6 and abs(weights.mean() - 1) < 0.02, weights
    spoilt = views.copy()
    spoilt[8] = np.roll(views[8], (9, 13), axis=(0, 1))
    weighted, weights = fitted("weighted", spoilt)
    assert weights.argmin() == 8 and weights[8] < 0.5, weights
    alike, _ = fitted("alike", spoilt, "--no-noise-fit")
    assert relative_error(weighted, clean) < 0.95 * relative_error(alike, clean)
