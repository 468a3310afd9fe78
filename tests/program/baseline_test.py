"""Tests the baselines from end to end: they have the inputs, outputs and errors of reconstruct."""

import io
import json
import os
import shutil

import mrcfile
import numpy as np
import pytest
import skimage.io

import harness
from harness import HEIGHT, PIXEL_SIZE, THICKNESS, TILTS, WIDTH, psnr, read_bytes

EMPTY_BEAM = 500.0
DEFAULTS = ["--thickness", THICKNESS, "--contrast", "bright", "--no-margin", "--threads", 1]
METHODS = {
    "wbp": [],
    "sirt": ["--iterations", 12],
    "sart-tv": ["--iterations", 8],
    "tv": ["--iterations", 40, "--weight", 2],
    "ingp": ["--iterations", 8, "--width", 16, "--levels", 4],
    "fourier-net": ["--iterations", 12, "--width", 16, "--features", 32],
}
ITERATIVE = {method: options for method, options in METHODS.items() if options}
NETWORKS = ["ingp", "fourier-net"]
TUNED = ["wbp", "sirt", "sart-tv", "tv"]
# For tests that do not depend on how well the networks fit.
ONE_PASS = {method: ["--iterations", 1] for method in NETWORKS}
# A stronger weight would smooth every negative value away.
WEAK = {"sart-tv": ["--weight", 0.1], "tv": ["--weight", 0.1]}

@pytest.fixture(scope="module")
def series():
    """Returns a small simulated series."""
    return harness.Series("series")


class Baseline(harness.Results):
    """Names the files of a run, which has no model."""

    def __init__(self, output):
        super().__init__(output)
        self.all_paths.remove(self.model_path)

    @property
    def record(self):
        return json.load(open(self.json_path))


@pytest.fixture(scope="module", name="baseline")
def make_baseline(series):
    def baseline(method, name, *options, source=series, run=harness.succeed, **keywords):
        output = os.path.join(harness.fresh_directory(f"{method}-{name}"), "out.mrc")
        options = harness.merge([*DEFAULTS, *METHODS[method]], options)
        result = run("baseline", method, *source.input, "-o", output, *options, **keywords)
        return Baseline(output), result

    return baseline


@pytest.fixture(scope="module")
def plain(baseline):
    """Returns the results of every method with its DEFAULTS."""
    return {method: baseline(method, "plain")[0] for method in METHODS}


def test_volume_is_an_mrc_file_that_others_read(plain):
    for results in plain.values():
        report = io.StringIO()
        assert mrcfile.validate(results.volume_path, print_file=report), report.getvalue()
        with mrcfile.open(results.volume_path) as file:
            assert file.data.shape == (THICKNESS, HEIGHT, WIDTH) and file.is_volume()
            for axis, size in zip("xyz", (WIDTH, HEIGHT, THICKNESS)):
                assert file.header.cella[axis] == np.float32(size * PIXEL_SIZE)
            assert b"baseline" in file.header.label[0]
        for plane, path in results.pictures.items():
            assert skimage.io.imread(path).shape[1] >= 512, plane
        assert not results.leftovers()


def test_specimen_is_found_and_tv_is_the_better_one(plain, series):
    flat = psnr(np.full_like(series.truth, series.truth.mean()), series.truth)
    gain = {method: psnr(plain[method].volume, series.truth) - flat for method in METHODS}
    print({method: f"{value:.2f} dB" for method, value in gain.items()}, "above a flat volume")
    assert gain["wbp"] > 1 and gain["sirt"] > 2 and gain["sart-tv"] > gain["sirt"], gain
    assert gain["tv"] > gain["sirt"] + 0.5, gain
    assert gain["ingp"] > 1.8, gain  # fourier-net: see network_fit_test.cc


def test_densities_are_not_negative_unless_allowed(baseline, plain):
    for method in ITERATIVE:
        assert plain[method].volume.min() >= 0
        free, _ = baseline(method, "free", "--non-negative", "off", *WEAK.get(method, []),
                           *ONE_PASS.get(method, []))
        # Networks that were hardly fitted stay above zero by themselves: network_fit_test.cc.
        assert method in NETWORKS or free.volume.min() < 0, method
        assert free.record["options"]["method"]["non_negative"] is False


def test_json_has_metrics_and_every_option(plain, series):
    for method, results in plain.items():
        options, metrics = results.record["options"], results.record["metrics"]
        assert options["input"]["stack"] == series.stack
        assert options["specimen"]["thickness"] == THICKNESS
        assert options["with_margin"] is False
        assert options["method"]["name"] == method
        assert metrics["held_out"] is None
        assert metrics["size_px"] == [WIDTH, HEIGHT, THICKNESS]
        np.testing.assert_allclose([view["tilt_deg"] for view in metrics["views"]], TILTS)
    for method, (_, iterations, *_) in ITERATIVE.items():
        options, metrics = plain[method].record["options"], plain[method].record["metrics"]
        assert options["method"]["iterations"] == iterations
        for history in ("mean_squared_residual_per_noise_variance", "objective"):
            values = metrics[history]
            most = 1 if method in NETWORKS else 0.5  # they have hardly begun
            assert len(values) == iterations + 1 and values[-1] < most * values[0], history
    assert plain["wbp"].record["options"]["method"]["window"] == "hann"
    assert plain["sart-tv"].record["options"]["method"]["subsets"] == 10
    assert plain["tv"].record["options"]["method"]["weight"] == 2
    assert plain["sirt"].record["options"]["method"]["relaxation"] == 1
    assert plain["ingp"].record["options"]["method"]["levels"] == 4
    assert plain["fourier-net"].record["options"]["method"]["shortest"] == 20


def test_parameters_are_those_that_are_fitted(baseline, plain):
    counts = {method: results.record["metrics"]["parameters"]
              for method, results in plain.items()}
    for method in set(METHODS) - set(NETWORKS):
        assert counts[method] == WIDTH * HEIGHT * THICKNESS
    # The network has 32 plane waves, two layers of 16 and one output.
    assert counts["fourier-net"] == 33 * 16 + 17 * 16 + 17
    more, _ = baseline("ingp", "wider", "--width", 17, "--iterations", 1)
    # The inputs are two features of each of four levels.
    assert more.record["metrics"]["parameters"] - counts["ingp"] == 9 + 17 + 16 + 1 + 1


def test_fourier_net_learns_the_noise_of_each_view(baseline, plain, series):
    noisy = series.views.copy()
    noisy[5] += np.random.default_rng(1).normal(0, 3 * series.views.std(), noisy[5].shape)
    results, _ = baseline("fourier-net", "noisy", source=series.with_views("noisy", noisy))
    learned = [view["learned_noise_sigma"] for view in results.record["metrics"]["views"]]
    others = learned[:5] + learned[6:]
    assert learned[5] > 1.5 * max(others) and min(others) > 0, learned
    assert "learned_noise_sigma" not in plain["ingp"].record["metrics"]["views"][0]


def test_a_network_begins_where_its_seed_says(baseline):
    for method in NETWORKS:
        one, other = (baseline(method, f"seed{seed}", "--seed", seed, *ONE_PASS[method])[0]
                      for seed in (1, 2))
        assert read_bytes(other.volume_path) != read_bytes(one.volume_path)


def test_held_out_views_are_predicted_and_not_fitted(baseline, series):
    every = 4
    held_out = list(range(every // 2, len(TILTS) - 1, every))
    broken = series.views.copy()
    broken[held_out[1]] = broken[held_out[1], :, ::-1]
    broken = series.with_views("broken", broken)
    for method in METHODS:
        results, run = baseline(method, "held-out", "--hold-out", every)
        metrics = results.record["metrics"]
        errors = {view["view"]: view["error"] for view in metrics["held_out"]["views"]}
        assert list(errors) == held_out
        assert f"held out: {len(held_out)} views, error" in run.stderr
        residual = metrics["mean_squared_residual_per_noise_variance"][-1]
        print(f"{method}: held out {metrics['held_out']['error']:.2f}, fitted {residual:.2f}")
        if method not in ("wbp", *NETWORKS):  # which fits none, which have hardly begun
            assert metrics["held_out"]["error"] > residual
        assert len(metrics["views"]) == len(TILTS) - len(held_out)
        other, _ = baseline(method, "held-out-broken", "--hold-out", every, source=broken)
        worse = {v["view"]: v["error"] for v in other.record["metrics"]["held_out"]["views"]}
        assert worse[held_out[1]] > (1.2 if method in NETWORKS else 2) * errors[held_out[1]]
        np.testing.assert_array_equal(other.volume, results.volume)


def test_concave_penalty_is_another_one(plain, series):
    output = os.path.join(harness.fresh_directory("tv-concave"), "out.mrc")
    harness.succeed("baseline", "tv", *series.input, *DEFAULTS, "-o", output, "--iterations", 60,
                    "--penalty", "concave")
    results = Baseline(output)
    method = results.record["options"]["method"]
    assert method["penalty"] == "concave" and method["weight"] > 3  # than that of a smooth one
    assert psnr(results.volume, series.truth) > psnr(plain["sirt"].volume, series.truth)
    assert read_bytes(results.volume_path) != read_bytes(plain["tv"].volume_path)


def test_tuned_settings_are_better_than_bad_ones_and_used_for_all_views(baseline, series):
    bad = {"sart-tv": ["--weight", 30, "--iterations", 3], "tv": ["--weight", 40],
           "sirt": ["--iterations", 3],
           "wbp": ["--window", "ramp"]}
    noise = np.random.default_rng(1).normal(0, series.views.std(), series.views.shape)
    sources = {"wbp": series.with_views("noisy", series.views + noise)}
    for method, options in bad.items():
        source = sources.get(method, series)
        worse, _ = baseline(method, "bad", *options, source=source)
        results, run = baseline(method, "tuned", *options, "--tune", source=source)
        metrics, used = results.record["metrics"], results.record["options"]
        tuning, chosen = metrics["tuning"], metrics["tuning"]["chosen"]
        assert used["method"] == chosen and used["tune"] and metrics["held_out"] is None
        assert len(metrics["views"]) == len(TILTS)
        assert run.stderr.count("tried --") == len(tuning["trials"]) and "tuned: --" in run.stderr
        assert all(len(trial["held_out_error_by_view"]) == 5 for trial in tuning["trials"])
        gain = psnr(results.volume, series.truth) - psnr(worse.volume, series.truth)
        print(f"{method}: tuned {gain:.2f} dB above {options}")
        assert gain > 0.3, (method, chosen)
        settings = [word for key in ("weight", "iterations", "cutoff") if key in chosen
                    for word in (f"--{key}", repr(chosen[key]))]  # repr: all digits
        by_hand, _ = baseline(method, "by-hand", *harness.merge(options, settings), source=source)
        assert read_bytes(by_hand.volume_path) == read_bytes(results.volume_path)


def test_fitted_view_scales_do_not_upset_total_variation(shared_data):
    # The dust's residuals are many times its noise. Scales that were fitted to each of the first
    # volumes used to grow without bound.
    folder = shared_data / "idp_haadf"
    objective = {}
    for view_scale in ("off", "on"):
        output = os.path.join(harness.fresh_directory(f"dust-{view_scale}"), "out.mrc")
        harness.succeed("baseline", "tv", os.path.join(folder, "haadf_tilt_tomviz_aligned.ali"), "--tlt",
                        os.path.join(folder, "haadf_tilt_raw.rawtlt"), "--contrast", "bright",
                        "--thickness", 32, "--iterations", 20, "--view-scale", view_scale, "-o", output)
        objective[view_scale] = Baseline(output).record["metrics"]["objective"][-1]
    assert objective["on"] < 1.5 * objective["off"], objective


def test_views_that_score_the_result_have_no_say_in_its_settings(baseline, series):
    every = 4
    scored, broken = harness.with_broken_views(series, every)
    for method in TUNED:
        metrics = [baseline(method, "scored", "--tune", *METHODS[method], "--hold-out", every,
                            source=source)[0].record["metrics"] for source in (series, broken)]
        harness.assert_scored_views_have_no_say(metrics, scored)
        assert metrics[0]["held_out"]["independent"] is True


def test_wider_roll_off_smooths_along_x(baseline, plain):
    def roughness(volume):
        return np.mean(np.diff(volume, axis=2) ** 2)

    rough = [roughness(plain["wbp"].volume)]
    for options in (["--window", "ramp"], ["--window", "ramp", "--cutoff", 0.15]):
        rough.append(roughness(baseline("wbp", "roll-off", *options)[0].volume))
    assert rough[1] > 1.2 * rough[0] and rough[2] < 0.8 * rough[1], rough


def test_region_of_interest_is_a_part_of_the_whole(baseline, plain):
    x0, y0, x1, y1 = 10, 5, 41, 30
    for method in METHODS:
        part, _ = baseline(method, "part", "--roi", f"{x0},{y0},{x1},{y1}", "--margin-spacing", 1,
                           *ONE_PASS.get(method, []), run=with_margin)
        assert part.volume.shape == (THICKNESS, y1 - y0, x1 - x0)
        if method in NETWORKS:  # which begin elsewhere in another box
            continue
        inside = plain[method].volume[:, y0:y1, x0:x1]
        correlation = np.corrcoef(part.volume.ravel(), inside.ravel())[0, 1]
        print(f"{method}: correlation of part and whole {correlation:.3f}")
        assert correlation > 0.95


def with_margin(*arguments, **keywords):
    return harness.succeed(*[word for word in arguments if word != "--no-margin"], **keywords)


def test_hand_mirrors_the_volume(baseline, plain):
    other, _ = baseline("sirt", "hand", "--hand", -1)
    np.testing.assert_allclose(other.volume[::-1], plain["sirt"].volume, atol=2e-3)


def test_dark_contrast_comes_out_dark(baseline, series):
    dark = series.with_views("dark", EMPTY_BEAM - series.views)
    results, _ = baseline("tv", "dark", "--contrast", "dark", "--view-scale", "off", source=dark)
    assert np.corrcoef(results.volume.ravel(), -series.truth.ravel())[0, 1] > 0.7
    inverted, _ = baseline("tv", "inverted", "--contrast", "dark", "--view-scale", "off", "--invert",
                           source=dark)
    np.testing.assert_array_equal(inverted.volume, -results.volume)


def test_axes_of_the_file(baseline, plain):
    swapped, _ = baseline("sirt", "xzy", "--axes", "xzy")
    # Sections lie along y, and rows run down from the upper face.
    np.testing.assert_array_equal(swapped.volume[:, ::-1].transpose(1, 0, 2),
                                  plain["sirt"].volume)


def test_threads_do_not_change_a_byte(baseline, plain):
    for method in METHODS:
        results, _ = baseline(method, "threads", "--threads", 2)  # one elsewhere
        assert read_bytes(results.volume_path) == read_bytes(plain[method].volume_path)


def test_dry_run_writes_nothing(baseline):
    results, run = baseline("tv", "dry", "--tune", "--dry-run")
    for words in ("GiB", "trials", f"{WIDTH} × {HEIGHT} × {THICKNESS}"):
        assert words in run.stdout, run.stdout
    assert not results.leftovers() and not os.path.exists(results.volume_path)


def test_existing_results_are_kept_unless_overwritten(plain, series):
    for method, results in plain.items():
        before = read_bytes(results.volume_path)
        command = ["baseline", method, *series.input, *DEFAULTS, "-o", results.volume_path]
        refused = harness.tomofield(*command)
        assert refused.returncode == 2, refused.stderr
        assert results.volume_path in refused.stderr and "--overwrite" in refused.stderr
        assert read_bytes(results.volume_path) == before
        command[-1] = os.path.join(harness.fresh_directory(f"{method}-overwritten"), "out.mrc")
        shutil.copy(results.volume_path, command[-1])
        one_pass = ["--iterations", 1] if method in ITERATIVE else []
        harness.succeed(*command, *one_pass, "--overwrite", "--invert")
        assert read_bytes(command[-1]) != before


def test_what_is_automatic_can_be_given_as_such(baseline):
    automatic, _ = baseline("tv", "auto", "--weight", "auto", "--penalty", "auto", "--iterations", 2)
    method = automatic.record["options"]["method"]
    assert method["penalty"] == "smooth" and method["weight"] == 3


def test_bad_input_gets_a_sentence_and_nothing_is_written(baseline, series):
    short = series.with_views("short", series.views[:-1])
    xtilt = os.path.join(series.directory, "five.xtilt")
    np.savetxt(xtilt, np.full(len(TILTS), 5.0))
    cases = [
        (["--thickness", 0], series, "thickness"),
        (["--iterations", 0], series, "iterations"),
        (["--weight", "-1"], series, "weight"),
        (["--roi", "0,0,4000,10"], series, "--roi"),
        (["--margin-spacing", 0.1], series, "margin-spacing"),
        (["--penalty", "sharp"], series, "penalty"),
        (["--hold-out", 1], series, "hold-out"),
        (["--hold-out", 1000], series, "--hold-out 1000"),
        ([], short, str(len(TILTS))),
        (["--xtilt", xtilt], series, "x-axis tilt of 5°"),
        (["--window", "box"], series, "window"),
        (["--cutoff", 0.6], series, "cutoff"),
        (["--falloff", 0], series, "falloff"),
        (["--subsets", 0], series, "subsets"),
        (["--tv-steps", 0], series, "tv-steps"),
        (["--relaxation", 2], series, "relaxation"),
        (["--tune", "--hold-out", 1000], series, "--hold-out 1000"),
        (["--width", 0], series, "width"),
        (["--learning-rate", "nan"], series, "learning-rate"),
        (["--seed", -1], series, "seed"),
        (["--finest", 0], series, "finest"),
        (["--shortest", 0], series, "shortest"),
    ]
    method_of = {"window": "wbp", "cutoff": "wbp", "falloff": "wbp", "subsets": "sart-tv",
                 "tv-steps": "sart-tv", "relaxation": "sirt", "width": "ingp", "seed": "fourier-net",
                 "learning-rate": "ingp", "finest": "ingp", "shortest": "fourier-net"}
    for options, source, expected in cases:
        method = method_of.get(expected, "tv")
        results, run = baseline(method, "bad", *options, source=source, run=harness.tomofield)
        assert run.returncode == 2, (options, run.returncode, run.stderr)
        assert expected in run.stderr and "internal" not in run.stderr, run.stderr
        assert not results.leftovers() and not os.path.exists(results.volume_path)


def test_a_method_has_to_be_named(series):
    for arguments in (["baseline"], ["baseline", "art", *series.input]):
        run = harness.tomofield(*arguments)
        assert run.returncode == 2 and run.stderr, (arguments, run.stderr)
