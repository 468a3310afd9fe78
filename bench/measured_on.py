"""Says where and with which commit a row of a bench was measured."""

import datetime
import os
import re
import subprocess


def commit_of(program):
    """Returns the commit that `tomofield --version` names."""
    done = subprocess.run([program, "--version"], capture_output=True, text=True)
    found = re.search(r"\((.+)\)", done.stdout)
    return found.group(1) if found else "unknown"


def cpu_model():
    with open("/proc/cpuinfo") as file:
        found = re.search(r"model name\s*: (.*)", file.read())
    return found.group(1) if found else ""


def machine():
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return {"cpu": cpu_model(), "threads": len(os.sched_getaffinity(0)),
            "memory_GiB": round(memory / 2**30, 1)}


def machine_text(facts):
    return f"{facts['cpu']}, {facts['threads']} threads, {facts['memory_GiB']} GiB"


def origin(commit):
    """Returns {machine, commit, date} of a row that is measured now."""
    return {"machine": machine(), "commit": commit,
            "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds")}


def origins(parts):
    """Returns {machines, commits, date} of rows that were measured: all of the former, and the
    latest date."""
    return {"machines": sorted({machine_text(part["machine"]) for part in parts}),
            "commits": sorted({part["commit"] for part in parts}),
            "date": max((part["date"] for part in parts), default="")}


def print_origins(facts):
    print(f"{'; '.join(facts['machines'])}; commit {', '.join(facts['commits'])}; {facts['date']}.",
          end=" ")
