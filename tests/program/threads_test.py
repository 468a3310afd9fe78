"""Tests the number of threads, what the program says of it, and that threads do not wait for each
other busily on a machine that has other work."""

import contextlib
import json
import os
import subprocess

import pytest

import harness

SIZE, THICKNESS = 128, 75
FIT = ["--thickness", THICKNESS, "--contrast", "bright", "--no-margin", "--tv-penalty", "smooth",
       "--coarse-epochs", 8, "--vertex-epochs", 6, "--epochs", 6]
COMPETITORS = 2
BUSY = "import os, sys\nos.sched_setaffinity(0, {int(sys.argv[1])})\nwhile True: pass"


@pytest.fixture(scope="module")
def series():
    """Returns a small simulated series."""
    return harness.Series("series")


def said_threads(series, *options, **keywords):
    """Runs a quick fit. Returns its number of threads and the reason, which the log has too."""
    output = os.path.join(harness.fresh_directory("said"), "out.mrc")
    run = harness.succeed("reconstruct", *series.input, *harness.QUICK, "-o", output, *options,
                          **keywords)
    with open(output.replace(".mrc", ".json"), encoding="utf-8") as file:
        metrics = json.load(file)["metrics"]
    assert metrics["threads_why"] + "\n" in run.stderr, (metrics, run.stderr)
    return metrics["threads"], metrics["threads_why"]


def without_number():
    """Returns the environment without a number of threads."""
    return {name: value for name, value in os.environ.items() if name != "OMP_NUM_THREADS"}


def test_run_says_how_many_threads_it_has_and_why(series):
    number, reason = said_threads(series, "--threads", 3)
    assert number == 3 and reason.startswith("3 threads, as asked for; "), reason
    number, reason = said_threads(series, env={**os.environ, "OMP_NUM_THREADS": "2"})
    assert number == 2 and reason.startswith("2 threads, as OMP_NUM_THREADS says; "), reason
    one = min(os.sched_getaffinity(0))
    number, reason = said_threads(series, env=without_number(),
                                  preexec_fn=lambda: os.sched_setaffinity(0, {one}))
    assert number == 1 and reason.startswith("1 thread, "), reason
    if os.cpu_count() > 1 and "control group" not in reason:
        assert reason.startswith(f"1 thread, as the affinity mask allows 1 of {os.cpu_count()} "), reason


def test_baselines_say_it_too(series):
    output = os.path.join(harness.fresh_directory("baseline"), "out.mrc")
    run = harness.succeed("baseline", "sirt", *series.input, "--thickness", harness.THICKNESS,
                          "--contrast", "bright", "--no-margin", "--iterations", 1, "--threads", 2,
                          "-o", output)
    with open(output.replace(".mrc", ".json"), encoding="utf-8") as file:
        metrics = json.load(file)["metrics"]
    assert metrics["threads"] == 2 and "2 threads, as asked for; " in run.stderr, run.stderr
    assert metrics["threads_why"] + "\n" in run.stderr, metrics


# All terms of the loss, margins, trials, held-out views and every kind of stage are in it.
def test_bytes_are_the_same_for_any_number_of_threads(series):
    with_margin = [word for word in harness.QUICK if word != "--no-margin"]
    options = ["--leaf-size", 32, "--tv-penalty", "auto", "--tv-factors", 0.5, "--bcc", 5, "--ifp", 0.2,
               "--hold-out", 5, "--epochs", 3, "--vertex-epochs", 2, "--coarse-epochs", 2]
    runs = []
    for threads in (1, 2, 3, 4, 8):
        output = os.path.join(harness.fresh_directory(f"threads{threads}"), "out.mrc")
        harness.succeed("reconstruct", *series.input, *harness.merge(with_margin, options), "-o",
                        output, "--threads", threads)
        runs.append(harness.Results(output))
        assert runs[0].same_as(runs[-1]), threads


@contextlib.contextmanager
def competitors(processor):
    """Keeps a processor busy with other programs."""
    running = [subprocess.Popen(["/usr/bin/python3", "-c", BUSY, str(processor)])
               for _ in range(COMPETITORS)]
    try:
        yield
    finally:
        for one in running:
            one.kill()
            one.wait()


def processor_seconds(command, processors):
    """Runs a command on some processors and returns the processor time that it took."""
    run = subprocess.Popen([*map(str, command)], stdout=subprocess.DEVNULL,
                           stderr=subprocess.PIPE, text=True,
                           preexec_fn=lambda: os.sched_setaffinity(0, processors))
    errors = run.stderr.read()
    _, status, usage = os.wait4(run.pid, 0)
    run.returncode = os.waitstatus_to_exitcode(status)
    assert run.returncode == 0, errors
    return usage.ru_utime + usage.ru_stime


# Threads that wait busily burn the time of their processor until the slowest of them is done. On
# two processors, of which others take two thirds of one, that made two threads take 3.7 times the
# processor time of one. The clock would measure the other programs as well.
def test_threads_that_wait_for_slower_ones_sleep():
    processors = sorted(os.sched_getaffinity(0))[:2]
    if len(processors) < 2:
        pytest.skip("there is one processor")
    folder = harness.fresh_directory("busy")
    cell = os.path.join(folder, "cell")
    harness.succeed("simulate", cell, "--yardstick", "a", "--size", SIZE, "--thickness", THICKNESS,
                    "--noise", 0.05)
    command = [harness.PROGRAM, "reconstruct", os.path.join(cell, "tilt_series.mrc"), "--tlt",
               os.path.join(cell, "tilt_series.tlt"), *FIT, "-o", os.path.join(folder, "out.mrc"),
               "--overwrite", "--threads"]
    with competitors(processors[0]):
        alone = processor_seconds([*command, 1], processors)
        for threads in (2, 8):
            shared = processor_seconds([*command, threads], processors)
            print(f"{threads} threads: {shared:.2f} s of processor time, one thread: {alone:.2f} s")
            assert alone > 0.5 and shared < 2 * alone, (threads, shared, alone)
