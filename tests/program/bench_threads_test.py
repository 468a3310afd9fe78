"""Tests bench/threads: the model of threads, how a trace becomes a tree, and the rows and tables."""

import json
import os
import subprocess
import sys

import pytest

import harness

BENCH = os.path.abspath(os.path.join(os.path.dirname(__file__), "../../bench"))
sys.path.insert(0, BENCH)

import threads_rows  # pylint: disable=wrong-import-position
from schedule import Schedule, limits  # pylint: disable=wrong-import-position
from trace_tree import Loop, Task, Trace, shortest  # pylint: disable=wrong-import-position
from whole_run import WholeRun  # pylint: disable=wrong-import-position


def loop(name, *tasks):
    """Returns a loop of tasks, which are seconds or lists of items."""
    return Loop(name, [Task(task if isinstance(task, list) else [float(task)]) for task in tasks])


def seconds(step, threads, task_cost=0.0):
    return Schedule(step, threads, task_cost).seconds


def test_serial_work_is_not_shared():
    step = Task([1.0, loop("a", 1, 1, 1), 0.5])
    assert [seconds(step, n) for n in (1, 2, 3, 100)] == [4.5, 3.5, 2.5, 2.5]
    assert step.work() == 4.5 and step.span() == 2.5 and step.own() == 1.5


def test_tasks_are_taken_in_the_order_of_their_index():
    assert seconds(Task([loop("a", 3, 1, 1, 1)]), 2) == 3
    assert seconds(Task([loop("a", 1, 1, 1, 3)]), 2) == 4


def test_threads_without_a_task_help_inner_loops():
    band = [loop("inner", 1, 1, 1, 1)]
    assert seconds(Task([loop("outer", band)]), 4) == 1
    # Two threads begin both bands, and the third one takes tasks of either.
    assert seconds(Task([loop("outer", band, band)]), 3) == 3
    # After its first task, the third thread prefers the last outer task to the inner ones.
    bands = Schedule(Task([loop("outer", band, band, 1, 1)]), 3, 0.0)
    names = [lane.name for lane in bands.lanes if lane.begin == 1.0]
    assert sorted(names) == ["inner", "inner", "outer"], bands.lanes


def test_thread_that_waits_works_on_its_own_loop_alone():
    # The third thread helps the first one, which waits from 5 s to 9 s for it. The first thread does
    # not take the tasks of the second one meanwhile, nor later, when it waits for the outer loop.
    schedule = Schedule(Task([loop("outer", [loop("inner", 5, 9)], [loop("other", *[1] * 30)])]), 3,
                        0.0)
    waiting = [lane for lane in schedule.lanes if lane.thread == 0 and lane.begin >= 5]
    assert not waiting and schedule.seconds == 20, schedule.lanes


def test_tasks_cost_something_on_several_threads():
    step = Task([loop("a", *[1] * 10)])
    assert seconds(step, 1, task_cost=0.1) == 10
    assert abs(seconds(step, 2, task_cost=0.1) - 5.5) < 1e-9


@pytest.mark.parametrize("threads", (1, 2, 5, 64))
def test_no_schedule_beats_its_limits(threads):
    tasks = [[0.5, loop("inner", *[1 + i % 3 for i in range(k % 7)]), 0.25] for k in range(40)]
    step = Task([0.1, loop("outer", *tasks), 0.2, loop("other", *range(1, 9))])
    schedule = Schedule(step, threads, 0.0)
    assert schedule.seconds >= max(step.span(), step.work() / threads) - 1e-9
    lost = limits(step, schedule, threads)
    assert set(lost) == {None, "outer", "other"} and min(lost.values()) > -1e-9
    assert abs(sum(lost.values()) + step.work() / threads / schedule.seconds - 1) < 1e-9
    for thread in range(threads):  # its tasks of one depth do not overlap
        own = sorted((lane.depth, lane.begin, lane.end) for lane in schedule.lanes
                     if lane.thread == thread)
        assert all(b[0] != a[0] or b[1] >= a[2] - 1e-9 for a, b in zip(own, own[1:])), own


def event(kind, name, begin, end, **facts):
    return {"cat": kind, "name": name, "ts": 1e6 * begin, "dur": 1e6 * (end - begin), "ph": "X",
            "pid": 1, "tid": 0, "args": facts}


def loop_event(name, begin, end, number, in_task, tasks, busy, longest):
    return event("loop", name, begin, end, loop=number, in_task=in_task, tasks=tasks, busy_s=busy,
                 longest_s=longest)


def write_trace(name):
    """Writes a run of 30 s with two steps. The first has an inner loop and its tasks, and the second
    has one loop without tasks."""
    path = os.path.join(harness.fresh_directory(name), "trace.json")
    events = [
        event("span", "prepare", 0, 8), loop_event("read", 1, 7, 90, -1, 4, 6.0, 2.0),
        event("span", "fit", 10, 26),
        event("span", "step", 10, 20), loop_event("bands", 11, 19, 1, -1, 2, 8.0, 5.0),
        event("task", "bands", 11, 16, loop=1, task=11, index=0),
        event("task", "bands", 16, 19, loop=1, task=12, index=1),
        loop_event("views", 12, 16, 2, 11, 2, 4.0, 2.0),
        event("task", "views", 12, 14, loop=2, task=21, index=0),
        event("task", "views", 14, 16, loop=2, task=22, index=1),
        event("span", "step", 21, 26), loop_event("bands", 21.5, 25.5, 3, -1, 2, 4.0, 2.5)]
    with open(path, "w", encoding="utf-8") as file:
        json.dump({"traceEvents": events}, file)
    return path


def test_trace_becomes_a_tree():
    trace = Trace(write_trace("tree"))
    ((span, step),) = trace.recorded_steps()
    assert span["ts"] == 10e6
    assert step == Task([1.0, loop("bands", [1.0, loop("views", 2, 2), 0.0], 3), 1.0]), step
    assert step.work() == 10 and step.span() == 5 and seconds(step, 2) == 7
    assert step.chain() == {None: 2, "bands": 1, "views": 2}
    assert Task([loop("outer", [1.0, loop("inner", 3, 2)], 2)]).chain() == {
        None: 0, "outer": 1, "inner": 3}
    slower = Task([0.5, loop("bands", [2.0, loop("views", 3, 1), 0.0], 4), 3.0])
    assert shortest([step, slower]) == Task(
        [0.5, loop("bands", [1.0, loop("views", 2, 1), 0.0], 3), 1.0])
    with pytest.raises(ValueError):
        shortest([step, Task([1.0, loop("bands", 3), 1.0])])


def test_whole_run_is_split_into_spans():
    trace = Trace(write_trace("whole"))
    (_, step) = trace.recorded_steps()[0]
    gains = [{n: seconds(step, n) / seconds(step, 1) for n in (1, 2)}]
    run = WholeRun(trace, 30.0, gains, (1, 2))
    parts = {part.name: part for part in run.parts.values()}
    assert {name: (p.depth, p.calls, p.seconds, p.in_loops) for name, p in parts.items()} == {
        "the program": (0, 1, 30, 18), "prepare": (1, 1, 8, 6), "fit": (1, 1, 16, 12),
        "step": (2, 2, 15, 12)}
    assert parts["prepare"].modelled == {1: 8, 2: 2 + 3}
    assert abs(parts["step"].modelled[2] - 15 * 0.7) < 1e-9
    assert abs(parts["the program"].modelled[2] - (6 + 5 + 1 + 15 * 0.7)) < 1e-9
    assert abs(parts["the program"].modelled[1] - 30) < 1e-9


def test_instructions_are_those_of_all_functions():
    path = os.path.join(harness.fresh_directory("counts"), "callgrind.out")
    with open(path, "w", encoding="utf-8") as file:
        file.write("positions: line\nevents: Ir\nfn=(1) main\n12 100\n+3 20\ntotals: 120\n")
    assert threads_rows.instructions_in(path) == {"total": 120}


def bench(folder, *options):
    return subprocess.run(["/usr/bin/python3", os.path.join(BENCH, "threads"), folder, "--program",
                           harness.PROGRAM, "--quick", *map(str, options)],
                          capture_output=True, text=True)


def test_rows_are_measured_once_and_shown():
    folder = harness.fresh_directory("threads")
    nothing = bench(folder, "--table")
    assert nothing.returncode == 0 and "nothing was measured yet" in nothing.stdout, nothing
    done = bench(folder, "--repeats", 2, "--only", "^(default.* [12] thread|step|run)")
    assert done.returncode == 0, done.stderr
    for text in ("| default 64/38 | 2 | ", "1 different tomogram in ", "| default 64/38 | vm, bin 1 | ",
                 "| the program | 1 | ", "| speed-up of the whole run | 1.0 | "):
        assert text in done.stdout, (text, done.stdout)
    again = bench(folder, "--repeats", 2, "--only", "^(default.* [12] thread|step|run)")
    assert again.stdout == done.stdout and again.stderr == "", again.stderr
    table = bench(folder, "--repeats", 2, "--table", "--task-cost", 50)
    assert table.stdout != done.stdout and table.stderr == "", table.stderr
    missing = bench(folder, "--only", "^cost", "--bench-task-cost", os.path.join(folder, "none"))
    assert missing.returncode == 1 and "--only" in missing.stderr, missing.stderr
