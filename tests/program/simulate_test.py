"""simulate against the yardstick script, and its options against what they promise.

usage: simulate_test.py TOMOFIELD SCRATCH_DIR"""

import contextlib
import filecmp
import io
import json
import os
import shutil
import subprocess
import sys

import mrcfile
import numpy as np
import scipy.ndimage

PROGRAM, SCRATCH = sys.argv[1], sys.argv[2]
SCRIPT = os.path.join(os.environ.get("TOMOFIELD_SHARED", "/nonexistent"), "tools", "make_cell.py")
MAX_DENSITY = 1.18  # by which the script divides; phantom.json has divided densities


def run(*arguments, threads=None):
    env = dict(os.environ, **({"OMP_NUM_THREADS": str(threads)} if threads else {}))
    return subprocess.run([PROGRAM, *map(str, arguments)], env=env, capture_output=True, text=True)


def simulate(name, *options, threads=None):
    """Runs simulate into a fresh directory of the scratch directory; returns its results."""
    directory = os.path.join(SCRATCH, name)
    shutil.rmtree(directory, ignore_errors=True)
    result = run("simulate", directory, *options, threads=threads)
    assert result.returncode == 0, result.stderr
    return Series(directory)


class Series:
    def __init__(self, directory):
        self.directory = directory
        self.record = json.load(open(self.path("phantom.json")))
        self.views = self.record["views"]

    def path(self, name):
        return os.path.join(self.directory, name)

    def read(self, name):
        with mrcfile.open(self.path(name)) as file:
            return file.data.astype(np.float64)


def run_script(directory, options, objects=None):
    """Runs the yardstick script, with these objects instead of its own if given; its variables."""
    source = open(SCRIPT).read()
    placement = "place(125,.15,.4); place(2000,.05,.25)"
    assert source.count(placement) == 1, "the script has changed: adapt this test"
    if objects is not None:
        source = source.replace(placement, "obj=list(given)")
    variables = {"given": objects, "__name__": "__main__"}
    arguments, sys.argv = sys.argv, ["make_cell.py", directory, *map(str, options)]
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            exec(compile(source, SCRIPT, "exec"), variables)
    finally:
        sys.argv = arguments
    return variables


def test_same_objects_give_the_scripts_truth_and_projections():
    for options in (
        ["--size", 64, "--thickness", 40, "--tilts=-70:69.5:15.5"],
        ["--size", 65, "--thickness", 33, "--tilts=-60:60:12", "--extended"],
    ):
        ours = simulate("same", *options)
        objects = [
            (
                np.array(e["center_px"]),
                e["radius_px"],
                np.array(e["q"]),
                e["inner_to_outer_ratio"],
                e["wall_density"] * MAX_DENSITY,
                e["inside_density"] * MAX_DENSITY,
            )
            for e in ours.record["ellipsoids"]
        ]
        assert len(objects) > 20
        theirs = run_script(os.path.join(SCRATCH, "script"), options, objects)
        np.testing.assert_allclose(ours.read("truth.mrc"), theirs["truth"], atol=1e-6)
        np.testing.assert_allclose(ours.read("clean.mrc"), theirs["clean"], atol=2e-5, rtol=1e-6)
        np.testing.assert_allclose(ours.record["noise_sigma"], theirs["sigma"], rtol=1e-5)
        tilts = np.loadtxt(ours.path("tilt_series.tlt"))
        np.testing.assert_allclose(tilts, theirs["tilts"], atol=1e-4)
        noise = ours.read("tilt_series.mrc") - ours.read("clean.mrc")
        assert abs(noise.std() / theirs["sigma"] - 1) < 0.02 and abs(noise.mean()) < 0.02 * noise.std()
        for name, group in (("truth.mrc", 1), ("clean.mrc", 0), ("tilt_series.mrc", 0)):
            assert mrcfile.validate(ours.path(name), print_file=io.StringIO()), name
            with mrcfile.open(ours.path(name)) as file:
                assert int(file.header.ispg) == group and abs(file.voxel_size.x - 10) < 1e-5, name


def test_seeds_have_the_scripts_statistics():
    seeds = 12
    for extended in ([], ["--extended"]):
        figures = {"ours": [], "theirs": []}
        for seed in range(seeds):
            options = ["--size", 64, "--thickness", 40, "--tilts=0:60:60", "--seed", seed, *extended]
            ours = simulate("statistics", *options)
            truth = ours.read("truth.mrc")
            count = len(ours.record["ellipsoids"])
            figures["ours"].append([count, truth.mean(), truth.std(), ours.record["noise_sigma"]])
            theirs = run_script(os.path.join(SCRATCH, "script"), options)
            truth = theirs["truth"]
            figures["theirs"].append([len(theirs["obj"]), truth.mean(), truth.std(), theirs["sigma"]])
        ours, theirs = np.array(figures["ours"]), np.array(figures["theirs"])
        error = np.sqrt((ours.var(0, ddof=1) + theirs.var(0, ddof=1)) / seeds)
        deviation = (ours.mean(0) - theirs.mean(0)) / error
        assert (abs(deviation) < 4).all(), (extended, ours.mean(0), theirs.mean(0), error)


SMALL = ["--size", 48, "--thickness", 30, "--tilts", "-60:60:10"]
FILES = ["tilt_series.mrc", "clean.mrc", "truth.mrc", "tilt_series.tlt", "phantom.json"]


def test_same_seed_same_bytes_whatever_the_threads():
    options = [*SMALL, "--gold", 5, "--gain", 0.1, "--shifts", 2, "--dose", 50, "--gold-diameter", 40]
    one = simulate("one", *options, threads=1)
    two = simulate("two", *options, threads=2)
    other = simulate("other", *options, "--seed", 8)
    for name in [*FILES, "tilt_series.xf"]:
        assert filecmp.cmp(one.path(name), two.path(name), shallow=False), name
    assert not filecmp.cmp(one.path("truth.mrc"), other.path("truth.mrc"), shallow=False)


def test_dark_contrast_and_gain():
    plain = simulate("plain", *SMALL)
    dark = simulate("dark", *SMALL, "--contrast", "dark", "--gain", 0.2)
    gains = np.array([view["gain"] for view in dark.views])
    assert 0.05 < np.log(gains).std() < 0.5
    assert all(view["gain"] == 1 for view in plain.views)
    expected = gains[:, None, None] * (dark.record["empty_beam"] - plain.read("clean.mrc"))
    np.testing.assert_allclose(dark.read("clean.mrc"), expected, rtol=1e-5, atol=1e-4)
    assert dark.read("clean.mrc").min() > 0
    noise = dark.read("tilt_series.mrc") - dark.read("clean.mrc")
    assert abs(noise.std() / plain.record["noise_sigma"] - 1) < 0.03


def test_dose_gives_poisson_counts_of_the_attenuated_beam():
    plain = simulate("plain", *SMALL)
    for dose in (8, 400):
        counted = simulate("counted", *SMALL, "--dose", dose)
        clean, counts = counted.read("clean.mrc"), counted.read("tilt_series.mrc")
        absorption_per_px = counted.record["options"]["absorption_per_A"] * 10
        np.testing.assert_allclose(clean, dose * np.exp(-absorption_per_px * plain.read("clean.mrc")), rtol=1e-5)
        assert (counts == np.round(counts)).all() and (counts >= 0).all()
        deviates = (counts - clean) / np.sqrt(clean)
        assert abs(deviates.mean()) < 5 / np.sqrt(deviates.size), deviates.mean()
        assert abs(deviates.var() - 1) < 5 * np.sqrt((2 + 1 / clean.mean()) / deviates.size), deviates.var()


def test_transforms_undo_the_shifts():
    # Large enough for the membranes to be sampled well enough to interpolate.
    options = ["--size", 128, "--thickness", 90, "--tilts=-60:60:10", "--extended"]
    plain = simulate("plain", *options)
    shifted = simulate("shifted", *options, "--shifts", 3)
    assert not os.path.exists(plain.path("tilt_series.xf"))
    transforms = np.loadtxt(shifted.path("tilt_series.xf"))
    assert transforms.shape == (13, 6) and (transforms[:, :4] == [1, 0, 0, 1]).all()
    assert abs(transforms[:, 4:]).max() > 2
    expected, moved = plain.read("clean.mrc"), shifted.read("clean.mrc")
    inside = (slice(12, -12), slice(12, -12))
    for view, (dx, dy) in enumerate(transforms[:, 4:]):
        # raw -> aligned: X' = X + DX, so the aligned image is the raw one moved by (DX, DY)
        aligned = scipy.ndimage.shift(moved[view], (dy, dx), order=3)
        here = np.corrcoef(aligned[inside].ravel(), expected[view][inside].ravel())[0, 1]
        assert here > 0.99, (view, here)
        record = shifted.views[view]["shift_px"]
        np.testing.assert_allclose([-dx, -dy], record, atol=1e-9)


def test_gold_beads_are_where_the_record_says():
    plain = simulate("plain", *SMALL)
    gold = simulate("gold", *SMALL, "--gold", 6, "--gold-diameter", 50, "--gold-density", 7)
    beads = gold.record["gold_beads"]
    assert len(beads) == 6 and len(gold.record["ellipsoids"]) == len(plain.record["ellipsoids"])
    z, y, x = np.meshgrid(*(np.arange(n) + 0.5 - n / 2 for n in (30, 48, 48)), indexing="ij")
    expected = plain.read("truth.mrc")
    for bead in beads:
        cx, cy, cz = bead["center_px"]
        assert bead["radius_px"] == 2.5
        expected += 7 * ((x - cx) ** 2 + (y - cy) ** 2 + (z - cz) ** 2 < 2.5**2)
    np.testing.assert_allclose(gold.read("truth.mrc"), expected, atol=1e-5)


def test_existing_files_are_kept_unless_asked():
    series = simulate("kept", *SMALL, "--shifts", 1)
    before = open(series.path("tilt_series.mrc"), "rb").read()
    result = run("simulate", series.directory, *SMALL)
    assert result.returncode == 2 and "exists" in result.stderr and "--overwrite" in result.stderr
    assert open(series.path("tilt_series.mrc"), "rb").read() == before
    result = run("simulate", series.directory, *SMALL, "--overwrite", "--no-truth", "--seed", 9)
    assert result.returncode == 0, result.stderr
    assert "ellipsoids, 13 views, sigma" in result.stdout
    assert open(series.path("tilt_series.mrc"), "rb").read() != before
    # What would belong to the series before is gone.
    assert sorted(os.listdir(series.directory)) == sorted(set(FILES) - {"truth.mrc"})


def test_bad_options_are_named_and_nothing_is_written():
    directory = os.path.join(SCRATCH, "bad")
    for options, words in (
        (["--tilts", "-60:60"], "first:last:step"),
        (["--tilts", "-60:nan:2"], "range"),
        (["--tilts", "60:-60:2"], "range"),
        (["--tilts", "-85:85:5"], "80"),
        (["--size", "0"], "size"),
        (["--size", "many"], "size"),
        (["--noise", "-1"], "noise"),
        (["--noise", "nan"], "noise"),
        (["--dose", "0"], "dose"),
        (["--dose", "5", "--noise", "0.1"], "--noise"),
        (["--dose", "5", "--contrast", "bright"], "contrast"),
        (["--voxel-size", "0"], "voxel size"),
        (["--gold", "5", "--gold-diameter", "1e6"], "diameter"),
    ):
        result = run("simulate", directory, *options)
        assert result.returncode == 2, (options, result)
        assert words in result.stderr, (options, result.stderr)
        assert not os.path.exists(directory), options
    result = run("simulate", "/proc/nowhere/cell", *SMALL)
    assert result.returncode == 2 and "/proc/nowhere/cell" in result.stderr


def main():
    shutil.rmtree(SCRATCH, ignore_errors=True)  # of an earlier run that failed
    os.makedirs(SCRATCH)
    tests = [value for name, value in globals().items() if name.startswith("test_")]
    has_script = os.path.exists(SCRIPT)
    for test in tests:
        if "script" in test.__name__ and not has_script:
            print("SKIPPED", test.__name__, "(no", SCRIPT + ")")
            continue
        test()
        print("passed ", test.__name__)
    shutil.rmtree(SCRATCH)
    return 0 if has_script else 77


if __name__ == "__main__":
    sys.exit(main())
