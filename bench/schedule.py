"""Models how threads share out the tasks of a step (trace_tree.Task), as src/base/threads/worker_threads.cc
does.

The rules: A loop's tasks are taken in the order of their index. The thread that runs into a loop
works on the tasks of that loop alone until all are done, and has nothing to do while other threads
do the last of them. A thread without a task takes one of the outermost loop that has some left, of
the one that was opened first if there are several. Taking a task costs a fixed time. Nothing else
costs anything: the threads do not compete for memory."""

import collections
import dataclasses
import heapq
import itertools

from trace_tree import Loop


@dataclasses.dataclass
class Lane:
    """Says what a thread did for a while. Tasks of inner loops have a larger depth."""
    thread: int
    begin: float
    end: float
    name: str
    depth: int


class OpenLoop:
    def __init__(self, loop, depth, thread):
        self.loop, self.depth, self.owner = loop, depth, thread
        self.next = self.done = 0

    def has_tasks(self):
        return self.next < len(self.loop.tasks)

    def is_done(self):
        return self.done == len(self.loop.tasks)


class Frame:
    """A task that a thread has begun: what of it is left, and the loop that it waits for."""

    def __init__(self, items, of, begin):
        self.items, self.of, self.begin = iter(items), of, begin
        self.waits_for = None


class Schedule:
    """Runs a step on a number of threads. It takes `seconds`. `lanes` says what each thread did, and
    `outer` lists (name, seconds) of the step's own work (name None) and of its outermost loops."""

    def __init__(self, step, threads, task_cost):
        self.task_cost = task_cost if threads > 1 else 0.0
        self.lanes, self.outer = [], []
        self.open = collections.defaultdict(collections.deque)  # by depth
        self.stacks = [[] for _ in range(threads)]
        self.idle = list(range(1, threads))  # a heap
        self.order = itertools.count()
        self.events = []
        self.seconds = 0.0
        self.stacks[0].append(Frame(step.items, None, 0.0))
        self._resume(0, 0.0)
        while self.events:
            now, _, thread = heapq.heappop(self.events)
            self._advance(thread, now)

    def _resume(self, thread, at):
        heapq.heappush(self.events, (at, next(self.order), thread))

    def _advance(self, thread, now):
        """Lets a thread do everything that takes no time. It ends with work that takes time, or with
        nothing to do."""
        stack = self.stacks[thread]
        while True:
            if not stack:
                loop = self._next_loop()
                if loop is None:
                    heapq.heappush(self.idle, thread)
                    return
                return self._take(thread, loop, now)
            frame = stack[-1]
            if frame.waits_for is not None:
                if frame.waits_for.has_tasks():
                    return self._take(thread, frame.waits_for, now)
                if not frame.waits_for.is_done():
                    return  # the thread that does the last task resumes this one
                self._close(frame, now)
            item = next(frame.items, None)
            if item is None:
                stack.pop()
                self._finish(frame, thread, len(stack), now)
            elif isinstance(item, Loop):
                self._open(frame, item, thread, now)
            else:
                if frame.of is None:
                    self.outer.append((None, item))
                return self._resume(thread, now + item)

    def _next_loop(self):
        for depth in sorted(self.open):
            loops = self.open[depth]
            while loops and not loops[0].has_tasks():
                loops.popleft()
            if loops:
                return loops[0]
            del self.open[depth]
        return None

    def _take(self, thread, loop, now):
        task = loop.loop.tasks[loop.next]
        loop.next += 1
        self.stacks[thread].append(Frame(task.items, loop, now))
        self._resume(thread, now + self.task_cost)

    def _open(self, frame, loop, thread, now):
        depth = frame.of.depth + 1 if frame.of else 0
        frame.waits_for = OpenLoop(loop, depth, thread)
        frame.opened = now
        self.open[depth].append(frame.waits_for)
        for _ in range(min(len(loop.tasks) - 1, len(self.idle))):
            self._resume(heapq.heappop(self.idle), now)

    def _close(self, frame, now):
        if frame.of is None:
            self.outer.append((frame.waits_for.loop.name, now - frame.opened))
        frame.waits_for = None

    def _finish(self, frame, thread, depth, now):
        loop = frame.of
        if loop is None:
            self.seconds = now
            return
        self.lanes.append(Lane(thread, frame.begin, now, loop.loop.name, loop.depth))
        loop.done += 1
        if loop.is_done() and loop.owner != thread:
            self._resume(loop.owner, now)


def limits(step, schedule, threads):
    """Returns {what: share of all threads' time that it leaves unused}. What is the name of an
    outermost loop, or None for the step's own work, during which all threads but one have nothing
    to do."""
    work = collections.Counter()
    for loop in step.loops():
        work[loop.name] += loop.work()
    work[None] = step.own()
    taken = collections.Counter()
    for name, seconds in schedule.outer:
        taken[name] += seconds
    whole = threads * schedule.seconds
    return {name: (threads * taken[name] - work[name]) / whole for name in taken}
