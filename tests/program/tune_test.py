"""Tests reconstruct --hold-out, --early-stop and --tune: the files that they write and their
choices."""

import json
import os
import signal

import numpy as np
import pytest
import skimage.io

import harness
from harness import HEIGHT, TILTS, WIDTH, read_bytes


@pytest.fixture(scope="module")
def series():
    """Returns a small simulated series."""
    return harness.Series("series")


def record(results):
    return json.load(open(results.json_path))


def stem(results, suffix):
    return results.volume_path[: -len(".mrc")] + suffix


def test_hold_out_reports_the_error_of_every_fourth_view(series):
    results = series.reconstruct("held", "--hold-out", 4)
    held_out = record(results)["metrics"]["held_out"]
    curve = held_out["error_by_epoch"]
    assert len(curve) == 8 and curve[-1] == held_out["error"] and curve[-1] < curve[0], curve
    views = [view["view"] for view in held_out["views"]]
    assert views == [2, 6, 10, 14, 18], views
    np.testing.assert_allclose([view["tilt_deg"] for view in held_out["views"]], TILTS[views])
    np.testing.assert_allclose(np.mean([view["error"] for view in held_out["views"]]), curve[-1],
                               rtol=1e-3)
    assert not results.same_as(series.reconstruct("all")), "held-out views were fitted"


def test_picture_shows_measured_predicted_and_what_is_left(series):
    results = series.reconstruct("picture", "--hold-out", 4, "--epochs", 16)
    picture = skimage.io.imread(stem(results, "_held_out.png")).astype(float)
    assert picture.shape == (HEIGHT, 3 * WIDTH + 8), picture.shape
    measured, predicted, left = (picture[::-1, i * (WIDTH + 4):][:, :WIDTH] for i in range(3))
    view = series.views[10]  # the one nearest to zero tilt
    assert np.corrcoef(measured.ravel(), view.ravel())[0, 1] > 0.98
    assert np.corrcoef(predicted.ravel(), view.ravel())[0, 1] > 0.8
    inside = np.all([(0 < panel) & (panel < 255) for panel in (measured, predicted, left)], axis=0)
    np.testing.assert_allclose((measured - predicted)[inside], (left - 127.5)[inside], atol=2)


def test_early_stop_ends_the_fit_and_resumes_as_finished(series):
    options = ["--hold-out", 4, "--tv", 0, "--epochs", 200, "--early-stop", 2]
    results = series.reconstruct("early", *options)
    curve = record(results)["metrics"]["held_out"]["error_by_epoch"]
    assert len(curve) < 200 and len(curve) == np.argmin(curve) + 3, curve
    assert record(results)["metrics"]["held_out"]["independent"] is False
    before = read_bytes(results.volume_path)
    harness.succeed("reconstruct", *series.input, "-o", results.volume_path,
                    *harness.merge(harness.QUICK, options), "--resume")
    assert read_bytes(results.volume_path) == before


def test_the_penalty_is_what_predicts_held_out_views_better(series):
    options = [option for option in harness.QUICK if option not in ("--tv-penalty", "concave")]
    command = ["reconstruct", *series.input, "-o"]
    output = os.path.join(harness.fresh_directory("penalty"), "out.mrc")
    run = harness.start(*command, output, *harness.merge(options, ["--epochs", 3000]))
    for line in run.stderr:
        if line.startswith("tune "):  # the first trial is under way
            break
    run.send_signal(signal.SIGTERM)
    run.wait()
    left = os.listdir(os.path.dirname(output))
    assert run.returncode == 143 and not left, (run.returncode, left)
    harness.succeed(*command, output, *options)
    written = json.load(open(output[:-len(".mrc")] + ".json"))
    trials = {(t["tv_penalty"], round(t["tv"], 6)): t for t in written["metrics"]["tuning"]["trials"]}
    assert all(len(t["held_out_error_by_view"]) == 5 for t in trials.values())
    assert all(t["epochs"] == 1 for t in trials.values())  # 0.2 of what plain vertices need for QUICK's

    def difference(one, other):
        """Returns the estimate of Hodges and Lehmann of the logarithm of the ratio of two trials'
        errors, and its standard error."""
        ratios = np.log(np.divide(trials[one]["held_out_error_by_view"],
                                  trials[other]["held_out_error_by_view"]))
        i, j = np.triu_indices(len(ratios))
        deviation = 1.4826 * np.median(np.abs(ratios - np.median(ratios)))
        return np.median((ratios[i] + ratios[j]) / 2), deviation / np.sqrt(len(ratios))

    smooth, concave = ("smooth", 5), ("concave", 14)
    above, error = difference(smooth, concave)
    better, usual = concave if above > 2 * error else smooth
    weights = sorted(weight for penalty, weight in trials if penalty == better)
    assert {round(weight / usual, 6) for weight in weights} >= {round(1 / 1.8, 6), 1, 1.8}, trials
    assert len(trials) == len(weights) + 1
    fit = written["options"]["fit"]
    chosen = (fit["penalty"], round(fit["density_variation"], 6))
    assert chosen[0] == better and chosen in trials, fit
    for other in trials:
        if other[0] == better:
            above, error = difference(chosen, other)
            assert above <= 2 * error + 1e-9, (chosen, other)
    assert fit["epochs"] == 8 and fit["hold_out"] == 0
    by_hand = output.replace("out.mrc", "by_hand.mrc")
    harness.succeed(*command, by_hand, *options, "--tv-penalty", better, "--tv",
                    fit["density_variation"])
    assert read_bytes(by_hand) == read_bytes(output)


def test_what_trials_chose_is_in_the_checkpoint(series):
    """A resumed run makes no trials, and another run is refused at once."""
    auto = [option for option in harness.QUICK if option not in ("--tv-penalty", "concave")]
    for options in (auto, harness.merge(auto, ["--tune", "--epochs", 2])):
        folder = harness.fresh_directory("checkpoint")
        whole, stopped = (harness.Results(os.path.join(folder, name))
                          for name in ("whole.mrc", "stopped.mrc"))

        def command(results, *more):
            return ["reconstruct", *series.input, "-o", results.volume_path,
                    *harness.merge(options, ["--epochs", 40, *more])]

        harness.succeed(*command(whole))
        run, errors = harness.stop_after_first_step(command(stopped))
        assert run.returncode == 143, errors
        chosen = record(whole)["options"]["fit"]["penalty"]
        another = "smooth" if chosen == "concave" else "concave"
        other = harness.tomofield(*command(stopped, "--resume", "--tv-penalty", another))
        assert other.returncode == 2 and "--tv-penalty" in other.stderr, other.stderr
        resumed = harness.succeed(*command(stopped, "--resume"))
        for said in (other.stderr, resumed.stderr):
            assert "tried" not in said and "tune " not in said, said
        assert read_bytes(stopped.volume_path) == read_bytes(whole.volume_path)
        harness.assert_same_tuning(*(record(results)["metrics"]["tuning"]
                                     for results in (whole, stopped)))


def test_views_that_score_the_result_have_no_say_in_its_settings(series):
    every = 4
    scored, broken = harness.with_broken_views(series, every)
    auto = [option for option in harness.QUICK if option not in ("--tv-penalty", "concave")]
    for options in (auto, harness.merge(auto, ["--tune", "--epochs", 2])):
        metrics = []
        for source in (series, broken):
            output = os.path.join(harness.fresh_directory("scored"), "out.mrc")
            harness.succeed("reconstruct", *source.input, "-o", output,
                            *harness.merge(options, ["--hold-out", every]))
            metrics.append(json.load(open(output[:-len(".mrc")] + ".json"))["metrics"])
        harness.assert_scored_views_have_no_say(metrics, scored)


def test_the_verdict_has_the_held_out_views_of_the_chosen_short_trial(series):
    results = series.reconstruct("short_trials", "--tv-penalty", "auto")
    metrics = record(results)["metrics"]
    chosen = metrics["tuning"]["chosen"]
    trial, = (t for t in metrics["tuning"]["trials"]
              if all(t[key] == chosen[key] for key in chosen if key != "epochs"))
    assert trial["epochs"] < chosen["epochs"]
    assert metrics["verdict"]["held_out"]["of_trials"]
    assert metrics["verdict"]["held_out"]["worst"] == max(trial["held_out_error_by_view"])
    assert "held out in trials" in metrics["verdict"]["line"]


TUNE = harness.merge(harness.QUICK, ["--epochs", 4, "--tune"])


def test_tune_chooses_what_predicts_best_then_fits_all_views(series):
    results = series.reconstruct("tuned", "--epochs", 4, "--tune", "--tv", 500)
    written = record(results)
    tuning = written["metrics"]["tuning"]
    trials, chosen = tuning["trials"], tuning["chosen"]
    assert len(trials) >= 9 and len({(t["tv"], t["rank"], t["epochs"]) for t in trials}) == len(trials)
    assert {t["rank"] for t in trials} == {2, 4, 6} and {t["epochs"] for t in trials} == {2, 4, 8}
    assert chosen["tv"] < 250, chosen  # a weight of 500 leaves no specimen
    options = written["options"]
    assert options["fit"]["density_variation"] == chosen["tv"] and options["tune"] is True
    assert options["field"]["rank"] == chosen["rank"] and options["fit"]["epochs"] == chosen["epochs"]
    assert options["fit"]["hold_out"] == 0 and written["metrics"]["held_out"] is None
    by_hand = series.reconstruct("by_hand", "--tv", chosen["tv"], "--rank", chosen["rank"],
                                 "--epochs", chosen["epochs"])
    assert read_bytes(by_hand.volume_path) == read_bytes(results.volume_path)

    # A run that was interrupted after some trials does not repeat them and ends alike.
    path = stem(results, "_tune.json")
    stored = json.load(open(path))
    derived = ("above_chosen", "standard_error")
    assert stored["trials"] == [{key: value for key, value in trial.items() if key not in derived}
                                for trial in trials]
    stored["trials"] = stored["trials"][:5]
    json.dump(stored, open(path, "w"))
    before = read_bytes(results.volume_path)
    for file in (results.volume_path, results.model_path, results.json_path):
        os.remove(file)
    again = ["reconstruct", *series.input, "-o", results.volume_path,
             *harness.merge(TUNE, ["--tv", 500]), "--resume"]
    harness.succeed(*again)
    assert read_bytes(results.volume_path) == before
    repeated = record(results)["metrics"]["tuning"]["trials"]
    assert repeated[:5] == trials[:5], "seconds show which trials were made anew"
    assert [t["held_out_error"] for t in repeated] == [t["held_out_error"] for t in trials]

    os.remove(results.model_path)
    other = harness.tomofield(*again, "--seed", 2)
    assert other.returncode == 2 and "_tune.json" in other.stderr, other.stderr
    open(path, "w").write("{")
    damaged = harness.tomofield(*again)
    assert damaged.returncode == 2 and "damaged" in damaged.stderr, damaged.stderr


def test_options_that_do_not_fit_are_refused(series):
    for options, fact in ((["--hold-out", 1], "--hold-out"), (["--hold-out", 300], "21 views"),
                          (["--early-stop", 3], "--hold-out"),
                          (["--hold-out", 4, "--engine", "ray"], "--engine slab"),
                          (["--tune", "--engine", "ray"], "--engine slab"),
                          (["--tune", "--hold-out", 4, "--early-stop", 3], "--early-stop")):
        output = os.path.join(harness.fresh_directory("refused"), "out.mrc")
        result = harness.tomofield("reconstruct", *series.input, "-o", output,
                                   *harness.merge(harness.QUICK, options))
        assert result.returncode == 2 and fact in result.stderr, (options, result.stderr)
        assert not os.listdir(os.path.dirname(output)), options


def test_the_dial_multiplies_the_weight_that_trials_choose(series):
    options = [option for option in harness.QUICK if option not in ("--tv-penalty", "concave")]
    weights, results = {}, {}
    for strength in ("medium", "light", "3"):
        results[strength] = harness.fresh_results(f"dial_{strength}")
        harness.succeed("reconstruct", *series.input, "-o", results[strength].volume_path, *options,
                        "--denoise", strength)
        written = record(results[strength])
        assert written["options"]["fit"]["denoise"] == strength
        weights[strength] = written["metrics"]["tv_weight"]
        chosen = written["options"]["fit"]["density_variation"]
        assert chosen == weights["medium"], "the weight that trials chose"
    assert weights["light"] == pytest.approx(weights["medium"] / 2)
    assert weights["3"] == pytest.approx(3 * weights["medium"])
    assert not results["medium"].same_as(results["3"])


def test_the_dial_multiplies_a_weight_that_no_trial_chose(series):
    for name, options, weight in (("usual", [], 5), ("given", ["--tv", 3], 3)):
        results = series.reconstruct(f"dial_{name}", "--tv-penalty", "smooth", "--denoise", "strong",
                                     *options)
        assert record(results)["options"]["fit"]["density_variation"] == weight
        assert record(results)["metrics"]["tv_weight"] == 2 * weight


def test_a_run_goes_on_with_the_same_dial_however_it_is_written(series):
    results = series.reconstruct("dial_resumed", "--tv-penalty", "smooth", "--denoise", "strong")
    command = ["reconstruct", *series.input, "-o", results.volume_path,
               *harness.merge(harness.QUICK, ["--tv-penalty", "smooth"]), "--resume", "--denoise"]
    harness.succeed(*command, "2")
    refused = harness.tomofield(*command, "3")
    assert refused.returncode == 2 and "--denoise" in refused.stderr, refused.stderr


def test_a_dial_without_total_variation_is_refused(series):
    output = os.path.join(harness.fresh_directory("dial_of_nothing"), "out.mrc")
    run = harness.tomofield("reconstruct", *series.input, "-o", output, *harness.QUICK, "--tv", 0,
                            "--denoise", "strong")
    assert run.returncode == 2 and "--denoise" in run.stderr and "--tv 0" in run.stderr, run.stderr
    assert not os.listdir(os.path.dirname(output))


def test_a_wrong_word_of_the_dial_is_refused(series):
    output = os.path.join(harness.fresh_directory("dial_refused"), "out.mrc")
    run = harness.tomofield("reconstruct", *series.input, "-o", output, "--thickness", 24,
                            "--denoise", "hard")
    assert run.returncode == 2 and "'hard' is no strength" in run.stderr, run.stderr
    assert not os.listdir(os.path.dirname(output))
