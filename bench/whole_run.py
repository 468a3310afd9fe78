"""Splits a traced run with one thread into its spans and predicts what more threads do to it.

A loop whose tasks were not recorded takes the longest of its tasks, or its share of all of them if
that is longer. A step takes its own work and that of its loops times what the schedule (schedule.py)
says of the last step before it, or this one, whose tasks were recorded."""

import bisect
import dataclasses

from trace_tree import MICROSECOND, begin_of, contains


@dataclasses.dataclass
class Part:
    """Sums over all spans of one name in one place. `own` is what is in no span inside of them."""
    name: str
    depth: int
    calls: int = 0
    seconds: float = 0.0
    in_loops: float = 0.0
    modelled: dict = dataclasses.field(default_factory=dict)  # {threads: seconds}


class Node:
    """A span, a loop outside of all tasks, or the whole run."""

    def __init__(self, event, kind):
        self.event, self.kind, self.children = event, kind, []

    def seconds(self):
        return MICROSECOND * self.event["dur"]


def nested(trace, wall_seconds):
    """Returns the whole run as a node of spans and loops. What a task does is no part of it."""
    whole = Node({"name": "the program", "ts": 0.0, "dur": wall_seconds / MICROSECOND}, "span")
    events = [(event, "span") for event in trace.spans()]
    events += [(event, "loop") for event in trace.outer_loops]
    stack = [whole]
    for event, kind in sorted(events, key=lambda pair: (begin_of(pair[0]), -pair[0]["dur"])):
        while len(stack) > 1 and not contains(stack[-1].event, event):
            stack.pop()
        if stack[-1].kind == "loop":
            continue
        node = Node(event, kind)
        stack[-1].children.append(node)
        stack.append(node)
    return whole


def loop_seconds(loop, threads):
    facts = loop["args"]
    return facts["busy_s"] if threads == 1 else max(facts["busy_s"] / threads, facts["longest_s"])


class WholeRun:
    """Holds the parts of a run in the order in which they began. `gains` lists, for each recorded
    step, {threads: modelled seconds over those of one thread}."""

    def __init__(self, trace, wall_seconds, gains, threads):
        self.gains, self.threads = gains, threads
        self.begins = [begin_of(span) for span, _ in trace.recorded_steps()]
        self.parts = {}
        self._visit(nested(trace, wall_seconds), ())

    def _visit(self, node, path):
        """Adds a span to its part. Returns its seconds in loops and {threads: modelled seconds}."""
        path = (*path, node.event["name"])
        part = self.parts.setdefault(path, Part(path[-1], len(path) - 1))
        in_loops = 0.0
        serial = node.seconds()
        modelled = dict.fromkeys(self.threads, 0.0)
        for child in node.children:
            serial -= child.seconds()
            if child.kind == "loop":
                loops = child.event["args"]["busy_s"]
                in_child = {n: loop_seconds(child.event, n) for n in self.threads}
            else:
                loops, in_child = self._visit(child, path)
            in_loops += loops
            for n in self.threads:
                modelled[n] += in_child[n]
        for n in self.threads:
            modelled[n] += serial
        if node.event["name"] == "step" and self.begins:
            modelled = self._model_step(node)
        part.calls += 1
        part.seconds += node.seconds()
        part.in_loops += in_loops
        for n in self.threads:
            part.modelled[n] = part.modelled.get(n, 0.0) + modelled[n]
        return in_loops, modelled

    def _model_step(self, node):
        recorded = max(0, bisect.bisect_right(self.begins, begin_of(node.event)) - 1)
        return {n: node.seconds() * self.gains[recorded][n] for n in self.threads}
