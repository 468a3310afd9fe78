"""Lists the rows of bench/threads and measures them.

A row's measure(scratch folder) returns a dictionary of its figures."""

import dataclasses
import functools
import hashlib
import json
import os
import shutil
import subprocess
import sys
import typing

import quality_rows
from competitor import Competitor

SEED = 101
NOISE = 0.05
BESIDE = "beside a competitor"


@dataclasses.dataclass(frozen=True)
class Row:
    kind: str  # fit, cost, step, run, lanes or instructions
    name: str
    arguments: str  # the row is measured again when its arguments have changed
    repeats: int
    measure: typing.Callable
    facts: dict  # what the tables need to know of the row


@dataclasses.dataclass(frozen=True)
class Plan:
    """Lists everything that a run measures. Fits are (name, options of reconstruct)."""

    timed_size: tuple = (256, 150)
    timed: tuple = (
        ("grid", "--field grid --tv-penalty smooth --coarse-epochs 8 --epochs 12"),
        ("default", "--tv-penalty smooth --coarse-epochs 8 --vertex-epochs 2 --epochs 3"))
    steps: tuple = ((256, 150), (512, 300), (1024, 300))
    stepped: tuple = (
        ("grid", "--field grid --tv-penalty smooth --coarse-epochs 1 --epochs 1"),
        ("default", "--tv-penalty smooth --coarse-epochs 1 --vertex-epochs 1 --epochs 1"))
    step_repeats: int = 3
    whole: tuple = ((512, 300), (("grid", "--field grid"), ("default", "")))
    instructed_size: tuple = (64, 38)
    instructed: str = "--tv-penalty smooth --coarse-epochs 2 --vertex-epochs 1 --epochs 2 --rank 8"


TINY = "--tv-penalty smooth --coarse-epochs 1 --vertex-epochs 1 --epochs 1 --rank 4"
QUICK = Plan(timed_size=(64, 38), timed=(("default", TINY),), steps=((64, 38),),
             stepped=(("default", TINY),), step_repeats=2, whole=((64, 38), (("default", TINY),)),
             instructed_size=(48, 24),
             instructed="--tv-penalty smooth --coarse-epochs 0 --vertex-epochs 0 --epochs 1 --rank 2")


def processors():
    return sorted(os.sched_getaffinity(0))


def thread_numbers():
    """Returns 1, 2, 4, … up to the processors of this machine, and their number."""
    most = max(2, len(processors()))
    return sorted({*(2**i for i in range(most.bit_length())), most})


def title(name, size):
    return f"{name} {size[0]}/{size[1]}"


def threads_text(number):
    return "1 thread" if number == 1 else f"{number} threads"


def all_rows(options, plan):
    return [*cost_rows(options), *timed_rows(options, plan), *traced_rows(options, plan),
            *instruction_rows(options, plan)]


def cost_rows(options):
    for threads in thread_numbers()[1:]:
        yield Row("cost", f"cost of tasks, {threads} threads", "", 1,
                  functools.partial(measure_cost, options, threads), {"threads": threads})


def timed_rows(options, plan):
    """Returns the rows that are timed. Two or more threads also run beside a competitor."""
    for name, arguments in plan.timed:
        for threads in thread_numbers():
            for beside in (False, True) if threads > 1 else (False,):
                row = f"{title(name, plan.timed_size)}, {threads_text(threads)}"
                yield Row("fit", f"{row}, {BESIDE}" if beside else row, arguments, options.repeats,
                          functools.partial(measure_fit, options, plan.timed_size, arguments,
                                            threads, beside),
                          {"title": title(name, plan.timed_size), "threads": threads,
                           "beside": beside})


def traced_rows(options, plan):
    for size in plan.steps:
        for name, arguments in plan.stepped:
            row = title(name, size)
            yield traced_row(options, "step", row, size, arguments, 1, plan.step_repeats)
    size, fits = plan.whole
    for name, arguments in fits:
        yield traced_row(options, "run", title(name, size), size, arguments, 1, 1)
    for name, arguments in plan.stepped:
        yield traced_row(options, "lanes", title(name, plan.steps[0]), plan.steps[0], arguments, 2, 1)


def traced_row(options, kind, name, size, arguments, threads, repeats):
    return Row(kind, f"{kind} {name}", arguments, repeats,
               functools.partial(measure_trace, options, size, arguments, threads),
               {"title": name})


def instruction_rows(options, plan):
    for threads in (1, 2):
        yield Row("instructions", f"instructions, {threads_text(threads)}", plan.instructed, 1,
                  functools.partial(measure_instructions, options, plan, threads),
                  {"threads": threads, "title": title("default", plan.instructed_size)})


def command_of(options, size, arguments, threads, volume):
    folder = quality_rows.phantom(options, "A", size[0], NOISE, SEED, size[1])
    return [options.program, "reconstruct", *arguments.split(),
            *quality_rows.series_arguments(folder, size[1]), "--no-margin", "--threads",
            str(threads), "-o", volume, "--overwrite"]


def digest_of(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def measure_cost(options, threads, scratch):
    if not os.path.exists(options.bench_task_cost):
        sys.exit(f"there is no '{options.bench_task_cost}': build the target bench_task_cost, or "
                 "choose other rows with --only")
    path = os.path.join(scratch, "cost.json")
    quality_rows.run_measured([options.bench_task_cost, path, str(threads)])
    with open(path) as file:
        return json.load(file)


def measure_fit(options, size, arguments, threads, beside, scratch):
    """Times one run. A run beside a competitor has as many processors as threads, and the competitor
    takes half of the first of them."""
    volume = os.path.join(scratch, "volume.mrc")
    command = command_of(options, size, arguments, threads, volume)
    if not beside:
        usage, share = quality_rows.run_measured(command), 0.0
    else:
        own = processors()[:threads]
        competitor = Competitor(own[0])
        try:
            usage = quality_rows.run_measured(command,
                                              preexec_fn=lambda: os.sched_setaffinity(0, own))
        finally:
            share = competitor.stop()
    return {**usage._asdict(), "competitor": share, "digest": digest_of(volume)}


def measure_trace(options, size, arguments, threads, scratch):
    """Runs a fit with --trace, keeps the trace in the folder of the rows and returns its name."""
    volume, trace = (os.path.join(scratch, name) for name in ("volume.mrc", "trace.json"))
    usage = quality_rows.run_measured(
        [*command_of(options, size, arguments, threads, volume), "--trace", trace])
    with open(os.path.join(scratch, "volume.json")) as file:
        figures = json.load(file)["metrics"]
    kept = f"trace-{digest_of(trace)[:16]}"
    shutil.move(trace, os.path.join(os.path.dirname(scratch), kept))
    return {"trace": kept, "stages": figures["stages"], "wall_seconds": usage.wall_seconds}


def measure_instructions(options, plan, threads, scratch):
    """Counts instructions with callgrind."""
    counts = os.path.join(scratch, "callgrind.out")
    command = command_of(options, plan.instructed_size, plan.instructed, threads,
                         os.path.join(scratch, "volume.mrc"))
    if shutil.which("valgrind") is None:
        sys.exit("there is no valgrind: install it, or choose other rows with --only")
    done = subprocess.run(["valgrind", "--tool=callgrind", f"--callgrind-out-file={counts}",
                           *command], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}\n{done.stderr}")
    return instructions_in(counts)


def instructions_in(path):
    """Returns the instructions in a file of callgrind: {total}."""
    with open(path, encoding="utf-8") as file:
        for line in file:
            if line.startswith("totals:"):
                return {"total": int(line.split()[1])}
    raise ValueError(f"{path} has no totals")
