"""Tests that a batch chooses its total variation once for all series, by the trials of some."""

import json
import os
import signal
import subprocess
import time

import numpy as np
import pytest

import harness
from batch_test import QUICK, fake_sbatch, options_of, page, pattern, write_table

# The options of QUICK that leave the total variation to trials.
OPEN = QUICK[:QUICK.index("--tv-penalty")] + QUICK[QUICK.index("--tv-penalty") + 2:]
NAMES = "abc"


@pytest.fixture(scope="module", name="data")
def make_data():
    """Returns a folder with three series whose trials choose different weights, and a fourth one
    whose third view is constant, which only a run finds."""
    folder = harness.fresh_directory("choice_data")
    views = harness.Series("choice_source").views[:, 2:34, 8:40].astype(np.float32)
    for number, name in enumerate(NAMES):
        noise = np.random.default_rng(number).normal(size=views.shape)
        noisy = views + np.float32(0.1 * (1 + number) * views.std()) * noise.astype(np.float32)
        harness.write_stack(os.path.join(folder, name + ".mrc"), noisy)
        np.savetxt(os.path.join(folder, name + ".tlt"), harness.TILTS, fmt="%.1f")
    views[2] = 5
    harness.write_stack(os.path.join(folder, "broken.mrc"), views)
    np.savetxt(os.path.join(folder, "broken.tlt"), harness.TILTS, fmt="%.1f")
    return folder


def read(folder, name):
    with open(os.path.join(folder, name), encoding="utf-8") as file:
        return json.load(file)


def edit_choice(folder, **changes):
    with open(os.path.join(folder, "choice.json"), "r+", encoding="utf-8") as file:
        choice = {**json.load(file), **changes}
        file.seek(0)
        file.truncate()
        json.dump(choice, file)


def has_words(path, words):
    return os.path.exists(path) and words in harness.read_bytes(path)


def commands(folder):
    """Returns the words of each series' command by its name."""
    return {job["name"]: job["command"] for job in read(folder, "batch.json")["jobs"]}


def settings(fit):
    return {"tv_penalty": fit["penalty"], "tv": fit["density_variation"],
            "spike_rank": fit["spike_rank"], "prior": fit["prior"]}


def chosen_settings(folder, name):
    """Returns what the trials of a series chose for it."""
    chosen = read(folder, name + ".json")["metrics"]["tuning"]["chosen"]
    return {key: chosen[key] for key in ("tv_penalty", "tv", "spike_rank", "prior")}


@pytest.fixture(scope="module", name="each")
def run_each(data):
    folder = harness.fresh_directory("choice_each")
    harness.succeed("batch", *pattern(data), *OPEN, "--choose", "each", "-o", folder)
    return folder


@pytest.fixture(scope="module", name="once")
def run_once(data):
    folder = harness.fresh_directory("choice_once")
    harness.succeed("batch", *pattern(data), *OPEN, "-o", folder)
    return folder


def test_all_series_of_a_batch_get_the_median_choice_of_three(once, each):
    own = [chosen_settings(each, name) for name in NAMES]
    assert len({settings["tv"] for settings in own}) > 1  # else this test says nothing
    choice = read(once, "choice.json")
    assert [vote["series"] for vote in choice["votes"]] == list(NAMES)
    assert [{**vote, "series": None} for vote in choice["votes"]] == [
        {**settings, "series": None} for settings in own]
    winners = [vote["tv"] for vote in own if vote["tv_penalty"] == choice["tv_penalty"]]
    assert min(winners) <= choice["tv"] <= max(winners)
    for name in NAMES:
        used = settings(options_of(os.path.join(once, name + ".mrc"))["fit"])
        assert used == {key: choice[key] for key in used}
        assert f"--tv={choice['tv']:g}" in commands(once)[name]
        assert f"--prior={choice['prior']}" in commands(once)[name]
        choosers = {origin["option"]: origin["file"] for origin in read(once, f"{name}.json")["origins"]}
        assert set(choosers) >= {"--tv-penalty", "--tv", "--prior"}, choosers
        assert set(choosers.values()) == {os.path.join(once, "choice.json")}
        with open(os.path.join(once, f"{name}_report.html"), encoding="utf-8") as file:
            assert "choice.json: choice for all series of the batch" in file.read()
    text = page(once)
    assert f"{choice['tv_penalty']} tv {choice['tv']:.3g}" in text and "trials of a (" in text


def test_every_series_chooses_for_itself_if_that_is_wanted(each):
    assert not os.path.exists(os.path.join(each, "choice.json"))
    assert "trials of" not in page(each)
    for name in NAMES:
        assert not any(word.startswith("--tv") for word in commands(each)[name])
        used = settings(options_of(os.path.join(each, name + ".mrc"))["fit"])
        assert used == chosen_settings(each, name)


def test_a_series_keeps_what_it_states_and_one_alone_has_nothing_to_share(data):
    folder = harness.fresh_directory("choice_table")
    rows = [[os.path.join(data, name + ".mrc"), os.path.join(data, name + ".tlt"), tv]
            for name, tv in (("a", ""), ("b", "7"), ("c", ""))]
    table = write_table(os.path.join(folder, "list.csv"), [["stack", "tlt", "tv"], *rows])
    results = os.path.join(folder, "results")
    planned = harness.succeed("batch", table, *OPEN, "--dry-run", "-o", results).stdout
    assert "trials of a, c choose" in planned and not os.path.exists(results)
    harness.succeed("batch", table, *OPEN, "-o", results)
    assert [vote["series"] for vote in read(results, "choice.json")["votes"]] == ["a", "c"]
    own = options_of(os.path.join(results, "b.mrc"))["fit"]
    assert own["density_variation"] == 7 and own["penalty"] == "concave"
    used = [settings(options_of(os.path.join(results, name + ".mrc"))["fit"]) for name in "ac"]
    assert used[0] == used[1] and used[0]["tv"] != 7
    alone = harness.fresh_directory("choice_alone")
    harness.succeed("batch", os.path.join(data, "a.mrc"), *pattern(data)[1:], *OPEN, "-o", alone)
    assert not os.path.exists(os.path.join(alone, "choice.json"))


def test_a_series_whose_trials_fail_has_no_vote(data):
    folder = harness.fresh_directory("choice_broken")
    rows = [[os.path.join(data, name + ".mrc"), os.path.join(data, name + ".tlt")]
            for name in ("a", "broken")]
    table = write_table(os.path.join(folder, "list.csv"), [["stack", "tlt"], *rows])
    results = os.path.join(folder, "results")
    result = harness.tomofield("batch", table, *OPEN, "-o", results)
    assert result.returncode == 1 and "broken: its trials failed" in result.stderr, result.stderr
    choice = read(results, "choice.json")
    assert "section 3" in choice["votes"][1]["failure"] and choice["tv"] == choice["votes"][0]["tv"]
    assert settings(options_of(os.path.join(results, "a.mrc"))["fit"])["tv"] == choice["tv"]
    assert "section 3" in page(results)


def test_a_batch_that_goes_on_takes_the_stored_choice(data):
    folder = harness.fresh_directory("choice_stopped")
    command = ["batch", *pattern(data), *harness.merge(OPEN, ["--epochs", 4000]),
               "--checkpoint-minutes", 0, "--at-once", 1, "-o", folder]
    run = harness.start(*command)
    while run.poll() is None and not any(name.endswith(".h5") for name in os.listdir(folder)):
        time.sleep(0.02)
    run.send_signal(signal.SIGINT)
    _, errors = run.communicate(timeout=60)
    assert run.returncode == 130, errors
    stored, before = harness.read_bytes(os.path.join(folder, "choice.json")), commands(folder)
    again = harness.start(*command, "--skip-existing")
    begun, = (name[:-3] for name in os.listdir(folder) if name.endswith(".h5"))
    log = os.path.join(folder, "logs", begun + ".log")
    while again.poll() is None and b"resuming" not in harness.read_bytes(log):
        time.sleep(0.02)
    again.send_signal(signal.SIGTERM)
    again.communicate(timeout=60)
    assert b"resuming" in harness.read_bytes(log)
    assert harness.read_bytes(os.path.join(folder, "choice.json")) == stored
    assert commands(folder) == before and any(w.startswith("--tv=") for w in before[begun])
    edit_choice(folder, tv=3.5)
    os.remove(log)
    edited = harness.start(*command, "--skip-existing")
    while edited.poll() is None and not has_words(log, b"resuming"):
        time.sleep(0.02)
    edited.send_signal(signal.SIGTERM)
    said, errors = edited.communicate(timeout=60)
    assert has_words(log, b"resuming"), errors
    assert f"began with: {begun}" in said
    for name in NAMES:
        assert (commands(folder)[name] == before[name]) == (name == begun), name
        assert ("--tv=3.5" in commands(folder)[name]) == (name != begun), name


def test_a_batch_that_replaces_results_and_was_stopped_as_it_chose_chooses_again(data, once):
    """The checkpoints of the results that are replaced are no series that have begun."""
    folder = harness.fresh_directory("choice_replaced")
    command = ["batch", *pattern(data), *OPEN, "-o", folder]
    harness.succeed(*command)
    run = harness.start(*command, "--overwrite", "--at-once", 1, "--threads", 1)
    first_vote = os.path.join(folder, "logs", "choice", NAMES[1] + ".log")
    os.remove(first_vote)
    while run.poll() is None and not os.path.exists(first_vote):
        time.sleep(0.01)
    run.send_signal(signal.SIGTERM)
    _, errors = run.communicate(timeout=60)
    assert run.returncode == 143 and "stopped during the trials" in errors, errors
    assert not os.path.exists(os.path.join(folder, "choice.json"))
    assert "for all series: " in harness.succeed(*command, "--skip-existing").stderr
    assert read(folder, "choice.json") == read(once, "choice.json")
    for name in NAMES:
        assert harness.read_bytes(os.path.join(folder, name + ".mrc")) == \
            harness.read_bytes(os.path.join(once, name + ".mrc"))


@pytest.mark.parametrize("stated", (["--spike-rank", 3], ["--prior", "tv"]))
def test_series_that_state_a_part_of_the_choice_go_on(data, stated):
    folder = harness.fresh_directory("choice_partly_stated")
    command = ["batch", *pattern(data), *harness.merge(OPEN, ["--epochs", 100]), *stated, "--checkpoint-minutes", 0,
               "--at-once", 1, "-o", folder]
    run = harness.start(*command)
    while run.poll() is None and not any(name.endswith(".h5") for name in os.listdir(folder)):
        time.sleep(0.02)
    run.send_signal(signal.SIGINT)
    _, errors = run.communicate(timeout=60)
    assert run.returncode == 130, errors
    before = commands(folder)
    harness.succeed(*command, "--skip-existing")
    assert commands(folder) == before


def test_a_task_of_slurm_without_the_common_choice_says_so(data):
    folder = harness.fresh_directory("choice_missing")
    environment = fake_sbatch(folder, "55\\n")
    harness.succeed("batch", *pattern(data), *OPEN, "--slurm", "-o", folder, env=environment)
    task = subprocess.run(["sh", os.path.join(folder, "batch.sbatch")], capture_output=True, text=True,
                          env={**environment, "SLURM_ARRAY_TASK_ID": "1"}, timeout=120, check=False)
    assert task.returncode == 0 and "has not made its choice" in task.stderr, task


def test_the_one_series_that_is_left_without_a_choice_is_named(data, each):
    """Without choice.json there is nobody to share a new choice with."""
    folder = harness.fresh_directory("choice_left")
    for name in "ab":
        for ending in (".mrc", ".json"):
            with open(os.path.join(folder, name + ending), "wb") as file:
                file.write(harness.read_bytes(os.path.join(each, name + ending)))
    said = harness.succeed("batch", *pattern(data), *OPEN, "--skip-existing", "--dry-run", "-o",
                           folder).stdout
    assert "c alone is left to choose" in said and "trials of" not in said, said


def test_a_damaged_choice_is_refused_with_what_to_do(data, once):
    folder = harness.fresh_directory("choice_damaged")
    stored = read(once, "choice.json")
    for damaged, fact in ((json.dumps({**stored, "votes": []}), "'votes'"),
                          (json.dumps(stored)[:-1], "line 1")):
        with open(os.path.join(folder, "choice.json"), "w", encoding="utf-8") as file:
            file.write(damaged)
        run = harness.tomofield("batch", *pattern(data), *OPEN, "--skip-existing", "-o", folder)
        assert run.returncode == 2 and os.listdir(folder) == ["choice.json"], run.stderr
        for part in ("choice.json", fact, "remove it"):
            assert part in run.stderr, run.stderr
        assert "exception" not in run.stderr, run.stderr  # the words of the JSON library


def test_a_run_writes_what_its_trials_choose_and_does_not_fit(data):
    folder = harness.fresh_directory("choice_alone_run")
    choice = os.path.join(folder, "choice.json")
    command = ["reconstruct", os.path.join(data, "a.mrc"), "--tlt", os.path.join(data, "a.tlt"),
               *OPEN, "-o", os.path.join(folder, "a.mrc"), "--choice", choice]
    harness.succeed(*command)
    assert os.listdir(folder) == ["choice.json"]
    found = read(folder, "choice.json")
    assert found["chosen"]["tv"] > 0 and len(found["trials"]) >= 4
    refused = harness.tomofield(*command)
    assert refused.returncode == 2 and "--choice" in refused.stderr
    harness.succeed(*command, "--overwrite", "--tv", 3, "--black-level", 0, "--bead-diameter", 0)
    assert read(folder, "choice.json") is None  # nothing is left to trials
