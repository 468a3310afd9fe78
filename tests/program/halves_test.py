"""Tests reconstruct with halves: --even and --odd, --split-tilts, and --denoising-halves."""

import copy
import json
import os
import signal

import h5py
import mrcfile
import numpy as np
import pytest

import harness
from harness import read_bytes, read_volume

NOISE = 0.3
# Nothing is left to trials.
FIT = harness.merge(harness.QUICK, ["--view-scale", "on", "--epochs", 6, "--black-level", 0,
                                    "--bead-diameter", 0])


class Halves:
    """Names the files of a run with halves."""

    def __init__(self, output):
        self.volume_path = output
        self.model_path = output[: -len(".mrc")] + ".h5"
        stem = output[: -len(".mrc")]
        self.json_path = stem + ".json"
        self.volumes = [f"{stem}_{half}_Vol.mrc" for half in ("EVN", "ODD")]
        self.models = [f"{stem}_{half}.h5" for half in ("EVN", "ODD")]
        self.linear = [f"{stem}_wbp_{half}_Vol.mrc" for half in ("EVN", "ODD")]
        self.maps = [stem + "_local_resolution.mrc", stem + "_uncertainty.mrc"]
        self.pictures = [f"{stem}_{name}.png" for name in ("fsc", "xy", "xz", "yz", "mask")]
        self.report = stem + "_report.html"
        self.results = [output, self.model_path, self.json_path, self.report, *self.volumes,
                        *self.models, *self.maps, *self.pictures]

    @property
    def json(self):
        with open(self.json_path, encoding="utf-8") as file:
            return json.load(file)

    def files(self):
        folder = os.path.dirname(self.volume_path)
        return {os.path.join(folder, name) for name in os.listdir(folder)
                if not name.endswith(".tomofield-lock")}


class FrameSeries:
    """A series whose stack is the sum of the stacks of its even and odd frames."""

    def __init__(self, name):
        self.whole = harness.Series(name)
        random = np.random.default_rng(4)
        views = self.whole.views + 4.0  # counts
        self.even = views / 2 + random.normal(0, NOISE, views.shape)
        self.odd = views / 2 + random.normal(0, NOISE, views.shape)
        self.stack = self.write("sum", self.even + self.odd)
        self.paths = [self.write("even", self.even), self.write("odd", self.odd)]
        self.input = [self.stack, "--tlt", self.whole.tlt]

    def write(self, name, views):
        path = os.path.join(self.whole.directory, name + ".mrc")
        harness.write_stack(path, views.astype(np.float32))
        return path

    def with_odd(self, name, odd):
        other = copy.copy(self)
        other.paths = [self.paths[0], self.write(name, odd)]
        return other

    def options(self):
        return ["--even", self.paths[0], "--odd", self.paths[1], "--denoising-halves"]

    def command(self, results, *options):
        return ["reconstruct", *self.input, "-o", results.volume_path,
                *harness.merge(FIT, options)]

    def run(self, name, *options):
        results = fresh(name)
        harness.succeed(*self.command(results, *options))
        return results


def fresh(name):
    return Halves(os.path.join(harness.fresh_directory(name), "out.mrc"))


@pytest.fixture(scope="module", name="series")
def make_series():
    return FrameSeries("series")


@pytest.fixture(scope="module")
def frames(series):
    return series.run("frames", *series.options(), "--threads", 3)


@pytest.fixture(scope="module")
def tilts(series):
    return series.run("tilts", "--split-tilts")


def assert_same_bits(one, other):
    for a, b in zip([one.volume_path, one.model_path, *one.volumes, *one.models, *one.maps],
                    [other.volume_path, other.model_path, *other.volumes, *other.models,
                     *other.maps]):
        assert read_bytes(a) == read_bytes(b), a


def test_all_results_are_there_and_no_others(frames, tilts):
    assert frames.files() == {*frames.results, *frames.linear}
    assert tilts.files() == set(tilts.results)


def test_files_open_elsewhere(frames):
    first = frames.volumes[0]
    for path in [frames.volume_path, *frames.volumes, *frames.maps, *frames.linear]:
        # The reader finds a tiny deviation in a map of one value.
        assert path == frames.maps[0] or mrcfile.validate(path), path
        with mrcfile.open(path) as file, mrcfile.open(first) as half:
            assert file.data.shape == half.data.shape and file.is_volume()
            assert np.allclose(file.voxel_size.x, harness.PIXEL_SIZE)
            assert file.header.origin == half.header.origin


@pytest.fixture(scope="module")
def alone(series):
    """A run without halves."""
    return harness.Results(series.run("alone").volume_path)


@pytest.mark.parametrize("results", ["frames", "tilts"])
def test_the_tomogram_is_the_fit_of_all_data(results, alone, request):
    """It has the bits of a run without halves, and halves are neither alike nor foreign."""
    results = request.getfixturevalue(results)
    assert read_bytes(results.volume_path) == read_bytes(alone.volume_path)
    with h5py.File(results.model_path) as one, h5py.File(alone.model_path) as other:
        assert np.array_equal(one["field/parameters"], other["field/parameters"])
    with open(alone.json_path, encoding="utf-8") as file:
        metrics = json.load(file)["metrics"]
    for key in ("mean_squared_residual_per_noise_variance", "views", "speckle"):
        assert results.json["metrics"][key] == metrics[key], key
    even, odd = map(read_volume, results.volumes)
    assert 0.5 < np.corrcoef(even.ravel(), odd.ravel())[0, 1] < 0.9999


def test_the_uncertainty_is_that_of_the_halves(frames):
    even, odd = map(read_volume, frames.volumes)
    squares = (even - odd) ** 2
    map_ = read_volume(frames.maps[1])
    z, y, x = 11, 20, 30
    assert np.isclose(map_[z, y, x], np.sqrt(squares[8:15, 17:24, 27:34].mean()) / 2, rtol=1e-4)
    assert np.isclose(map_[0, 0, 1], np.sqrt(squares[:4, :4, :5].mean()) / 2, rtol=1e-4)


def test_the_metrics_have_curves_and_crossings(frames):
    halves = frames.json["halves"]
    assert halves["of"] == "frames"
    fsc = halves["fsc"]
    even, odd = map(read_volume, frames.volumes)
    assert len(fsc["all"]["correlation"]) == len(fsc["frequency_per_A"]) == harness.WIDTH // 2
    assert fsc["all"]["correlation"][0] > 0.95
    assert "resolution_at_0.143_A" in fsc["all"] and "resolution_at_0.5_A" in fsc["measured"]
    # evaluate computes the same
    metrics = os.path.join(os.path.dirname(frames.json_path), "evaluated.json")
    harness.succeed("evaluate", frames.volumes[0], "--fsc", frames.volumes[1], "--json", metrics)
    with open(metrics, encoding="utf-8") as file:
        evaluated = json.load(file)["fsc"]
    os.remove(metrics)
    assert np.allclose(evaluated["all"]["correlation"], fsc["all"]["correlation"], atol=1e-6)
    # Errors of regularised halves are alike, those of linear ones are not.
    linear = halves["linear"]["fsc"]["all"]["correlation"]
    assert np.mean(linear) < np.mean(fsc["all"]["correlation"])
    assert even.shape == odd.shape
    resolution = read_volume(frames.maps[0])
    assert resolution.min() >= 2 * harness.PIXEL_SIZE * 0.999
    assert resolution.max() <= 32 * harness.PIXEL_SIZE * 1.001


@pytest.mark.parametrize("results", ["frames", "tilts"])
def test_halves_share_masks_scales_noise_and_weight(results, request):
    results = request.getfixturevalue(results)
    written = results.json
    even, odd = (written["halves"][half]["metrics"] for half in ("even", "odd"))
    for shared in ("mask", "density_unit", "tv_gain", "tuning"):
        assert even[shared] == odd[shared] == written["metrics"][shared], shared
    for rows in zip(even["views"], odd["views"], written["metrics"]["views"], strict=True):
        for key in ("tilt_deg", "scale", "offset"):
            assert rows[0][key] == rows[1][key] == rows[2][key], key
    scales = [view["scale"] for view in even["views"]]
    assert max(scales) - min(scales) > 1e-4  # they were fitted
    assert (even["mean_squared_residual_per_noise_variance"]
            != odd["mean_squared_residual_per_noise_variance"])


def test_halves_of_frames_use_disjoint_data(series, frames):
    odd = series.odd.copy()
    odd[7, 10:20, 10:20] += 3 * np.random.default_rng(0).normal(size=(10, 10))
    changed = series.with_odd("other_odd", odd)
    results = changed.run("disjoint", *changed.options())
    assert read_bytes(results.volumes[0]) == read_bytes(frames.volumes[0])
    assert read_bytes(results.volumes[1]) != read_bytes(frames.volumes[1])


def test_halves_of_tilts_use_disjoint_data(series, tilts):
    """Tilts count from 1, so view 7 (from 0) is even. The other half has no data of it, but noise and
    models of views that the fit of all data gave."""
    views = series.even + series.odd
    views[7] = np.roll(views[7], 2, axis=0)
    changed = copy.copy(series)
    changed.input = [series.write("rolled", views), "--tlt", series.whole.tlt]
    other = changed.run("rolled", "--split-tilts")
    even, odd = (np.abs(read_volume(a) - read_volume(b)).max()
                 for a, b in zip(tilts.volumes, other.volumes))
    assert odd < 0.2 * even, (even, odd)


def test_threads_do_not_matter(series, frames):
    one = series.run("one_thread", *series.options(), "--threads", 1)
    assert_same_bits(one, frames)
    for a, b in zip(one.linear, frames.linear):
        assert read_bytes(a) == read_bytes(b)


@pytest.mark.parametrize("halves", ["frames", "tilts"])
def test_a_finished_run_can_get_halves(series, halves, request):
    """Its fit is taken over, so that the halves alone are fitted."""
    results = series.run("later_" + halves)
    options = ["--split-tilts"] if halves == "tilts" else series.options()
    refused = harness.tomofield(*series.command(results, *options))
    assert refused.returncode == 2 and "exists" in refused.stderr
    resumed = harness.succeed(*series.command(results, *options, "--resume"))
    assert f"resuming {results.model_path} at step" in resumed.stderr, resumed.stderr
    assert "all data  epoch" not in resumed.stderr, resumed.stderr
    reference = request.getfixturevalue(halves)
    for a, b in zip([results.volume_path, *results.volumes, *results.maps],
                    [reference.volume_path, *reference.volumes, *reference.maps]):
        assert read_bytes(a) == read_bytes(b), a


def test_a_stopped_run_goes_on_with_the_same_bits(series, frames):
    results = fresh("stopped")
    run, errors = harness.stop_after_first_step(series.command(results, *series.options()))
    assert run.returncode == 143 and results.model_path in errors, errors
    assert results.files() == {results.model_path}
    harness.succeed(*series.command(results, *series.options(), "--resume"))
    assert_same_bits(results, frames)


def test_a_killed_second_fit_goes_on(series, tilts):
    results = fresh("killed")
    command = series.command(results, "--split-tilts", "--checkpoint-minutes", 0.001)
    run = harness.start(*command)
    for line in run.stderr:
        if "odd half  epoch" in line:
            break
    run.send_signal(signal.SIGKILL)
    run.communicate()
    assert not os.path.exists(results.volume_path)
    resumed = harness.succeed(*command, "--resume")
    assert results.models[0] in resumed.stderr  # which is taken over
    assert_same_bits(results, tilts)


def test_views_can_be_held_out_of_both(series):
    results = series.run("held_out", "--split-tilts", "--hold-out", 5)
    even, odd = (results.json["halves"][half]["metrics"]["held_out"] for half in ("even", "odd"))
    assert [v["view"] for v in even["views"]] == [v["view"] for v in odd["views"]] == [2, 7, 12, 17]
    picture = results.volume_path[: -len(".mrc")] + "_held_out.png"
    assert results.files() == {*results.results, picture}


def test_other_forms_of_the_volume(series):
    results = series.run("forms", *series.options(), "--mode", 1, "--axes", "xzy", "--invert",
                         "--roi", "4,3,44,33", "--bin", 2)
    volumes = [read_volume(path) for path in [results.volume_path, *results.volumes]]
    assert volumes[0].shape == (15, 12, 20)
    assert max(np.abs(volume).max() for volume in volumes) == 32000
    # One factor is in all of them. A half has more noise, so that its fit is somewhat smoother.
    assert abs(volumes[0].std() / np.mean([volume.std() for volume in volumes[1:]]) - 1) < 0.2
    for pair in (results.volumes, results.linear):
        labels = []
        for path in pair:
            with mrcfile.open(path) as file:
                labels.append(file.get_labels())
        assert labels[0] == labels[1] and "stored =" in labels[0][0], labels
    # Nor has the uncertainty the factor, which is in no label of it.
    as_floats = series.run("floats", *series.options(), "--axes", "xzy", "--invert", "--roi",
                           "4,3,44,33", "--bin", 2)
    uncertainty, reference = (read_volume(made.maps[1]) for made in (results, as_floats))
    np.testing.assert_allclose(uncertainty.mean(), reference.mean(), rtol=1e-2)
    assert max(np.abs(read_volume(path)).max() for path in results.linear) == 32000
    for path in results.maps:
        assert read_volume(path).shape == volumes[0].shape


def test_halves_may_have_other_units(series, frames):
    """The stack may be the mean, and a half may have more frames than the other."""
    other = copy.copy(series)
    other.paths = [series.write("even_3", 3 * series.even), series.write("odd_half", series.odd / 2)]
    results = other.run("units", *other.options())
    even, reference = read_volume(results.volumes[0]), read_volume(frames.volumes[0])
    assert np.abs(even - reference).max() < 1e-3 * np.abs(reference).max()


def test_the_plan_says_that_there_are_more_fits(series):
    results = fresh("plan")
    plan = harness.succeed(*series.command(results, "--split-tilts", "--dry-run")).stdout
    assert "two fits more, of one half of the tilts each" in plan
    assert not results.files()


def test_the_log_says_what_the_halves_are_not_for(series):
    results = fresh("log")
    run = harness.succeed(*series.command(results, "--split-tilts"))
    assert "do not train cryoCARE, IsoNet or DeepDeWedge" in run.stderr
    assert "--denoising-halves" in run.stderr and "too optimistic" in run.stderr


def test_the_log_says_that_halves_have_no_prior():
    series = harness.Series("prior")
    output = os.path.join(harness.fresh_directory("prior_log"), "out.mrc")
    said = harness.succeed("reconstruct", *series.input, "--thickness", harness.THICKNESS, "--contrast",
                           "bright", "--no-margin", "--epochs", 1, "--coarse-epochs", 0, "--prior",
                           "learned", "--tv-penalty", "smooth", "--split-tilts", "-o", output).stderr
    for line in ("even half: 10 views, without the learned prior", "odd half: 11 views, without the"):
        assert line in said, said
    assert "all data: 21 views\n" in said


def test_refusals(series):
    results = fresh("refused")
    small = series.write("small", series.odd[:, 1:])
    noise, other_noise = (
        series.write(f"noise{i}", np.random.default_rng(i).normal(9, 1, series.odd.shape))
        for i in (1, 2))
    holes = series.odd.copy()
    holes[3, 4, 5] = np.nan
    holes = series.write("holes", holes)
    even, odd = series.paths
    for options, reason in [
            (["--even", even], "give both"),
            (["--even", even, "--odd", odd, "--split-tilts"], "choose one of them"),
            (["--even", even, "--odd", small], "the same sections"),
            (["--even", noise, "--odd", other_noise], "are no halves of"),
            (["--even", even, "--odd", even], "are one file"),
            (["--even", series.stack, "--odd", odd], "are one file"),
            (["--even", even, "--odd", holes], "section 4"),
            (["--even", even, "--odd", even + ".no"], "even.mrc.no"),
            (["--split-tilts", "--exclude", "1-14"], "8 views or more"),
            (["--denoising-halves"], "needs halves"),
            (["--split-tilts", "--tree", "adaptive"], "--tree uniform"),
            (["--split-tilts", "--engine", "ray", "--bcc", 0], "--engine slab"),
            (["--split-tilts", "--hold-out", 5, "--early-stop", 2], "--early-stop")]:
        refused = harness.tomofield(*series.command(results, *options))
        assert refused.returncode == 2, (options, refused.stderr)
        assert reason in refused.stderr, (options, refused.stderr)
        assert not results.files(), results.files()


def test_results_that_cannot_be_written_leave_the_models(series, tilts):
    """A folder in the place of a picture is refused at once; one that comes later is not lost."""
    results = fresh("blocked")
    os.mkdir(results.pictures[0])
    refused = harness.tomofield(*series.command(results, "--split-tilts"))
    assert refused.returncode == 2 and results.pictures[0] in refused.stderr
    os.rmdir(results.pictures[0])
    run = harness.start(*series.command(results, "--split-tilts"))
    for line in run.stderr:
        if "odd half  epoch" in line:
            os.mkdir(results.maps[1])
            break
    _, errors = run.communicate()
    assert run.returncode != 0 and "--resume writes the results" in errors, errors
    assert results.files() == {results.maps[1], results.model_path, *results.models}
    os.rmdir(results.maps[1])
    harness.succeed(*series.command(results, "--split-tilts", "--resume"))
    assert_same_bits(results, tilts)
