"""Lets single calls of a small run fail, kills it, and fills its disk, and checks what it leaves.

    python3 tests/program/faults.py [N] [--program PROGRAM]

tries every N-th call of each kind (every one, unless N is given) and prints a table; faults_test.py
tries some of them."""

import argparse
import errno
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

KINDS = ("open", "read", "write", "sync", "close", "rename", "stat", "allocate")
# What a file server that is away or lost its files answers; its renames may be done all the same.
SERVER = (("open", "once", errno.ESTALE), ("write", "once", errno.EIO), ("sync", "once", errno.EIO),
          ("sync", "from", errno.ESTALE), ("close", "once", errno.EIO), ("close", "from", errno.EIO),
          ("rename", "once", errno.ESTALE), ("rename", "from", errno.ESTALE),
          ("rename", "once-done", errno.ESTALE), ("rename", "from-done", errno.ESTALE))
KILLS, DISKS = 100, 20
FIT = ["--epochs", 2, "--subsets", 3, "--checkpoint-minutes", 0, "--threads", 2]
LARGE = 64 << 10  # bytes; the run is small, so that allocations of this size are its large ones


def build(folder):
    """Builds the library that lets calls fail. Returns its path, or None without a compiler."""
    compiler = shutil.which("cc")
    if not compiler:
        return None
    library = os.path.join(folder, "faults.so")
    source = pathlib.Path(__file__).with_name("faults.c")
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", source, "-o", library], check=True)
    return library


class Fault:
    """One run of `command` in which one call fails, or from one call on all do."""

    def __init__(self, kind, number=0, mode="once", error=0):
        self.kind, self.number, self.mode, self.error = kind, number, mode, error

    def __str__(self):
        return f"{self.kind} {self.number} ({self.mode}, {errno.errorcode.get(self.error)})"

    def environment(self, library, folder, count_file):
        return dict(os.environ, LD_PRELOAD=library, FAULT_KIND=self.kind, FAULT_MODE=self.mode,
                    FAULT_NUMBER=str(self.number), FAULT_FOLDER=folder, FAULT_COUNT=count_file,
                    FAULT_LARGE=str(LARGE), FAULT_ERROR=str(self.error))


class Sweep:
    """Runs reconstruct with checkpoints and all outputs under faults."""

    def __init__(self, scratch, library):
        import harness
        self.harness, self.scratch, self.library = harness, str(scratch), library
        harness.SCRATCH = self.scratch
        self.series = harness.Series("series")
        self.results = harness.fresh_results("out")
        self.old = self.finished(["--epochs", 1])
        self.new = self.finished([])

    def command(self, *options):
        quick = self.harness.merge(self.harness.QUICK, FIT)
        return ["reconstruct", *self.series.input, *self.harness.merge(quick, options), "-o",
                self.results.volume_path]

    def finished(self, options):
        """Returns the bytes of all results of a run that nothing disturbs, by name."""
        self.empty()
        self.harness.succeed(*self.command(*options))
        return self.contents()

    def folder(self):
        return os.path.dirname(self.results.volume_path)

    def empty(self):
        shutil.rmtree(self.folder())
        os.makedirs(self.folder())

    def contents(self):
        return {os.path.basename(path): data
                for path, data in self.harness.contents(self.folder()).items()}

    def prepare(self, has_old_results):
        self.empty()
        for name, data in self.old.items() if has_old_results else ():
            with open(os.path.join(self.folder(), name), "wb") as file:
                file.write(data)

    def run(self, fault, *options, below=""):
        """Runs with a fault in the files whose paths begin with `below`; by default in all."""
        counted = os.path.join(self.scratch, "count")
        environment = fault.environment(self.library, below or self.scratch, counted)
        return self.harness.tomofield(*self.command(*options), env=environment)

    def count(self, kind, *options):
        """Returns how many calls of a kind the run makes."""
        self.empty()
        assert self.run(Fault(kind), *options).returncode == 0
        with open(os.path.join(self.scratch, "count"), encoding="ascii") as file:
            return int(file.read())

    def check(self, fault, has_old_results):
        """Runs with a fault, checks what it says and leaves, and runs again to the right end."""
        self.prepare(has_old_results)
        ended = self.run(fault, "--overwrite" if has_old_results else "--resume")
        self.check_end(ended, fault)
        self.check_files(ended, fault, has_old_results)
        self.check_next_run(fault)
        return ended

    def check_end(self, ended, fault):
        if fault.mode == "kill":
            assert ended.returncode in (-9, 0), (str(fault), ended)
            return
        assert ended.returncode in (0, 1, 2), (str(fault), ended)
        said = [line for line in ended.stderr.splitlines() if line.startswith("tomofield: ")]
        assert len(said) == (ended.returncode != 0), (str(fault), ended)

    def check_files(self, ended, fault, has_old_results):
        """Checks that the results are the old or the new ones; the model may be a checkpoint."""
        before = self.old if has_old_results else {}
        after = self.contents()
        # If the system refuses to give the old files back, the message names what lies where. Files
        # that could not get their names stay as well until the next run.
        may_mix = ended.returncode == -9 or "what was in" in ended.stderr
        hidden = {name for name in after if name.startswith(".")}
        assert may_mix or not hidden, (str(fault), hidden, ended)
        if ended.returncode == 0:
            assert set(after) == set(self.new) and self.is_right(after), (str(fault), ended)
        for name in (set(before) | set(after)) - hidden:
            is_old = after.get(name) == before.get(name)
            may_be_new = may_mix and name in after and self.is_whole(name, after[name])
            assert ended.returncode == 0 or name == "out.h5" or is_old or may_be_new, (
                str(fault), name, ended)

    def is_whole(self, name, data):
        """Says whether a result is one of the new run; its JSON and its report have times."""
        if name.endswith(".json"):
            return json.loads(data) is not None
        return data.endswith(b"</html>\n") if name.endswith(".html") else data == self.new[name]

    def is_right(self, files):
        return all(self.is_whole(name, files[name]) for name in self.new)

    def check_next_run(self, fault):
        """Checks that the next run, which resumes if there is a checkpoint, has the right bits."""
        has_checkpoint = self.contents().get("out.h5") not in (None, self.old["out.h5"])
        self.harness.succeed(*self.command("--resume" if has_checkpoint else "--overwrite"))
        after = self.contents()
        assert set(after) == set(self.new) and self.is_right(after), (str(fault), set(after))


def moments(count, most):
    """Returns at most `most` numbers from 1 to `count` at equal distances."""
    most = min(most, count)
    return [1 + i * (count - 1) // max(1, most - 1) for i in range(most)]


def can_mount():
    with tempfile.TemporaryDirectory() as folder:
        made = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "none", folder],
                              capture_output=True)
        if made.returncode == 0:
            subprocess.run(["umount", folder], check=True)
        return made.returncode == 0


def check_full_disk(sweep, kibibytes, has_old_results):
    """Runs on a disk of a size, which is too small, and then on the same disk with more room."""
    sweep.empty()
    folder = sweep.folder()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={kibibytes}k", "none", folder], check=True)
    try:
        for name, data in sweep.old.items() if has_old_results else ():
            with open(os.path.join(folder, name), "wb") as file:
                file.write(data)
        fault = Fault(f"disk of {kibibytes} KiB")
        option = "--overwrite" if has_old_results else "--resume"
        ended = sweep.harness.tomofield(*sweep.command(option))
        sweep.check_end(ended, fault)
        sweep.check_files(ended, fault, has_old_results)
        subprocess.run(["mount", "-o", "remount,size=64m", folder], check=True)
        sweep.check_next_run(fault)
    finally:
        subprocess.run(["umount", folder], check=True)
    return ended


def disk_sizes(sweep, has_old_results, most):
    """Returns sizes in KiB between what is there before and what a run needs at once."""
    used = sum(len(data) for data in sweep.old.values()) // 1024 if has_old_results else 0
    need = sum(len(data) for data in sweep.new.values()) // 1024 + 64
    pages = 8 * len(sweep.old) if has_old_results else 0
    return [used + pages + 4 + i * need // most for i in range(most)]


def print_row(name, tried, refused, failed):
    print(f"| {name} | {tried} | {refused} | {failed} |", flush=True)


def try_all(name, trials):
    """Runs trials, prints a row of the table, and returns how many failed."""
    refused = failed = 0
    for trial in trials:
        try:
            refused += trial().returncode != 0
        except AssertionError as error:
            failed += 1
            print(f"{name}: {error}", file=sys.stderr, flush=True)
    print_row(name, len(trials), refused, failed)
    return failed


def sweep_all(sweep, every):
    """Prints the table of all faults and returns how many trials failed. Trials with old results
    and without alternate."""
    failed = 0
    print("| what happens | runs | of these stopped | wrong |\n|-|-|-|-|")
    for kind in KINDS:
        for mode in ("once", "from"):
            numbers = range(1, sweep.count(kind) + 1, every)
            failed += try_all(f"{kind} fails {mode}", [
                lambda fault=Fault(kind, n, mode), old=(i + (mode == "from")) % 2 == 1:
                sweep.check(fault, old) for i, n in enumerate(numbers)])
    for kind, mode, error in SERVER:
        numbers = range(1, sweep.count(kind) + 1, every)
        failed += try_all(f"{kind} fails {mode} ({errno.errorcode[error]})", [
            lambda fault=Fault(kind, n, mode, error), old=i % 2 == 1: sweep.check(fault, old)
            for i, n in enumerate(numbers)])
    kills = moments(sweep.count("io"), max(2, KILLS // every))
    failed += try_all("SIGKILL", [
        lambda fault=Fault("io", n, "kill"), old=i % 2 == 1: sweep.check(fault, old)
        for i, n in enumerate(kills)])
    if can_mount():
        failed += try_all("full disk", [
            lambda size=size, old=old: check_full_disk(sweep, size, old)
            for old in (False, True) for size in disk_sizes(sweep, old, max(2, DISKS // 2 // every))])
    else:
        print_row("full disk", "skipped: mount is not allowed", "", "")
    return failed


def main():
    project = pathlib.Path(__file__).resolve().parents[2]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--program", default=project / "build/release/tomofield")
    parser.add_argument("every", type=int, nargs="?", default=1)
    options = parser.parse_args()
    os.environ["TOMOFIELD_PROGRAM"] = str(pathlib.Path(options.program).resolve())
    with tempfile.TemporaryDirectory() as scratch:
        return 1 if sweep_all(Sweep(scratch, build(scratch)), options.every) else 0


if __name__ == "__main__":
    sys.exit(main())
