"""Tests --trace: what a run records, when the file is written, and where it cannot be."""

import collections
import json
import os
import pathlib

import pytest

import harness

MICROSECOND = 1e-6
ROUNDING = 1e-3  # microseconds


@pytest.fixture(scope="module")
def series():
    """Returns a small simulated series."""
    return harness.Series("series")


def read_trace(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)["traceEvents"]


def of_kind(events, kind):
    return [event for event in events if event["cat"] == kind]


def ends(event):
    return event["ts"], event["ts"] + event["dur"]


def lies_within(inner, outer):
    (begin, end), (outer_begin, outer_end) = ends(inner), ends(outer)
    return begin >= outer_begin - ROUNDING and end <= outer_end + ROUNDING


def check_tasks(events):
    """Checks that loops and tasks fit together, and returns the tasks of each loop that has some."""
    loops = {loop["args"]["loop"]: loop for loop in of_kind(events, "loop")}
    tasks = {task["args"]["task"]: task for task in of_kind(events, "task")}
    assert len(loops) == len(of_kind(events, "loop")) and len(tasks) == len(of_kind(events, "task"))
    tasks_of = collections.defaultdict(list)
    for task in tasks.values():
        loop = loops[task["args"]["loop"]]
        assert task["name"] == loop["name"] and lies_within(task, loop), (task, loop)
        tasks_of[loop["args"]["loop"]].append(task)
    for number, loop in loops.items():
        facts = loop["args"]
        if facts["in_task"] >= 0:
            assert lies_within(loop, tasks[facts["in_task"]]), (loop, tasks[facts["in_task"]])
        assert 0 <= facts["longest_s"] <= facts["busy_s"] + 1e-9, loop
        found = tasks_of.get(number)
        if found is None:
            continue
        assert sorted(task["args"]["index"] for task in found) == list(range(facts["tasks"])), loop
        seconds = [MICROSECOND * task["dur"] for task in found]
        assert abs(sum(seconds) - facts["busy_s"]) < 1e-8 * len(found), loop
        assert abs(max(seconds) - facts["longest_s"]) < 1e-8, loop
    return tasks_of


def check_threads(events, number):
    """Checks that a thread does one thing at a time: of two of its events, one contains the other
    or they do not overlap."""
    lanes = collections.defaultdict(list)
    for event in events:
        assert event["ph"] == "X" and 0 <= event["tid"] < number, event
        lanes[event["tid"]].append(event)
    for lane in lanes.values():
        running = []
        for event in sorted(lane, key=lambda event: (event["ts"], -event["dur"])):
            while running and ends(running[-1])[1] <= event["ts"] + ROUNDING:
                running.pop()
            assert not running or lies_within(event, running[-1]), (event, running[-1])
            running.append(event)


@pytest.mark.parametrize("threads", (1, 3))
def test_trace_has_spans_loops_and_the_tasks_of_a_step(series, threads):
    plain = series.reconstruct("plain", "--threads", threads)
    path = os.path.join(harness.fresh_directory("trace"), "trace.json")
    traced = series.reconstruct("traced", "--threads", threads, "--trace", path)
    assert traced.same_as(plain) and not traced.leftovers()
    events = read_trace(path)
    check_threads(events, threads)
    tasks_of = check_tasks(events)
    with open(traced.json_path, encoding="utf-8") as file:
        metrics = json.load(file)["metrics"]
    steps = [span for span in of_kind(events, "span") if span["name"] == "step"]
    assert len(steps) == metrics["steps"]
    recorded = [step for step in steps
                if any(lies_within(task, step) for tasks in tasks_of.values() for task in tasks)]
    assert len(recorded) == len(metrics["stages"]), (len(recorded), metrics["stages"])


def test_baselines_have_one(series):
    directory = harness.fresh_directory("baseline")
    for method in ("sirt", "tensorf"):
        path = os.path.join(directory, method + ".json")
        options = ["--iterations", 2] if method == "sirt" else ["--epochs", 1, "--rank", 2]
        harness.succeed("baseline", method, *series.input, "--thickness", harness.THICKNESS,
                        "--contrast", "bright", "--no-margin", *options, "--trace", path, "-o",
                        os.path.join(directory, method + "_volume.mrc"))
        events = read_trace(path)
        check_tasks(events)
        assert of_kind(events, "loop"), method


def test_file_that_cannot_be_written_is_refused_before_any_work(series):
    directory = harness.fresh_directory("refused")
    existing = os.path.join(directory, "existing.json")
    pathlib.Path(existing).write_text("mine")
    output = os.path.join(directory, "out.mrc")
    for trace, fact in ((os.path.join(directory, "absent", "trace.json"), "absent"),
                        (directory, "refused"), (existing, "exists: give another name"),
                        (output, "two results"), (output[:-len("mrc")] + "json", "two results"),
                        (series.tlt, "replace the input")):
        for command in (["reconstruct", *harness.QUICK],
                        ["baseline", "wbp", "--thickness", harness.THICKNESS],
                        ["baseline", "tensorf", "--thickness", harness.THICKNESS]):
            for more in ([], ["--overwrite"], ["--dry-run"]):
                if more == ["--overwrite"] and trace == existing:
                    continue
                run = harness.tomofield(*command, *series.input, "-o", output, "--trace", trace, *more)
                assert run.returncode == 2 and fact in run.stderr, (trace, command, run)
                assert len(run.stderr.splitlines()) == 1 and run.stdout == "", run
    assert os.listdir(directory) == ["existing.json"]
    assert harness.read_bytes(existing) == b"mine"


def test_no_two_files_beside_the_results_are_one(series):
    folder = harness.fresh_directory("one_file")
    one, output = (os.path.join(folder, name) for name in ("one.json", "out.mrc"))
    for options in (["--choice", one, "--trace", one], ["--plan", one, "--trace", one],
                    ["--dry-run", "--grid", one, "--plan", one]):
        run = harness.tomofield("reconstruct", *series.input, *harness.QUICK, "-o", output, *options)
        assert run.returncode == 2 and "two results would both be" in run.stderr, run
        assert not os.listdir(folder)


def test_overwrite_replaces_a_trace(series):
    path = os.path.join(harness.fresh_directory("replaced"), "trace.json")
    pathlib.Path(path).write_text("old")
    series.reconstruct("over", "--trace", path, "--overwrite")
    assert read_trace(path)


def test_dry_run_writes_none(series):
    directory = harness.fresh_directory("dry")
    harness.succeed("reconstruct", *series.input, *harness.QUICK, "--dry-run", "-o",
                    os.path.join(directory, "out.mrc"), "--trace", os.path.join(directory, "t.json"))
    assert not os.listdir(directory)


def test_runs_that_end_early_write_theirs(series):
    directory = harness.fresh_directory("early")
    path = os.path.join(directory, "stopped.json")
    run, errors = harness.stop_after_first_step(
        ["reconstruct", *series.input, *harness.merge(harness.QUICK, ["--epochs", 100000]), "-o",
         os.path.join(directory, "out.mrc"), "--trace", path])
    assert run.returncode == 143 and "--resume, and another name for --trace" in errors, errors
    assert of_kind(read_trace(path), "span")
    refused = harness.tomofield("reconstruct", *series.input, *harness.QUICK, "-o",
                                os.path.join(directory, "out.mrc"), "--resume", "--trace", path)
    assert refused.returncode == 2 and "give another name with --trace\n" in refused.stderr, refused
    path = os.path.join(directory, "failed.json")
    wrong = os.path.join(directory, "wrong.tlt")
    pathlib.Path(wrong).write_text("1\n2\n")
    run = harness.tomofield("reconstruct", series.stack, "--tlt", wrong, *harness.QUICK, "-o",
                            os.path.join(directory, "other.mrc"), "--trace", path)
    assert run.returncode == 2 and "wrong.tlt" in run.stderr, run
    read_trace(path)
