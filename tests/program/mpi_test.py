"""Tests reconstruct on several processes that mpirun starts: it writes the bytes of one process,
its checkpoints serve any number of processes, and it names faults once."""

import glob
import json
import os
import shutil
import signal
import subprocess
import time

import h5py
import numpy as np
import pytest

import harness
from harness import read_bytes

# Processes share the cores of one machine, and a container may forbid what the last line turns off.
MPI = {"OMP_NUM_THREADS": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
       "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_mpi_yield_when_idle": "1",
       "OMPI_MCA_btl_vader_single_copy_mechanism": "none"}
ROWS, COLUMNS, THICKNESS = 120, 40, 16  # rows end in the middle of a slab and of a root cell
PRIORS = ["--tv-factors", 0.5, "--bcc", 5, "--ifp", 0.2]
LEARNED = ["--field", "grid", "--tv-penalty", "smooth", "--prior", "learned"]
FIT = harness.merge(harness.QUICK, ["--thickness", THICKNESS, "--rank", 3, "--epochs", 4, *PRIORS])


@pytest.fixture(scope="module", autouse=True)
def mpi():
    """Sets the environment of mpirun, or skips every test where there is no mpirun."""
    if shutil.which("mpirun") is None:
        pytest.skip("there is no mpirun")
    with pytest.MonkeyPatch.context() as environment:
        for name, value in MPI.items():
            environment.setenv(name, value)
        yield


def write_series(name, size, rows):
    """Writes a series of some rows and returns the arguments that hand it to reconstruct."""
    directory = harness.fresh_directory(name)
    cell = os.path.join(directory, "cell")
    harness.succeed("simulate", cell, "--size", size, "--thickness", THICKNESS, "--seed", 3,
                    "--tilts=-60:60:6", "--noise", 0.03)
    first = (size - COLUMNS) // 2
    views = harness.read_volume(os.path.join(cell, "tilt_series.mrc"))
    stack, tlt = os.path.join(directory, "series.mrc"), os.path.join(directory, "series.tlt")
    harness.write_stack(stack, views[:, :rows, first:first + COLUMNS].astype(np.float32))
    np.savetxt(tlt, harness.TILTS, fmt="%.1f")
    return [stack, "--tlt", tlt]


@pytest.fixture(scope="module")
def series():
    return write_series("series", 128, ROWS)


@pytest.fixture(scope="module", name="command")
def make_command(series):
    def command(results, *options, input=series, fit=FIT):
        return ["reconstruct", *input, "-o", results.volume_path, *harness.merge(fit, options)]

    return command


def start(processes, *arguments):
    return subprocess.Popen(["mpirun", "-np", str(processes), harness.PROGRAM,
                             *map(str, arguments)],
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def mpirun(processes, *arguments):
    run = start(processes, *arguments)
    output, errors = run.communicate(timeout=120)
    return subprocess.CompletedProcess(arguments, run.returncode, output, errors)


def succeed(processes, *arguments):
    result = mpirun(processes, *arguments)
    assert result.returncode == 0, (arguments, result.returncode, result.stderr)
    return result


def metrics(results):
    with open(results.json_path) as file:
        found = json.load(file)["metrics"]
    for key in ("seconds", "processes", "threads", "threads_why"):  # of the run, not of the result
        found.pop(key)
    for key in ("seconds", "peak_GiB", "line"):
        found["verdict"].pop(key)
    if found["tuning"]:
        for trial in found["tuning"]["trials"] + found["tuning"]["last_trials"]:
            trial.pop("seconds")
    return found


# Sums over the bands are made in their order, whichever process computed them, so the bytes are the
# same.
def test_results_have_the_bytes_of_one_process(command):
    cases = {"vm": ([], (1, 2, 4)),
             "coarse": (["--field", "grid", "--leaf-size", 32, "--coarse-epochs", 3,
                         "--tv-penalty", "auto", "--mode", 1], (2,)),
             "vertices": (["--leaf-size", 32, "--vertex-epochs", 3, "--coarse-epochs", 2], (2,)),
             "tune": (["--field", "grid", "--epochs", 2, "--tune"], (2, 3)),
             "coarser": (["--field", "grid", "--leaf-size", 64, "--coarse-epochs", 4], (2,)),
             "filtered": (["--field", "grid", "--leaf-size", 32, "--coarse-epochs", 3, "--defocus", 3,
                           "--pixel-size", 8, "--dose-per-tilt", 2, "--hold-out", 5], (2,)),
             "learned": (LEARNED, (3, 4)),
             "learned filtered": ([*LEARNED, "--leaf-size", 32, "--coarse-epochs", 3, "--defocus", 3,
                                   "--pixel-size", 8, "--hold-out", 5], (2,)),
             "margin": (["--contrast", "dark", "--hold-out", 5, "--axes", "xzy", "--mode", 12],
                        (3,))}
    for name, (options, numbers) in cases.items():
        fit = [word for word in FIT if word != "--no-margin"] if name == "margin" else FIT
        alone = harness.fresh_results(name)
        harness.succeed(*command(alone, *options, fit=fit))
        for processes in numbers:
            shared = harness.fresh_results(f"{name}{processes}")
            result = succeed(processes, *command(shared, *options, fit=fit))
            assert shared.same_as(alone), (name, processes)
            assert metrics(shared) == metrics(alone), (name, processes)
            assert result.stdout.count("tomogram  ") == 1, result.stdout
            assert set(map(os.path.basename, glob.glob(os.path.dirname(shared.volume_path) + "/*"))) \
                == set(map(os.path.basename, glob.glob(os.path.dirname(alone.volume_path) + "/*")))


def test_halves_have_the_bytes_of_one_process(command, series):
    views = harness.read_volume(series[0]) / 2
    random = np.random.default_rng(6)
    halves = {}
    for half in ("even", "odd"):
        halves[half] = os.path.join(os.path.dirname(series[0]), half + ".mrc")
        harness.write_stack(halves[half],
                            (views + random.normal(0, 0.02, views.shape)).astype(np.float32))
    options = ["--even", halves["even"], "--odd", halves["odd"], "--view-scale", "on"]
    volumes = []
    for processes in (1, 2):
        results = harness.fresh_results(f"halves{processes}")
        succeed(processes, *command(results, *options))
        stem = results.volume_path[:-len(".mrc")]
        volumes.append([harness.read_bytes(stem + end) for end in (
            ".mrc", "_EVN_Vol.mrc", "_ODD_Vol.mrc", "_ODD.h5", "_uncertainty.mrc")])
    assert volumes[0] == volumes[1]
    refused = mpirun(2, *command(harness.fresh_results("linear"), *options, "--denoising-halves"))
    assert refused.returncode != 0 and "cannot share --denoising-halves yet" in refused.stderr


# Each process sees some of the views, and the pattern is what all of them have in common.
def test_a_fixed_pattern_has_the_bytes_of_one_process(command):
    random = np.random.default_rng(5)
    views = 100 + random.normal(size=(len(harness.TILTS), 64, 96)) + random.normal(size=96)
    views[:, 30, 50] += 3
    directory = harness.fresh_directory("fixed_pattern")
    stack, tlt = os.path.join(directory, "a.mrc"), os.path.join(directory, "a.tlt")
    harness.write_stack(stack, views.astype(np.float32))
    np.savetxt(tlt, harness.TILTS, fmt="%.1f")
    alone, shared = harness.fresh_results("pattern_alone"), harness.fresh_results("pattern_shared")
    harness.succeed(*command(alone, input=[stack, "--tlt", tlt]))
    succeed(2, *command(shared, input=[stack, "--tlt", tlt]))
    pattern = metrics(alone)["mask"]["fixed_pattern"]
    assert pattern["column_deviation"] > 0.5 and pattern["pixels"] == 1, pattern
    assert shared.same_as(alone) and metrics(shared) == metrics(alone)


# Three bands of 64 rows, the last of which is not full, are six pairs of slabs. Each of two processes
# works on three of them: the first one begins a band that the second one owns.
def test_a_divided_band_has_the_bytes_of_one_process(command):
    tall = write_series("tall_series", 192, 184)
    with_margin = [word for word in FIT if word != "--no-margin"]
    cases = {"grid": ["--field", "grid", "--leaf-size", 64],
             "factors": ["--field", "vm", "--leaf-size", 32, "--vertex-epochs", 2,
                         "--coarse-epochs", 2, "--hold-out", 5],
             "smooth": ["--field", "vm", "--leaf-size", 32, "--tv-penalty", "smooth"],
             "learned": [*LEARNED, "--leaf-size", 64]}
    for name, options in cases.items():
        alone, shared = harness.fresh_results(f"tall_{name}"), harness.fresh_results(f"tall_{name}2")
        harness.succeed(*command(alone, *options, input=tall, fit=with_margin))
        succeed(2, *command(shared, *options, input=tall, fit=with_margin))
        assert shared.same_as(alone), name
        assert metrics(shared) == metrics(alone), name
        with open(shared.json_path) as file:
            processes = json.load(file)["metrics"]["processes"]
        assert [(p["bands"], p["rows"]) for p in processes] == [(1, 96), (2, 88)], processes


# Each process looks for spots in its own views, and all must find the same tracks.
def test_processes_find_the_beads_together(command):
    cell = os.path.join(harness.fresh_directory("gold"), "cell")
    harness.succeed("simulate", cell, "--size", 96, "--thickness", 32, "--seed", 3, "--noise", 0.05,
                    "--tilts=-60:60:6", "--contrast", "dark", "--gold", 10, "--gold-diameter", 80)
    stack = os.path.join(cell, "tilt_series.mrc")
    gold = [stack, "--tlt", os.path.join(cell, "tilt_series.tlt")]
    options = ["--contrast", "dark", "--epochs", 2]
    for extra in ([], ["--log"]):
        alone = harness.fresh_results("beads")
        harness.succeed(*command(alone, *options, *extra, input=gold))
        assert metrics(alone)["mask"]["beads"] >= 5, metrics(alone)["mask"]
        shared = harness.fresh_results("beads3")
        succeed(3, *command(shared, *options, *extra, input=gold))
        assert shared.same_as(alone), extra
        assert metrics(shared) == metrics(alone), extra


def test_the_first_process_writes_its_trace(command):
    results = harness.fresh_results("traced")
    folder = harness.fresh_directory("trace")
    trace = os.path.join(folder, "trace.json")
    said = succeed(2, *command(results, "--trace", trace)).stdout
    assert said.count("trace     ") == 1 and os.listdir(folder) == ["trace.json"], said
    with open(trace, encoding="utf-8") as file:
        assert json.load(file)["traceEvents"]
    refused = mpirun(2, *command(harness.fresh_results("refused"), "--trace", trace))
    assert refused.returncode == 2 and "give another name with --trace" in refused.stderr, refused


def test_processes_share_the_threads_of_their_machine(command, monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS")
    alone = harness.succeed(*command(harness.fresh_results("alone"))).stderr
    if "one for each of the machine's processors" not in alone:
        pytest.skip("this process may not use the whole machine")
    monkeypatch.setenv("OMPI_MCA_hwloc_base_binding_policy", "none")
    results = harness.fresh_results("threads")
    said = succeed(2, *command(results)).stderr
    assert said.count("the share of each of 2 processes on this machine") == 1, said
    with open(results.json_path, encoding="utf-8") as file:
        assert json.load(file)["metrics"]["threads"] == max(1, os.cpu_count() // 2)


def test_each_process_has_its_part(command):
    results = harness.fresh_results("parts")
    succeed(3, *command(results))
    with open(results.json_path) as file:
        processes = json.load(file)["metrics"]["processes"]
    assert [p["bands"] for p in processes] == [1, 2, 1], processes
    assert all(p["bytes_sent_per_step"] > 0 and p["seconds_computing"] > 0 for p in processes)
    # All send the same sums, and the one in the middle has two neighbours.
    first, middle, last = (p["bytes_sent_per_step"] for p in processes)
    assert first == last < middle, processes


def test_a_turned_volume_is_the_same(command, series):
    xtilt = os.path.join(os.path.dirname(series[0]), "x.xtilt")
    np.savetxt(xtilt, np.full(len(harness.TILTS), 4.0), fmt="%.1f")
    alone, shared = harness.fresh_results("turned"), harness.fresh_results("turned2")
    harness.succeed(*command(alone, "--xtilt", xtilt, "--epochs", 1))
    succeed(2, *command(shared, "--xtilt", xtilt, "--epochs", 1))
    assert shared.same_as(alone)


def stop_after_a_step(run, number):
    """Stops a run by a signal and returns what it said."""
    errors = harness.stop_after_a_step(run, number, timeout=60)
    assert errors.count("tomofield: stopped") == 1 and "--resume" in errors, errors
    return errors


def test_checkpoints_go_on_with_any_number_of_processes(command):
    undisturbed, results = harness.fresh_results("undisturbed"), harness.fresh_results("resumed")
    long = ["--epochs", 400]  # to be stopped in, three times
    harness.succeed(*command(undisturbed, *long))
    steps = []
    # mpirun passes SIGUSR1 on. It answers SIGTERM itself and ends the processes with it.
    for processes, number, status in ((4, signal.SIGUSR1, 128 + signal.SIGUSR1),
                                      (1, signal.SIGTERM, 128 + signal.SIGTERM),
                                      (2, signal.SIGTERM, 1)):
        words = command(results, "--resume", *long)
        run = start(processes, *words) if processes > 1 else harness.start(*words)
        errors = stop_after_a_step(run, number)
        assert run.returncode == status, (run.returncode, errors)
        steps.append(results.steps_done())
    assert 0 < steps[0] < steps[1] < steps[2] < 400 * 7, steps
    succeed(3, *command(results, "--resume", *long))
    assert results.same_as(undisturbed)


def processes_of(run):
    """Returns the process numbers of the programs that an mpirun started."""
    with open(f"/proc/{run.pid}/task/{run.pid}/children") as file:
        return [int(pid) for pid in file.read().split()]


def test_a_process_that_dies_ends_the_job_and_leaves_a_checkpoint(command):
    undisturbed, results = harness.fresh_results("alive"), harness.fresh_results("killed")
    long = ["--epochs", 12, "--checkpoint-minutes", 0]
    harness.succeed(*command(undisturbed, *long))
    run = start(2, *command(results, *long))
    while not os.path.exists(results.model_path):
        assert run.poll() is None
        time.sleep(0.001)
    os.kill(processes_of(run)[1], signal.SIGKILL)
    _, errors = run.communicate(timeout=60)
    assert run.returncode != 0 and "signal 9 (Killed)" in errors, (run.returncode, errors)
    assert not os.path.exists(results.volume_path)
    resumed = succeed(2, *command(results, "--resume", *long))
    assert "resuming" in resumed.stderr, resumed.stderr
    assert results.same_as(undisturbed)


def killed_at(step, words, results):
    """Starts a job of two processes until one is killed after this step, and returns the steps that
    its checkpoint has done."""
    run = start(2, *words)
    while run.poll() is None and results.steps_done() < step:
        time.sleep(0.001)
    if run.poll() is None:
        os.kill(processes_of(run)[1], signal.SIGKILL)
    run.communicate(timeout=60)
    return results.steps_done()


# The light stage begins after 20 epochs, and the last one after 30. The prior has a state in both.
@pytest.mark.parametrize("first_epoch, end_epoch", [(20, 30), (30, 33)])
def test_the_learned_prior_goes_on_with_any_number_of_processes(command, first_epoch, end_epoch):
    fit = [*LEARNED, "--epochs", 20, "--coarse-epochs", 0, "--checkpoint-minutes", 0]
    undisturbed, killed = harness.fresh_results("whole_prior"), harness.fresh_results("killed_prior")
    harness.succeed(*command(undisturbed, *fit))
    for _ in range(10):
        harness.fresh_results("killed_prior")
        if killed_at(7 * first_epoch + 1, command(killed, *fit), killed) < 7 * end_epoch:
            break
    else:
        raise AssertionError("every run got further before it was killed")
    with h5py.File(killed.model_path) as model:
        assert "prior_state" in model["training/floats"]
    checkpoint = read_bytes(killed.model_path)
    for processes in (1, 3):
        resumed = harness.fresh_results(f"resumed_prior{processes}")
        with open(resumed.model_path, "wb") as file:
            file.write(checkpoint)
        said = succeed(processes, *command(resumed, *fit, "--resume")).stderr
        assert "resuming" in said, said
        assert resumed.same_as(undisturbed), processes


def refuse(words, processes, *arguments):
    result = mpirun(processes, *arguments)
    complaints = [line for line in result.stderr.splitlines() if line.startswith("tomofield: ")]
    assert result.returncode == 2, (words, result)
    assert len(complaints) == 1 and all(word in complaints[0] for word in words), result.stderr


def test_faults_are_told_once(command, series):
    results = harness.fresh_results("faults")
    refuse(["nowhere.mrc", "does not exist"], 3, *command(results, input=["nowhere.mrc", *series[1:]]))
    refuse(["--no-such-option"], 2, *command(results, "--no-such-option", 3))
    refuse(["--epochs"], 2, *command(results, "--epochs", -2))
    refuse(["5 processes", "at most 4"], 5, *command(results))
    refuse(["--tree adaptive", "--engine ray"], 2,
           *command(results, "--tree", "adaptive", "--engine", "ray"))
    refuse(["2 processes", "simulate"], 2, "simulate", os.path.join(harness.SCRATCH, "phantom"))
    assert not os.listdir(os.path.dirname(results.volume_path))
    succeed(2, *command(results))
    refuse([results.volume_path, "--overwrite"], 2, *command(results))
    refuse([results.model_path, "--seed"], 2, *command(results, "--resume", "--seed", 9))


def test_a_fault_of_one_process_is_told_by_the_first(command, series):
    results = harness.fresh_results("fault_of_one")
    other = command(results, input=["not_here.mrc", *series[1:]])
    refuse(["not_here.mrc", "does not exist"], 2, *command(results), ":", "-np", 1,
           harness.PROGRAM, *other)
    assert not os.listdir(os.path.dirname(results.volume_path))

