"""Prints the Markdown tables of bench/threads and draws its pictures."""

import collections
import os
import statistics

import measured_on
from schedule import Schedule, limits
from speed_report import number, table
from trace_tree import Trace, shortest
from whole_run import WholeRun

MODELLED = (1, 2, 4, 8, 16, 32, 64, 128)
EXPLAINED = (16, 64)  # threads whose losses are listed
MOST_LISTED = 3
LANES = 16


class Results:
    """Holds the rows that were measured, and reads their traces once."""

    def __init__(self, options, parts):
        self.options, self.parts = options, parts  # [(row, figures)]
        self.traces = {}

    def of_kind(self, kind):
        """Returns {row name: (row, [figures of each repeat])}."""
        found = {}
        for row, figures in self.parts:
            if row.kind == kind:
                found.setdefault(row.name, (row, []))[1].append(figures)
        return found

    def trace(self, figures):
        path = os.path.join(self.options.out, "threads", figures["trace"])
        return self.traces.setdefault(path, Trace(path))

    def schedule(self, step, threads):
        return Schedule(step, threads, self.options.task_cost * 1e-6)

    def gains(self, step):
        alone = self.schedule(step, 1).seconds
        return {n: self.schedule(step, n).seconds / alone for n in MODELLED}


def print_tables(results):
    if not results.parts:
        print("nothing was measured yet: run it without --table")
        return
    measured_on.print_origins(measured_on.origins([figures for _, figures in results.parts]))
    print("Times are medians of the repeats, with the worst in brackets.")
    for kind, print_kind in (("fit", print_fits), ("instructions", print_instructions),
                             ("step", print_steps), ("run", print_runs), ("cost", print_costs)):
        if results.of_kind(kind):
            print_kind(results)


def seconds_cell(values):
    return f"{statistics.median(values):.2f} ({max(values):.2f})" if values else "–"


def print_fits(results):
    print("\n### Measured\n\nA competitor is a process that is busy for 5 ms of every 10 ms on one of "
          "the processors. A run beside it may use as many processors as it has threads. With it, n "
          "threads can at best take T1 / (n − its share).")
    by_title = collections.defaultdict(dict)
    for row, repeats in results.of_kind("fit").values():
        by_title[row.facts["title"]][row.facts["threads"], row.facts["beside"]] = repeats
    lines, texts = [], []
    for title, cells in by_title.items():
        if (1, False) not in cells:
            continue
        alone = statistics.median(figures["wall_seconds"] for figures in cells[1, False])
        lines += [fit_line(title, n, cells, alone) for n in sorted({n for n, _ in cells})]
        digests = {figures["digest"] for repeats in cells.values() for figures in repeats}
        texts.append(f"{title}: {len(digests)} different tomogram{'s' * (len(digests) > 1)} in "
                     f"{sum(map(len, cells.values()))} runs.")
    table(["fit", "threads", "s alone", "speed-up", "core-s", "s beside a competitor",
           "its share", "ideal s", "over the ideal"], lines)
    print("\n" + " ".join(texts))


def fit_line(title, threads, cells, alone):
    by_itself, beside = cells.get((threads, False), []), cells.get((threads, True), [])
    line = [title, str(threads), seconds_cell([f["wall_seconds"] for f in by_itself])]
    if by_itself:
        middle = statistics.median(f["wall_seconds"] for f in by_itself)
        core = statistics.median(f["core_seconds"] for f in by_itself)
        line += [f"{alone / middle:.2f}", f"{core:.2f}"]
    else:
        line += ["–", "–"]
    if not beside:
        return line + ["–"] * 4
    share = statistics.median(f["competitor"] for f in beside)
    middle = statistics.median(f["wall_seconds"] for f in beside)
    ideal = alone / (threads - share)
    return line + [seconds_cell([f["wall_seconds"] for f in beside]), f"{share:.2f}",
                   f"{ideal:.2f}", f"{100 * (middle / ideal - 1):+.0f} %"]


def print_instructions(results):
    print("\n### Instructions\n\nCounted by callgrind, which runs one thread at a time.")
    rows = sorted(results.of_kind("instructions").values(), key=lambda pair: pair[0].facts["threads"])
    first, lines = rows[0][1][0], []
    for row, (counts,) in rows:
        lines.append([row.facts["title"], str(row.facts["threads"]), f"{counts['total']:,}",
                      f"{counts['total'] / first['total']:.3f}"])
    table(["fit", "threads", "instructions", "over those of one thread"], lines)


def stage_text(stage):
    return f"{stage['field']}, bin {stage['bin']}"


def merged_steps(results, repeats):
    """Returns (stage, tree) of the recorded steps of the stages of the fit. Trials come before."""
    runs = [[step for _, step in results.trace(figures).recorded_steps()] for figures in repeats]
    stages = repeats[0]["stages"]
    return [(stage_text(stage), shortest(trees))
            for stage, trees in zip(stages, zip(*(run[-len(stages):] for run in runs)))]


def speed_up(alone, seconds, threads):
    return f"{alone / seconds:.1f} ({100 * alone / seconds / threads:.0f} %)"


def print_steps(results):
    print("\n### One step, modelled\n\nEach task of a step was timed with one thread. A model gives "
          "them to more threads by the rules of `bench/schedule.py`: a thread that waits for a "
          "loop works on that loop alone, others take tasks of the outermost loop that has some "
          f"left, in the order of their index, and taking one costs {results.options.task_cost:g} "
          "µs. In the program the caller of an outermost loop also helps within it while it waits; "
          "the model leaves that out. It knows no limit of the memory's bandwidth. A piece "
          "of work has the shortest of its times in the repeats. Serial is the step's time outside "
          "of loops. Most is the speed-up that no number of threads can exceed: the step's time over "
          "its longest chain of work. Speed-up (efficiency):")
    lines, losses = [], []
    for row, repeats in results.of_kind("step").values():
        for stage, step in merged_steps(results, repeats):
            alone = step.work()
            longest = max((task.work() for loop in step.loops() for task in loop.tasks), default=0.0)
            schedules = {n: results.schedule(step, n) for n in MODELLED}
            name = [row.facts["title"], stage]
            lines.append([*name, number(1e3 * alone), f"{100 * step.own() / alone:.2f} %",
                          f"{100 * longest / alone:.1f} %",
                          *(speed_up(alone, schedules[n].seconds, n) for n in MODELLED[1:]),
                          f"{alone / step.span():.0f}"])
            losses.append([*name, *(shares_text(limits(step, schedules[n], n)) for n in EXPLAINED),
                           shares_text(step.chain(), step.span())])
    table(["fit", "stage", "ms of one thread", "serial", "longest outer task",
           *(f"{n} threads" for n in MODELLED[1:]), "most"], lines)
    print("\nThe time of all threads that is not used: while an outermost loop has too few tasks for "
          "them, and during serial work. The last column says what the longest chain of work is "
          "made of.")
    table(["fit", "stage", *(f"not used by {n} threads" for n in EXPLAINED), "longest chain"], losses)


def shares_text(parts, whole=1.0):
    largest = sorted(parts.items(), key=lambda item: -item[1])[:MOST_LISTED]
    return ", ".join(f"{name or 'serial'} {100 * part / whole:.1f} %" for name, part in largest)


def print_runs(results):
    for row, (figures, *_) in results.of_kind("run").values():
        trace = results.trace(figures)
        gains = [results.gains(step) for _, step in trace.recorded_steps()]
        run = WholeRun(trace, figures["wall_seconds"], gains, MODELLED)
        print(f"\n### The whole run of {row.facts['title']}, modelled\n\n`reconstruct "
              f"{row.arguments}` with one thread. Steps follow the model above. Other loops take "
              "their longest task or their share of all tasks, whichever is longer. Everything else "
              "is serial. A part includes the parts below it.")
        table(["part", "times", "s of one thread", "in loops", "serial",
               *(f"s of {n}" for n in (2, *EXPLAINED))],
              [["  " * part.depth + part.name, str(part.calls), number(part.seconds),
                number(part.in_loops), number(part.seconds - part.in_loops),
                *(number(part.modelled[n]) for n in (2, *EXPLAINED))]
               for part in run.parts.values()])
        whole = next(iter(run.parts.values()))
        table(["threads", *map(str, MODELLED)],
              [["speed-up of the whole run", *(f"{whole.modelled[1] / whole.modelled[n]:.1f}"
                                               for n in MODELLED)]])


def print_costs(results):
    print("\n### Cost of loops and tasks\n\nLoops of tasks that do nothing, measured by "
          "`bench_task_cost`; medians. The time of a task is that of all threads together.")
    table(["threads", "µs a task", "µs a task of an inner loop", "µs a loop of one task",
           "µs a loop after the threads slept"],
          [[str(row.facts["threads"]),
            *(number(costs[key]) for key in ("task_us", "task_of_inner_loop_us", "loop_us",
                                             "loop_of_sleeping_threads_us"))]
           for row, (costs, *_) in results.of_kind("cost").values()])


def plot(results, folder):
    """Draws the last stage's step of each fit: as measured on two threads and as modelled."""
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot

    os.makedirs(folder, exist_ok=True)
    steps = {row.facts["title"]: repeats for row, repeats in results.of_kind("step").values()}
    for row, (figures, *_) in results.of_kind("lanes").values():
        title = row.facts["title"]
        if title not in steps:
            continue
        stage, step = merged_steps(results, steps[title])[-1]
        drawing, panels = pyplot.subplots(2, 1, figsize=(12, 6), constrained_layout=True,
                                          height_ratios=(2, 5))
        schedule = results.schedule(step, LANES)
        colors = {}
        draw_lanes(panels[0], measured_lanes(results.trace(figures)), colors)
        draw_lanes(panels[1], [(lane.thread, 1e3 * lane.begin, 1e3 * lane.end, lane.name, lane.depth)
                               for lane in schedule.lanes], colors)
        panels[0].set_title(f"{title}, a step of the last stage ({stage}), measured with two threads")
        panels[1].set(title=f"the same step, modelled for {LANES} threads", xlabel="ms")
        for name, color in colors.items():
            panels[1].barh(0, 0, color=color, label=name)
        panels[1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
        drawing.savefig(os.path.join(folder, f"threads_{title.replace(' ', '_').replace('/', '_')}"
                                             ".png"), dpi=110)
        pyplot.close(drawing)


def measured_lanes(trace):
    """Returns (thread, begin, end, name, depth) of the tasks of the last recorded step, in ms."""
    step, _ = trace.recorded_steps()[-1]
    loops = {loop["args"]["loop"]: loop for loop in trace.loops}
    tasks = {event["args"]["task"]: event for event in trace.events if event["cat"] == "task"}

    def depth(task):
        outer = loops[task["args"]["loop"]]["args"]["in_task"]
        return 0 if outer < 0 else 1 + depth(tasks[outer])

    return [(task["tid"], 1e-3 * (task["ts"] - step["ts"]),
             1e-3 * (task["ts"] - step["ts"] + task["dur"]), task["name"], depth(task))
            for task in tasks.values() if step["ts"] <= task["ts"] <= step["ts"] + step["dur"]]


def draw_lanes(panel, lanes, colors):
    """Draws threads as lanes. Tasks of inner loops are narrower and lie on those around them."""
    from matplotlib import pyplot

    tab = pyplot.get_cmap("tab20").colors
    palette = tab[::2] + tab[1::2]
    for thread, begin, end, name, depth in sorted(lanes, key=lambda lane: lane[4]):
        color = colors.setdefault(name, palette[len(colors) % len(palette)])
        panel.barh(thread, end - begin, left=begin, height=0.9 - 0.25 * min(depth, 2), color=color,
                   edgecolor="white", linewidth=0.15)
    panel.set(ylabel="thread", xlim=(0, None), ylim=(max((lane[0] for lane in lanes), default=0) + 0.6, -0.6))
