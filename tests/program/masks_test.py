"""Tests what is masked: beads that are found, a user's mask, fiducials and hot pixels."""

import json
import os

import numpy as np
import pytest
import skimage.io

import harness
from harness import tomofield

WIDTH, HEIGHT = 96, 80
TILTS = np.arange(-60, 61, 6.0)
DIAMETER = 4.0  # pixels of 10 Å
BEADS = np.array([[-30, 12, 4], [-12, 60, -8], [5, 30, 6], [18, 66, 0], [33, 20, -5], [-25, 40, 9]])
QUICK = ["--thickness", 24, "--no-margin", "--leaf-size", 16, "--field", "grid", "--epochs", 2]


@pytest.fixture(scope="module")
def directory():
    """Returns the folder of all series and masks."""
    return harness.fresh_directory("masks")


def bead_places(tilt):
    """Returns x, y of every bead in a view."""
    angle = np.radians(tilt)
    return np.stack([WIDTH / 2 + BEADS[:, 0] * np.cos(angle) + BEADS[:, 2] * np.sin(angle),
                     BEADS[:, 1]], axis=1)


def views_of(contrast, seed=1):
    """Returns views of ice with a soft body, noise and beads of this contrast; dense is dark."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    views = []
    for tilt in TILTS:
        dense = 3 * np.exp(-((x - 50) ** 2 + (y - 45) ** 2) / 300) + random.normal(size=x.shape)
        for bead_x, bead_y in bead_places(tilt):
            depth = 1 - ((x - bead_x) ** 2 + (y - bead_y) ** 2) / (DIAMETER / 2) ** 2
            dense += contrast * np.sqrt(np.maximum(depth, 0))
        views.append(200 - dense)
    return np.array(views, dtype=np.float32)


@pytest.fixture(scope="module", name="write_series")
def make_write_series(directory):
    def write_series(name, views):
        stack, tlt = (os.path.join(directory, name + end) for end in (".st", ".tlt"))
        harness.write_stack(stack, views, pixel_size=10.0)
        np.savetxt(tlt, TILTS, fmt="%.1f")
        return [stack, "--tlt", tlt]

    return write_series


def reconstruct(name, series, *options, command=("reconstruct",), quick=QUICK):
    output = os.path.join(harness.fresh_directory(name), "out.mrc")
    run = harness.succeed(*command, *series, "-o", output, *quick, *options)
    results = harness.Results(output)
    record = json.load(open(results.json_path))
    return results, record["metrics"]["mask"], run


@pytest.fixture(scope="module")
def beads(write_series):
    """Returns the arguments of a series with beads."""
    return write_series("beads", views_of(14))


@pytest.fixture(scope="module")
def plain(write_series):
    """Returns the arguments of a series without beads."""
    return write_series("plain", views_of(0))


def masked_pixels(results):
    """Returns true where the picture of the masks is red, [y, x] in the file's order."""
    picture = skimage.io.imread(results.mask_picture)
    zoom = picture.shape[1] // WIDTH
    assert picture.shape == (HEIGHT * zoom, WIDTH * zoom, 3)
    red = (picture[..., 0] > picture[..., 1])[::-1]
    return red[zoom // 2 :: zoom, zoom // 2 :: zoom]


def test_beads_are_found_reported_and_shown(beads):
    results, mask, run = reconstruct("found", beads)
    assert mask["beads"] == len(BEADS) and mask["bead_masking"] == "masked", mask
    assert 0.8 * DIAMETER < mask["bead_diameter_nm"] < 1.1 * DIAMETER, mask["bead_diameter_nm"]
    assert [view["beads_masked"] for view in mask["views"]] == [len(BEADS)] * len(TILTS)
    assert all(view["beads_found"] >= len(BEADS) - 1 for view in mask["views"])
    assert f"{len(BEADS)} beads" in run.stdout + run.stderr
    masked = masked_pixels(results)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    distance = np.min([np.hypot(x - bx, y - by) for bx, by in bead_places(0)], axis=0)
    assert masked[distance < DIAMETER / 2].all() and not masked[distance > 2 * DIAMETER].any()
    lowest = mask["views"][list(TILTS).index(0)]
    np.testing.assert_allclose(lowest["masked_part"], masked.mean(), atol=1e-9)


@pytest.fixture(scope="module")
def bright(write_series):
    """Returns the arguments of a bright series with beads."""
    return write_series("bright", -views_of(14)) + ["--contrast", "bright"]


def test_beads_of_a_bright_series_are_found_and_shown_but_not_masked_without_trials(bright):
    results, mask, run = reconstruct("bright_sirt", bright, command=["baseline", "sirt"],
                                     quick=["--thickness", 24, "--iterations", 2])
    assert mask["beads"] == len(BEADS) and mask["bead_masking"] == "unmasked"
    assert mask["masked_part"] == 0 and not masked_pixels(results).any()
    assert f"found {len(BEADS)} beads" in run.stdout + run.stderr
    assert "--bead-diameter" in run.stdout + run.stderr
    picture = skimage.io.imread(results.mask_picture)
    zoom = picture.shape[1] // WIDTH
    blue = (picture[..., 2] > picture[..., 0])[::-1][zoom // 2 :: zoom, zoom // 2 :: zoom]
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    distance = np.min([np.hypot(x - bx, y - by) for bx, by in bead_places(0)], axis=0)
    assert blue[distance < DIAMETER / 2].all() and not blue[distance > 2 * DIAMETER].any()


def test_a_trial_masks_the_beads_of_a_bright_series(bright):
    results, mask, run = reconstruct("bright_tried", bright)
    record = json.load(open(results.json_path))
    tried = {trial["masks_beads"] for trial in record["metrics"]["tuning"]["trials"]}
    assert tried == {False, True} and mask["bead_masking"] == "masked", tried
    assert "beads not masked" in run.stderr and "are masked" in run.stderr
    diameter = record["options"]["input"]["bead_diameter_nm"]
    given, mask, _ = reconstruct("bright_given", bright, "--bead-diameter", diameter)
    assert mask["bead_masking"] == "masked" and mask["masked_part"] > 0
    np.testing.assert_array_equal(given.volume, results.volume)


def test_methods_that_may_treat_bright_beads_differently_are_named(bright):
    folder = harness.fresh_directory("bright_compared")
    command = ["compare", *bright, "--methods", "wbp", "--thickness", 24, "-o", folder, "--overwrite"]
    said = harness.succeed(*command).stderr
    assert "methods may treat the 6 beads" in said and "--bead-diameter 0" in said, said
    assert "may treat" not in harness.succeed(*command, "--bead-diameter", 0).stderr


def test_voxel_baselines_mask_beads_too(beads):
    _, mask, _ = reconstruct("sirt", beads, command=("baseline", "sirt"),
                             quick=["--thickness", 24, "--iterations", 2])
    assert mask["beads"] == len(BEADS)


def test_beads_are_not_looked_for_when_told_so(beads):
    results, mask, _ = reconstruct("off", beads, "--bead-diameter", 0)
    assert mask["beads"] == 0 and mask["masked_part"] == 0 and not masked_pixels(results).any()


def test_nothing_is_found_where_there_are_none(plain):
    _, mask, _ = reconstruct("none", plain)
    assert mask["beads"] == 0 and mask["masked_part"] == 0
    cell = harness.Series("cell")
    dark = cell.with_views("dark", 1000 - 10 * cell.views)
    metrics = json.load(open(dark.reconstruct("dark_cell", "--contrast", "dark").json_path))
    assert metrics["metrics"]["mask"]["beads"] == 0


def simulate_beads(name, contrast, *options):
    """Simulates a specimen with few beads and returns its folder."""
    folder = os.path.join(harness.fresh_directory(name), "series")
    harness.succeed("simulate", folder, "--yardstick", "c", "--size", 96, "--thickness", 48, "--seed",
                    57, "--noise", 0.1, "--contrast", contrast, "--no-truth", *options)
    return folder


def mask_of(folder, contrast):
    series = [os.path.join(folder, "tilt_series.mrc"), "--tlt",
              os.path.join(folder, "tilt_series.tlt"), "--contrast", contrast]
    return reconstruct("few", series, command=("baseline", "sirt"),
                       quick=["--thickness", 48, "--iterations", 1])[1]


def numbers_of_beads(folder, beyond_px):
    """Returns how many beads are in each view, or at most so far beside it."""
    with open(os.path.join(folder, "phantom.json"), encoding="utf-8") as file:
        beads = np.array([bead["center_px"] for bead in json.load(file)["gold_beads"]])
    tilts = np.radians(np.loadtxt(os.path.join(folder, "tilt_series.tlt")))[:, None]
    x = beads[:, 0] * np.cos(tilts) + beads[:, 2] * np.sin(tilts)
    return ((np.abs(x) < 48 + beyond_px) & (np.abs(beads[:, 1]) < 48 + beyond_px)).sum(axis=1)


@pytest.mark.parametrize("options", [["--contrast", "dark"], ["--contrast", "bright"],
                                     ["--contrast", "dark", "--defocus", 3]])
def test_few_beads_of_any_size_are_found(options):
    contrast = options[1]
    for diameter in (6, 10):
        gold = ["--gold", 4, "--gold-diameter", 10 * diameter]
        folder = simulate_beads("few_beads", contrast, *gold, *options[2:])
        mask = mask_of(folder, contrast)
        assert 0.65 * diameter < mask["bead_diameter_nm"] < 1.1 * diameter, mask["bead_diameter_nm"]
        found = np.array([view["beads_found"] for view in mask["views"]])
        at_least, at_most = (numbers_of_beads(folder, beyond) for beyond in (-diameter, diameter))
        assert at_least.sum() > 0 and found.sum() >= 0.95 * at_least.sum(), (found, at_least)
        assert (found <= at_most).all(), (found, at_most)


def test_the_specimen_without_its_beads_has_none():
    for contrast in ("dark", "bright"):
        folder = simulate_beads("no_beads", contrast, "--gold", 4, "--gold-density", 0)
        assert mask_of(folder, contrast)["beads"] == 0


def test_masked_pixels_carry_no_loss(directory, plain, write_series):
    views = views_of(0)
    counts = np.ones_like(views, dtype=np.int16)
    counts[:, 30:44, 10:31] = 0
    mask = os.path.join(directory, "mask.mrc")
    harness.write_stack(mask, counts)
    spoilt = views.copy()
    spoilt[:, 30:44, 10:31] = np.random.default_rng(5).normal(100, 40, (len(TILTS), 14, 21))
    first, metrics, _ = reconstruct("plain_masked", plain, "--mask", mask)
    second, _, _ = reconstruct("spoilt", write_series("spoilt", spoilt), "--mask", mask)
    np.testing.assert_allclose(metrics["masked_part"], 14 * 21 / (WIDTH * HEIGHT))
    np.testing.assert_array_equal(first.volume, second.volume)


def test_fiducials_and_hot_pixels_are_masked(directory, write_series):
    views = views_of(0)
    views[3, 50, 60] = 1e6
    places = [(section, *place) for section, tilt in enumerate(TILTS)
              for place in bead_places(tilt)]
    model = os.path.join(directory, "model.txt")
    with open(model, "w") as file:
        file.writelines(f"  1 {i} {x:10.2f} {y:10.2f} {section:8.2f}\n"
                        for i, (section, x, y) in enumerate(places))
    _, mask, _ = reconstruct("fiducials", write_series("hot", views), "--fiducials", model,
                             "--bead-diameter", DIAMETER)
    assert mask["beads"] == 0 and mask["bad_pixels"] == 1
    assert [view["beads_masked"] for view in mask["views"]] == [len(BEADS)] * len(TILTS)


def test_what_cannot_be_is_refused(directory, plain):
    small = os.path.join(directory, "small.mrc")
    harness.write_stack(small, np.ones((2, HEIGHT, WIDTH), dtype=np.int16))
    no_numbers = os.path.join(directory, "no_numbers.mrc")
    harness.write_stack(no_numbers, np.full((len(TILTS), HEIGHT, WIDTH), np.nan, dtype=np.float32))
    text = os.path.join(directory, "bad.txt")
    with open(text, "w") as file:
        file.write("10 20 0\n10 twenty 0\n")
    output = os.path.join(harness.fresh_directory("refused"), "out.mrc")
    for options, parts in [(["--mask", small], ["small.mrc", "2 sections"]),
                           (["--mask", no_numbers], ["no_numbers.mrc", "no number", "section"]),
                           (["--fiducials", text], ["bad.txt", "line 2", "twenty"]),
                           (["--bead-diameter", "big"], ["--bead-diameter", "big"]),
                           (["--bead-diameter", "-3"], ["--bead-diameter", "-3"]),
                           (["--bead-diameter", "500"], ["500 nm", "500 pixels"])]:
        run = tomofield("reconstruct", *plain, "-o", output, *QUICK, *options)
        assert run.returncode == 2, (options, run.returncode, run.stderr)
        assert all(part in run.stderr for part in parts), (options, run.stderr)
        assert not os.path.exists(output)
