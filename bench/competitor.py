"""Takes half of one processor, as another program of a busy machine would.

usage: competitor.py PROCESSOR    prints the share that it got when SIGTERM ends it"""

import os
import signal
import subprocess
import sys
import time

BUSY = 0.005  # seconds of processor time in each period
PERIOD = 0.010


class Competitor:
    """Runs the competitor on a processor from its start to stop()."""

    def __init__(self, processor):
        self.process = subprocess.Popen(["/usr/bin/python3", os.path.abspath(__file__),
                                         str(processor)], stdout=subprocess.PIPE, text=True)
        self.process.stdout.readline()  # it runs now

    def stop(self):
        """Ends the competitor and returns its processor time over the time by the clock."""
        self.process.terminate()
        said, _ = self.process.communicate()
        return float(said)


def compete(processor):
    stopped = []
    signal.signal(signal.SIGTERM, lambda *_: stopped.append(True))
    os.sched_setaffinity(0, {processor})
    print("started", flush=True)
    begin, begin_busy = time.monotonic(), time.process_time()
    period = begin
    while not stopped:
        until = time.process_time() + BUSY
        while time.process_time() < until:
            pass
        # Late periods are not made up for, so that the share stays even.
        period = max(period + PERIOD, time.monotonic())
        time.sleep(max(0.0, period - time.monotonic()))
    print((time.process_time() - begin_busy) / (time.monotonic() - begin), flush=True)


if __name__ == "__main__":
    compete(int(sys.argv[1]))
