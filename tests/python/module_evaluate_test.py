"""Scores in Python are those of `tomofield evaluate`."""

import json

import numpy as np
import pytest

import tomofield


def test_scores_are_those_of_the_program(series):
    series.run("evaluate", "tomogram.mrc", "truth.mrc", "--json", "score.json")
    written = json.loads((series.folder / "score.json").read_text())
    scores = tomofield.score_volume(series.tomogram, series.truth)
    for name in ("psnr_raw_dB", "psnr_affine_dB", "ssim_raw", "ssim_affine", "scale", "offset",
                 "correlation", "peak"):
        assert getattr(scores, name) == pytest.approx(find(written, name), rel=1e-12)


def find(tree, name):
    """The value of this name anywhere in a JSON document."""
    if name in tree:
        return tree[name]
    found = [find(branch, name) for branch in tree.values() if isinstance(branch, dict)]
    return next((value for value in found if value is not None), None)


def test_shells_correlate(series):
    same = tomofield.correlate_shells(series.truth, series.truth, voxel_size_A=10.0)
    np.testing.assert_allclose(same.correlation, 1.0, atol=1e-6)
    assert same.frequency_per_A[-1] == pytest.approx(1 / 20)
    assert same.resolution_A() is None
    noise = np.random.default_rng(1).normal(scale=0.3, size=series.truth.shape)
    noisy = tomofield.correlate_shells(series.truth + noise.astype(np.float32), series.truth,
                                       voxel_size_A=10.0)
    assert 20 < noisy.resolution_A(threshold=0.5) < 320


def test_volumes_of_different_voxel_sizes_are_refused(series):
    fine, coarse = (tomofield.Tomogram(series.truth, size) for size in (10.0, 20.0))
    for function in (tomofield.score_volume, tomofield.correlate_shells):
        with pytest.raises(tomofield.Error, match="10 Å .* of 20 Å: bring them to one voxel size"):
            function(fine, coarse)
    assert tomofield.score_volume(fine, series.truth).correlation == pytest.approx(1)
    curve = tomofield.correlate_shells(fine, coarse, voxel_size_A=5.0)  # as the caller knows better
    assert curve.frequency_per_A[-1] == pytest.approx(1 / 10)


def test_bad_input_is_refused_in_a_sentence(series):
    with pytest.raises(tomofield.Error, match="cut both to one size"):
        tomofield.score_volume(series.tomogram[1:], series.truth)
    with pytest.raises(tomofield.Error, match="array \\[z, y, x\\]"):
        tomofield.score_volume(series.tomogram[0], series.truth)
