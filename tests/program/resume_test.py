"""Tests --resume after runs of reconstruct that were killed or stopped, and damaged checkpoints."""

import glob
import os
import random
import signal
import time

import h5py
import numpy as np
import pytest

import harness
from harness import read_bytes

PRIORS = ["--tv-factors", 0.5, "--bcc", 5, "--ifp", 0.2]  # beside the default
FIT = harness.merge(harness.QUICK, ["--rank", 3, "--epochs", 5, *PRIORS])
NUM_STEPS = 5 * 7
EVERY_STEP = ["--checkpoint-minutes", 0]


@pytest.fixture(scope="module")
def series():
    """Returns a small simulated series."""
    return harness.Series("series")


@pytest.fixture(scope="module", name="command")
def make_command(series):
    def command(results, *options):
        return ["reconstruct", *series.input, "-o", results.volume_path,
                *harness.merge(FIT, options)]

    return command


@pytest.fixture(scope="module")
def undisturbed(command):
    """Returns the results of an undisturbed run, and in `duration` the seconds that it took."""
    results = harness.fresh_results("undisturbed")
    began = time.monotonic()
    harness.succeed(*command(results, *EVERY_STEP))
    results.duration = time.monotonic() - began
    assert not results.leftovers(), results.leftovers()
    return results


def wait_for(condition, run):
    """Waits until a condition holds or the run ends, and returns true if it still runs."""
    while run.poll() is None:
        if condition():
            return True
        time.sleep(0.0002)
    return False


def kill(run):
    run.kill()
    run.communicate()
    return run.returncode == -signal.SIGKILL


@pytest.fixture(scope="module", name="interrupted")
def make_interrupted(command):
    def interrupted(results, kill_when, most=40):
        """Starts a run, kills and resumes it until it ends, and returns how often it was killed."""
        kills = 0
        while kills < most:
            run = harness.start(*command(results, *EVERY_STEP, "--resume"))
            if wait_for(kill_when(kills), run) and kill(run):
                kills += 1
                continue
            _, errors = run.communicate()
            assert run.returncode == 0, errors
            return kills
        harness.succeed(*command(results, *EVERY_STEP, "--resume"))
        return kills

    return interrupted


def test_killed_at_random_moments(interrupted, undisturbed):
    chance = random.Random(5)

    def kill_when(kills):
        moment = time.monotonic() + chance.uniform(0.05, 0.5) * undisturbed.duration
        return lambda: time.monotonic() > moment

    for _ in range(5):  # a run may be much quicker than the one that was timed
        results = harness.fresh_results("random")
        if kills := interrupted(results, kill_when, most=6):
            break
    assert kills > 0
    assert results.same_as(undisturbed)
    assert not results.leftovers(), results.leftovers()


def test_killed_in_the_middle_of_writing(interrupted, undisturbed):
    for written in ("out.h5", "out.mrc", "out.json", "out_xz.png"):
        results = harness.fresh_results("writing")
        pattern = os.path.join(os.path.dirname(results.volume_path), f".{written}.tmp-*")
        seen = set()

        def kill_when(kills):
            # An empty file comes first, which proves that the directory is writable.
            def being_written():
                for path in glob.glob(pattern):
                    try:
                        if os.path.getsize(path) > 0 and path not in seen:
                            seen.add(path)
                            return True
                    except FileNotFoundError:
                        pass
                return False
            return being_written

        kills = interrupted(results, kill_when, most=3)
        print(f"{written}: killed {kills} times")
        assert results.same_as(undisturbed), written
        assert not results.leftovers(), results.leftovers()
        if written == "out.h5":
            assert kills > 0, "no moment was caught"


@pytest.fixture(scope="module", name="stopped_run")
def make_stopped_run(command):
    def stopped_run(name, number=signal.SIGTERM, *options):
        """Returns results that are only a checkpoint, the run that a signal stopped, and what it
        said. No checkpoint falls due before the signal."""
        for _ in range(10):
            results = harness.fresh_results(name)
            run, errors = harness.stop_after_first_step(command(results, *options), number)
            if run.returncode != 0:  # else it was too quick for us
                return results, run, errors
        raise AssertionError("every run ended before its signal")

    return stopped_run


def test_signals_leave_a_checkpoint(command, stopped_run, undisturbed):
    for number, status in ((signal.SIGINT, 130), (signal.SIGTERM, 143)):
        results, run, errors = stopped_run("signal", number)
        assert run.returncode == status, (run.returncode, errors)
        assert "--resume" in errors and results.model_path in errors, errors
        assert os.listdir(os.path.dirname(results.model_path)) == ["out.h5"]
        with h5py.File(results.model_path) as model:
            step = model["training/integers/step"][0]
            assert 0 < step < NUM_STEPS and "adam_m" in model["training/floats"], step
        resumed = harness.succeed(*command(results, "--resume"))
        assert f"step {step} of {NUM_STEPS}" in resumed.stderr, resumed.stderr
        assert results.same_as(undisturbed)


@pytest.fixture(scope="module", name="refuse")
def make_refuse(command, series):
    def refuse(results, words, *options, input=None):
        """Checks that resuming is refused for this reason and that the files stay as they are."""
        folder = os.path.dirname(results.model_path)
        before = {path: read_bytes(path) for path in glob.glob(folder + "/*")}
        arguments = command(results, "--resume", *options)
        if input:
            arguments[1 : 1 + len(series.input)] = input
        result = harness.tomofield(*arguments)
        assert result.returncode == 2, (words, result)
        complaint = result.stderr.splitlines()[-1]
        for word in [results.model_path, "--overwrite", *words]:
            assert word in complaint, (word, complaint)
        after = {path: read_bytes(path) for path in glob.glob(folder + "/*")}
        assert after == before and not results.leftovers(), words

    return refuse


def test_torn_checkpoints_are_refused(command, refuse, stopped_run, undisturbed):
    results, _, _ = stopped_run("torn")
    whole = read_bytes(results.model_path)
    for length in (0, 5, 100, 2048, len(whole) // 3, len(whole) - 4096, len(whole) - 1):
        with open(results.model_path, "wb") as file:
            file.write(whole[:length])
        refuse(results, [])
    # The file has its length, but a page never reached the disk.
    middle = len(whole) // 2
    with open(results.model_path, "wb") as file:
        file.write(whole[:middle] + bytes(4096) + whole[middle + 4096 :])
    refuse(results, ["damaged"])
    with open(results.model_path, "wb") as file:
        file.write(whole)
    harness.succeed(*command(results, "--resume"))
    assert results.same_as(undisturbed)


def test_foreign_checkpoints_are_refused(command, refuse, series, stopped_run, undisturbed):
    results, _, _ = stopped_run("foreign")
    refuse(results, ["--seed"], "--seed", 2)
    refuse(results, ["--thickness"], "--thickness", 22)
    refuse(results, ["--rank"], "--rank", 4)
    refuse(results, ["--field"], "--field", "grid")
    refuse(results, ["--epochs"], "--epochs", 6)
    refuse(results, ["the tilt series"], "--exclude", 3)
    refuse(results, ["the tilt series"], input=series.with_views("tilted", series.views,
                                                          harness.TILTS + 1).input)
    views = series.views.copy()
    views[5, 7, 9] += 0.01
    refuse(results, ["the tilt series"], input=series.with_views("changed", views).input)
    # The type of the volume's voxels and the place of the series do not change the fit.
    moved = series.with_views("moved", series.views)
    arguments = command(results, "--resume", "--mode", 12)
    arguments[1 : 1 + len(series.input)] = moved.input
    harness.succeed(*arguments)
    np.testing.assert_allclose(results.volume, undisturbed.volume, rtol=6e-4, atol=1e-6)

    with h5py.File(results.model_path, "w") as file:
        file["density"] = np.arange(10.0)
    refuse(results, ["no model of tomofield"])
    with open(results.model_path, "w") as file:
        file.write("a list of things to do\n" * 100)
    refuse(results, ["HDF5"])
    os.remove(results.model_path)
    os.mkdir(results.model_path)
    result = harness.tomofield(*command(results, "--resume"))
    assert result.returncode == 2 and results.model_path in result.stderr, result


def test_resume_without_a_checkpoint_starts_from_the_beginning(command, undisturbed):
    results = harness.fresh_results("beginning")
    result = harness.succeed(*command(results, "--resume"))
    assert "from the beginning" in result.stderr, result.stderr
    assert results.same_as(undisturbed)
    # A file that somebody else put there is no result of a run to resume.
    results = harness.fresh_results("others")
    with open(results.volume_path, "w") as file:
        file.write("another volume")
    result = harness.tomofield(*command(results, "--resume"))
    assert result.returncode == 2 and results.volume_path in result.stderr, result
    assert read_bytes(results.volume_path) == b"another volume"


def test_what_a_killed_run_leaves_before_its_first_checkpoint_is_replaced(command, undisturbed):
    """A run that chooses by trials draws their pictures before its first checkpoint."""
    results = harness.fresh_results("killed_early")
    with open(results.pictures["xy"], "w", encoding="ascii") as file:
        file.write("a picture")
    said = harness.tomofield(*command(results, "--resume"))
    assert said.returncode == 2 and "no checkpoint to resume" in said.stderr, said.stderr
    folder, name = os.path.split(results.volume_path)
    with open(os.path.join(folder, f".{name}.tomofield-lock"), "w", encoding="ascii") as file:
        file.write("process 1 on another machine since yesterday")
    harness.succeed(*command(results, "--resume"))
    assert results.same_as(undisturbed) and not results.leftovers()


def test_a_run_that_is_stopped_after_its_alignment_is_told_how_to_go_on():
    series = harness.Series("aligned")
    output = os.path.join(series.directory, "aligned.mrc")
    run = harness.start("reconstruct", *series.input, "--thickness", harness.THICKNESS, "--contrast", "bright",
                        "--bead-diameter", 0, "--align", "refine", "--epochs", 2000, "-o", output)
    while run.poll() is None and not os.path.exists(output.replace(".mrc", "_align.json")):
        time.sleep(0.01)
    run.send_signal(signal.SIGINT)
    _, errors = run.communicate(timeout=60)
    assert run.returncode == 130 and "and --resume" in errors, errors


@pytest.mark.parametrize("stored, options", (("_align.json", ["--align", "refine"]), ("_tune.json", ["--tune"])))
def test_a_run_over_older_results_goes_on_from_what_it_stored_before_its_first_checkpoint(stored, options):
    """The older model has other options, and must not count as a checkpoint."""
    series = harness.Series("older")
    output = os.path.join(series.directory, "older.mrc")
    command = ["reconstruct", *series.input, "--thickness", harness.THICKNESS, "--contrast", "bright",
               "--bead-diameter", 0, "--prior", "tv", "-o", output, *options]
    harness.succeed(*command, "--epochs", 1, "--rank", 2)
    prefix = output.removesuffix(".mrc")
    old = read_bytes(prefix + stored)
    run = harness.start(*command, "--epochs", 30, "--view-scale", "off", "--seed", 7, "--overwrite")
    assert wait_for(lambda: os.path.exists(prefix + stored) and read_bytes(prefix + stored) != old, run)
    run.send_signal(signal.SIGINT)
    _, errors = run.communicate(timeout=60)
    assert run.returncode == 130 and "--resume instead of --overwrite" in errors, errors
    harness.succeed(*command, "--epochs", 30, "--view-scale", "off", "--seed", 7, "--resume")


def test_resume_of_a_finished_run_writes_the_same_results(command, undisturbed):
    results = harness.fresh_results("finished")
    harness.succeed(*command(results))
    os.remove(results.volume_path)
    os.remove(results.pictures["yz"])
    result = harness.succeed(*command(results, "--resume"))
    assert f"step {NUM_STEPS} of {NUM_STEPS}" in result.stderr, result.stderr
    assert results.same_as(undisturbed)
    assert all(os.path.exists(path) for path in results.all_paths) and not results.leftovers()


def test_stopping_is_told_to_go_on_without_overwrite(stopped_run):
    results, run, errors = stopped_run("replaced", signal.SIGINT, "--overwrite")
    assert run.returncode == 130 and "--resume instead of --overwrite" in errors, errors
