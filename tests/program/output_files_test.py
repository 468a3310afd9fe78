"""Tests how results get their names: together, under a lock of the run, never over an input, and with
the permissions of the files that they replace."""

import os
import resource
import shutil
import signal
import socket
import stat
import subprocess
import tempfile

import pytest

import harness
from harness import PROGRAM, QUICK, THICKNESS, contents, read_bytes

SPECIMEN = ["--thickness", THICKNESS, "--contrast", "bright", "--no-margin"]
LONG = harness.merge(QUICK, ["--epochs", 100000, "--checkpoint-minutes", 1000])


@pytest.fixture(scope="module")
def series():
    """Returns a small simulated series."""
    return harness.Series("series")


@pytest.fixture(scope="module")
def fitted(series):
    """Returns the results of a reconstruction."""
    return series.reconstruct("fitted")


@pytest.fixture(scope="module")
def commands(series, fitted):
    """Returns a function that returns every command that writes files, with its output and the name
    of one of its results there."""
    def commands(folder):
        out = os.path.join(folder, "out.mrc")
        return {
            "reconstruct": (["reconstruct", *series.input, *QUICK, "-o", out], "out.json"),
            "baseline": (["baseline", "wbp", *series.input, *SPECIMEN, "-o", out], "out.json"),
            "tensorf": (["baseline", "tensorf", *series.input, *SPECIMEN, "--rank", 4, "--epochs", 2,
                         "--coarse-epochs", 2, "-o", out], "out.h5"),
            "export": (["export", fitted.model_path, "-o", out], "out.mrc"),
            "evaluate": (["evaluate", fitted.volume_path, "--fsc", fitted.volume_path, "--fsc-csv",
                          os.path.join(folder, "out.csv"), "--json",
                          os.path.join(folder, "out.json")], "out.csv"),
            "simulate": (["simulate", folder, "--size", 24, "--thickness", 16, "--tilts=-40:40:20"],
                         "tilt_series.tlt")}
    return commands


NAMES = ["reconstruct", "baseline", "tensorf", "export", "evaluate", "simulate"]


def refused(folder, facts, command, **keywords):
    """Checks that a command is refused for a reason with these facts and leaves no trace."""
    before = contents(folder)
    result = harness.tomofield(*command, **keywords)
    assert result.returncode == 2, result
    for fact in facts:
        assert fact in result.stderr.splitlines()[-1], (fact, result.stderr)
    assert contents(folder) == before


def long_run(series, folder, *options, **keywords):
    """Starts a run that does not end by itself, and returns it after its first step."""
    command = ["reconstruct", *series.input, *LONG, "-o", os.path.join(folder, "out.mrc"), *options]
    run = harness.start(*command, **keywords)
    for line in run.stderr:
        if line.startswith("reconstruct "):
            return run
    raise AssertionError(run.communicate())


def stop(run):
    run.send_signal(signal.SIGTERM)
    _, errors = run.communicate()
    assert run.returncode == 143, errors


def test_a_second_run_into_an_output_is_refused(series, commands):
    folder = harness.fresh_directory("locked")
    run = long_run(series, folder)
    for name in ("reconstruct", "baseline", "tensorf", "export", "evaluate"):
        for options in ([], ["--overwrite"]):
            refused(folder, [f"process {run.pid} ", socket.gethostname(), "since 2", "out."],
                    [*commands(folder)[name][0], *options])
    refused(folder, [f"process {run.pid} "], [*commands(folder)["reconstruct"][0], "--resume"])
    harness.succeed(*commands(folder)["simulate"][0])  # has other files
    other = commands(folder)["baseline"][0][:-1] + [os.path.join(folder, "other.mrc")]
    harness.succeed(*other)
    harness.succeed(*commands(folder)["reconstruct"][0], "--dry-run")
    stop(run)
    assert not [name for name in os.listdir(folder) if name.startswith(".")]
    resumed = long_run(series, folder, "--resume")
    stop(resumed)


def test_the_lock_of_a_killed_run_blocks_nobody(series, commands):
    folder = harness.fresh_directory("stale")
    run = long_run(series, folder)
    run.kill()
    run.communicate()
    assert [name for name in os.listdir(folder) if name.endswith("-lock")]
    harness.succeed(*commands(folder)["reconstruct"][0])
    assert not [name for name in os.listdir(folder) if name.startswith(".")]


def can_unshare():
    return shutil.which("unshare") and subprocess.run(
        ["unshare", "--pid", "--fork", "--mount-proc", "true"], capture_output=True).returncode == 0


def test_runs_of_other_containers_keep_their_temporary_files(series, commands):
    if not can_unshare():
        pytest.skip("this user cannot make PID namespaces")
    folder = harness.fresh_directory("namespaces")
    command = commands(folder)["reconstruct"][0]
    # A fork holds the files of a run as they are while it writes.
    held = os.path.join(folder, ".out.mrc.tmp-4000000-0")
    run = long_run(series, folder)
    with open(held, "w") as file:
        file.write("half a volume")
    elsewhere = ["unshare", "--pid", "--fork", "--mount-proc", PROGRAM]
    dry = subprocess.run([*elsewhere, *map(str, command), "--dry-run"], capture_output=True)
    assert dry.returncode == 0, dry
    assert os.path.exists(held)
    second = subprocess.run([*elsewhere, *map(str, command)], capture_output=True, text=True)
    assert second.returncode == 2 and f"process {run.pid} " in second.stderr, second
    assert os.path.exists(held)
    stop(run)
    harness.succeed(*command, "--overwrite")
    assert not os.path.exists(held)


def test_a_file_system_without_locks_is_written_with_a_warning(commands, scratch):
    compiler = shutil.which("cc")
    if not compiler or harness.is_sanitized():
        pytest.skip("flock() cannot be replaced here")
    library = scratch / "no_locks.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-x", "c", "-", "-o", library], check=True,
                   text=True, input="#include <errno.h>\nint flock(int f, int o)"
                                    "{ (void)f; (void)o; errno = ENOLCK; return -1; }\n")
    folder = harness.fresh_directory("no_locks")
    of_another = os.path.join(folder, ".out.mrc.tmp-4000000-0")
    with open(of_another, "w") as file:
        file.write("half a volume")
    environment = dict(os.environ, LD_PRELOAD=str(library))
    result = harness.succeed(*commands(folder)["reconstruct"][0], env=environment)
    assert result.stderr.count("has no locks") == 1, result.stderr
    hidden = [name for name in os.listdir(folder) if name.startswith(".")]
    assert hidden == [os.path.basename(of_another)], "nobody knows whose it is"
    harness.succeed("info", os.path.join(folder, "out.h5"), env=environment)


def with_room_for(num_bytes):
    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (num_bytes, num_bytes))
    return {"preexec_fn": limit, "restore_signals": False}


@pytest.mark.parametrize("name", NAMES)
def test_results_appear_together_or_not_at_all(commands, name):
    folder = harness.fresh_directory("together")
    command, last = commands(folder)[name]
    harness.succeed(*command)
    made = contents(folder)
    sizes = sorted(len(data) for data in made.values())
    limits = sorted({0, *(size - 1 for size in sizes if size > 0)})
    for limit in limits:  # with old results and without: an ever fuller disk
        refused_with_model(folder, command, limit, "--overwrite")
        empty = harness.fresh_directory("together_new")
        refused_with_model(empty, commands(empty)[name][0], limit)
    # A name that cannot be had any more is found before anything is written.
    os.remove(os.path.join(folder, last))
    os.mkdir(os.path.join(folder, last))
    refused(folder, [last], [*command, "--overwrite"])


def refused_with_model(folder, command, limit, *options):
    """Checks that nothing changes in a folder if files cannot be larger than a limit. The model of
    a fit may appear, and then the message says so."""
    before = contents(folder)
    result = harness.tomofield(*command, *options, **with_room_for(limit))
    assert result.returncode == 2, (limit, result)
    after = contents(folder)
    if "--resume writes the results" in result.stderr:
        model = os.path.join(folder, "out.h5")
        assert model in result.stderr and model in after
        before[model] = after[model]
    assert after == before, (limit, sorted(set(after) ^ set(before)))


def test_a_finished_fit_is_kept_when_its_results_cannot_be_written(series):
    coarse = ["--field", "grid", "--vertex-spacing", 4]
    whole = series.reconstruct("whole", *coarse)
    room = os.path.getsize(whole.model_path)
    assert room < os.path.getsize(whole.volume_path)
    results = harness.fresh_results("kept")
    command = ["reconstruct", *series.input, *harness.merge(QUICK, coarse), "-o",
               results.volume_path]
    ended = harness.tomofield(*command, **with_room_for(room))
    assert ended.returncode == 2 and "--resume" in ended.stderr, ended
    assert os.listdir(os.path.dirname(results.model_path)) == ["out.h5"]
    harness.succeed(*command, "--resume")
    assert results.same_as(whole)


OTHER_USER = 12345


def test_a_run_that_overwrites_another_leaves_none_of_its_pictures(series):
    folder = harness.fresh_directory("overwritten")
    out = ["-o", os.path.join(folder, "out.mrc"), "--overwrite"]
    plain = ["reconstruct", *series.input, *QUICK, *out]
    harness.succeed(*plain)
    expected = set(os.listdir(folder))
    chosen = [word for word in QUICK if word not in ("--tv-penalty", "concave")]
    for more, files in ((["--hold-out", 6], {"out_choice.png", "out_denoise.png", "out_held_out.png"}),
                        (["--tv", 3, "--split-tilts"], {"out_fsc.png"})):
        harness.succeed("reconstruct", *series.input, *chosen, *more, *out)
        assert files <= set(os.listdir(folder)) - expected, more
        said = harness.succeed(*plain).stderr
        assert {name for name in set(os.listdir(folder)) - expected if name.endswith(".png")} == set()
        assert all(file in said for file in files), said
    with open(os.path.join(folder, "out_report.html"), encoding="utf-8") as file:
        assert "was given to this run" in file.read(), "why there is no picture of the dial"


def test_a_run_of_too_few_views_for_trials_leaves_no_picture_of_earlier_trials(series):
    folder = harness.fresh_directory("few_views")
    command = ["reconstruct", *series.input, "--thickness", harness.THICKNESS, "--contrast", "bright",
               "--no-margin", "--epochs", 2, "-o", os.path.join(folder, "out.mrc"), "--overwrite"]
    harness.succeed(*command)
    pictures = {"out_denoise.png", "out_prior.png"}
    assert pictures <= set(os.listdir(folder))
    harness.succeed(*command, "--exclude", f"1-{len(harness.TILTS) - 11}")
    assert not pictures & set(os.listdir(folder))


def test_too_few_views_for_trials_are_said(series):
    command = ["reconstruct", *series.input, "--thickness", harness.THICKNESS, "--contrast", "bright",
               "--no-margin", "--dry-run"]
    few = harness.succeed(*command, "--exclude", f"1-{len(harness.TILTS) - 11}")
    assert "11 views are too few for trials, which leave some of them out and need 12" in few.stderr
    enough = harness.succeed(*command, "--exclude", f"1-{len(harness.TILTS) - 12}")
    assert "too few" not in enough.stderr and "short trials first" in enough.stdout
    # Stages with the prior are of those who may have it.
    assert "epochs: 80 of pixels 4 x 4, 80 of pixels 2 x 2, 10 at full resolution\n" in few.stdout
    assert "5 at full resolution, 3 at full resolution\n" in enough.stdout


def test_resume_is_offered_only_where_there_is_something_to_resume(series):
    output = os.path.join(harness.fresh_directory("offered"), "out.mrc")
    command = ["reconstruct", *series.input, *QUICK, "-o", output]
    shutil.copy(series.tlt, output)  # a volume of somebody, without a model
    refused = harness.tomofield(*command)
    assert refused.returncode == 2 and "give --overwrite to replace it, or another" in refused.stderr
    harness.succeed(*command, "--overwrite")
    refused = harness.tomofield(*command)
    assert refused.returncode == 2 and "--resume to continue the run that made it" in refused.stderr


def test_a_run_that_overwrites_another_keeps_volumes_and_records(series):
    folder = harness.fresh_directory("overwritten_files")
    names = ("out_EVN_Vol.mrc", "out_tune.json", "out_align.xf", "out_alignment.json")
    for name in names:
        shutil.copy(series.tlt, os.path.join(folder, name))
    harness.succeed("reconstruct", *series.input, *QUICK, "--overwrite", "-o",
                    os.path.join(folder, "out.mrc"))
    for name in names:
        assert read_bytes(os.path.join(folder, name)) == read_bytes(series.tlt)


@pytest.mark.parametrize("ending", ["_fsc.png", "_prior.png", "_denoise.png", "_choice.png"])
def test_an_input_called_like_a_picture_stays(series, ending):
    folder = harness.fresh_directory("pictures" + ending)
    tilts = os.path.join(folder, "out" + ending)
    shutil.copy(series.tlt, tilts)
    command = ["reconstruct", *harness.merge(series.input, ["--tlt", tilts]), *QUICK, "--overwrite",
               "-o", os.path.join(folder, "out.mrc")]
    refused(folder, ["input", tilts], command)
    harness.succeed(*harness.merge(command, ["--tlt", series.tlt]))
    assert read_bytes(tilts) == read_bytes(series.tlt), "it is no picture"


def can_be_run_by_another_user():
    try:
        return harness.tomofield("--version", user=OTHER_USER).returncode == 0
    except PermissionError:
        return False


def test_files_of_others_in_a_sticky_folder_are_refused_at_once():
    if not can_be_run_by_another_user():
        pytest.skip("only root can be two users, and both must reach the program")
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o1777)
        command = ["simulate", folder, "--size", 24, "--thickness", 16, "--tilts=-40:40:20"]
        theirs = os.path.join(folder, "phantom.json")
        with open(theirs, "w") as file:
            file.write("theirs")
        refused(folder, [theirs, "another user"], [*command, "--overwrite"], user=OTHER_USER)
        os.remove(theirs)
        harness.succeed(*command, user=OTHER_USER)
        harness.succeed(*command, "--overwrite", user=OTHER_USER)


@pytest.mark.parametrize("name", NAMES)
def test_the_configuration_is_an_input(commands, name):
    folder = harness.fresh_directory("config")
    command, result = commands(folder)[name]
    config = os.path.join(folder, result)
    with open(config, "w") as file:
        file.write("")
    refused(folder, ["input", config], [*command, "--config", config, "--overwrite"])


def test_the_model_beside_a_volume_is_an_input_of_evaluate(fitted):
    refused(os.path.dirname(fitted.model_path), ["input", fitted.model_path],
            ["evaluate", fitted.volume_path, "--json", fitted.model_path, "--overwrite"])


@pytest.mark.parametrize("name", NAMES)
def test_results_keep_the_permissions_of_what_they_replace(commands, name):
    folder = harness.fresh_directory("permissions")
    command, _ = commands(folder)[name]
    harness.succeed(*command)
    names = sorted(os.listdir(folder))
    modes = {path: (0o600, 0o640, 0o664, 0o444)[i % 4] for i, path in enumerate(names)}
    for path, mode in modes.items():
        os.chmod(os.path.join(folder, path), mode)
    harness.succeed(*command, "--overwrite")
    assert modes == {path: stat.S_IMODE(os.stat(os.path.join(folder, path)).st_mode)
                     for path in sorted(os.listdir(folder))}
