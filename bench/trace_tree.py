"""Reads the file of `tomofield --trace`: the steps whose tasks were recorded as trees, and the parts
of the whole run.

A task is a sequence of work of its own and of loops, a loop is a set of tasks. The time of a loop
beyond that of its tasks (mostly that of recording them) counts nowhere."""

import collections
import dataclasses
import json

MICROSECOND = 1e-6
ROUNDING = 1e-3  # microseconds


@dataclasses.dataclass
class Loop:
    name: str
    tasks: list

    def work(self):
        return sum(task.work() for task in self.tasks)

    def span(self):
        """Returns the seconds that the loop takes with any number of threads at least."""
        return max((task.span() for task in self.tasks), default=0.0)

    def chain(self):
        """Returns {loop name: seconds} of the longest chain of work. It has one task of each loop."""
        longest = max(self.tasks, key=Task.span, default=Task([]))
        return longest.chain(self.name)


@dataclasses.dataclass
class Task:
    items: list  # seconds of own work, and loops

    def work(self):
        return sum(item.work() if isinstance(item, Loop) else item for item in self.items)

    def span(self):
        return sum(item.span() if isinstance(item, Loop) else item for item in self.items)

    def chain(self, name=None):
        seconds = collections.Counter({name: self.own()})
        for loop in self.loops():
            seconds.update(loop.chain())
        return seconds

    def own(self):
        """Returns the seconds outside of loops."""
        return sum(item for item in self.items if not isinstance(item, Loop))

    def loops(self):
        return [item for item in self.items if isinstance(item, Loop)]


def begin_of(event):
    return event["ts"]


def end_of(event):
    return event["ts"] + event["dur"]


def contains(outer, inner):
    return (begin_of(outer) <= begin_of(inner) + ROUNDING
            and end_of(inner) <= end_of(outer) + ROUNDING)


class Trace:
    """Holds the events of a run with one thread."""

    def __init__(self, path):
        with open(path, encoding="utf-8") as file:
            self.events = json.load(file)["traceEvents"]
        self.loops = [event for event in self.events if event["cat"] == "loop"]
        self.tasks_of_loop, self.loops_of_task = (collections.defaultdict(list) for _ in range(2))
        for event in self.events:
            if event["cat"] == "task":
                self.tasks_of_loop[event["args"]["loop"]].append(event)
        for loop in self.loops:
            self.loops_of_task[loop["args"]["in_task"]].append(loop)
        self.outer_loops = sorted(self.loops_of_task[-1], key=begin_of)

    def spans(self, name=None):
        found = [event for event in self.events if event["cat"] == "span"]
        return sorted((e for e in found if name in (None, e["name"])), key=begin_of)

    def recorded_steps(self):
        """Returns a pair for each step that has tasks: its span and its tree."""
        found = []
        for step in self.spans("step"):
            loops = [loop for loop in self.outer_loops if contains(step, loop)]
            if any(loop["args"]["loop"] in self.tasks_of_loop for loop in loops):
                found.append((step, self._task(step, loops)))
        return found

    def _task(self, event, loops):
        """Returns the tree of a span or a task that ran these loops."""
        items, now = [], begin_of(event)
        for loop in sorted(loops, key=begin_of):
            items += [MICROSECOND * max(begin_of(loop) - now, 0.0), self._loop(loop)]
            now = end_of(loop)
        return Task([*items, MICROSECOND * max(end_of(event) - now, 0.0)])

    def _loop(self, event):
        tasks = sorted(self.tasks_of_loop[event["args"]["loop"]],
                       key=lambda task: task["args"]["index"])
        if len(tasks) != event["args"]["tasks"]:
            raise ValueError(f"the trace has {len(tasks)} of {event['args']['tasks']} tasks of the "
                             f"loop '{event['name']}'")
        return Loop(event["name"],
                    [self._task(task, self.loops_of_task[task["args"]["task"]]) for task in tasks])


def shortest(trees):
    """Returns the tree of the same step of several runs, with the shortest time of each piece of
    work. Other work on the machine can only lengthen a piece."""
    first = trees[0]
    if isinstance(first, float):
        return min(trees)
    if isinstance(first, Loop):
        if any(tree.name != first.name for tree in trees):
            raise ValueError(f"the runs differ in a loop '{first.name}'")
        return Loop(first.name, [shortest(tasks) for tasks in zip(*(t.tasks for t in trees),
                                                                  strict=True)])
    return Task([shortest(items) for items in zip(*(t.items for t in trees), strict=True)])
