"""Tests runs where the system gives little: in a read-only container with no user of the machine, no
home, no /tmp and a small /dev/shm, and on file systems that do not tell the truth about their space."""

import errno
import os
import subprocess
import sys

import numpy as np
import pytest

import faults
import harness
from harness import QUICK, THICKNESS

NOBODY = 65534

# Runs a command in a file system of its own: sh -c CONTAINER sh ROOT PROGRAM INPUT OUTPUT COMMAND…
# All but /output is read-only.
CONTAINER = """
set -e
root=$1 program=$2 input=$3 output=$4
shift 4
mount -t tmpfs -o mode=755 none "$root"
show() { mkdir -p "$root$2"; mount --rbind "$1" "$root$2"; mount -o remount,bind,ro "$root$2"; }
for folder in /bin /lib /lib64 /sbin; do cp -P "$folder" "$root"; done
show /usr /usr
show /etc /etc
show "$program" /program
show "$input" /input
mkdir -p "$root/output" "$root/proc" "$root/dev/shm"
mount --bind "$output" "$root/output"
mount --rbind /proc "$root/proc"
for device in null zero urandom; do touch "$root/dev/$device"; mount --bind /dev/$device "$root/dev/$device"; done
mount -t tmpfs -o size=64k none "$root/dev/shm"
mount -o remount,bind,ro "$root"
exec env -i /usr/sbin/chroot {drop} "$root" /bin/sh -c 'cd /output && exec "$@"' sh "$@"
"""


def namespace():
    """Returns the command that begins a namespace in which mounts are allowed."""
    return ["unshare", "--mount"] if os.geteuid() == 0 else ["unshare", "--user", "--map-root-user",
                                                             "--mount"]


class Container:
    """Runs the program as nobody in a container that reads one folder and writes another."""

    def __init__(self, scratch, reads):
        self.folder, self.reads, self.root = str(scratch / "output"), str(reads), scratch / "root"
        self.root.mkdir()
        os.mkdir(self.folder)
        os.chmod(self.folder, 0o777)
        self.run("/bin/true", setup=True)

    def run(self, *command, setup=False):
        # In a namespace of users, the only user there can lose no more than his rights.
        drop = f"--userspec={NOBODY}:{NOBODY}" if os.geteuid() == 0 else ""
        bare = ["/usr/bin/setpriv", "--bounding-set=-all", "--inh-caps=-all", "--no-new-privs"]
        ended = subprocess.run(
            [*namespace(), "sh", "-c", CONTAINER.replace("{drop}", drop), "sh", self.root,
             os.path.dirname(harness.PROGRAM), self.reads, self.folder,
             *([] if os.geteuid() == 0 else bare), *map(str, command)],
            capture_output=True, text=True)
        if setup and ended.returncode != 0:
            pytest.skip(f"no container can be made here: {ended.stderr.strip()}")
        return ended

    def tomofield(self, *arguments):
        return self.run("/program/" + os.path.basename(harness.PROGRAM), *arguments)


@pytest.fixture(scope="module")
def series():
    return harness.Series("series")


@pytest.fixture
def container(tmp_path, series):
    os.chmod(series.directory, 0o755)
    return Container(tmp_path, series.directory)


def test_a_read_only_container_gives_the_same_results(container, series):
    outside = series.reconstruct("outside")
    name = os.path.basename(series.stack)
    ended = container.tomofield("reconstruct", f"/input/{name}", "--tlt",
                                f"/input/{os.path.basename(series.tlt)}", *QUICK, "-o", "out.mrc")
    assert ended.returncode == 0, ended
    inside = harness.Results(os.path.join(container.folder, "out.mrc"))
    # The model also has the names of the inputs.
    assert harness.read_bytes(inside.volume_path) == harness.read_bytes(outside.volume_path)
    assert set(os.listdir(container.folder)) == {os.path.basename(p) for p in outside.all_paths}


def test_all_commands_run_in_a_read_only_container(container, series):
    stack = ["/input/" + os.path.basename(series.stack), "--tlt",
             "/input/" + os.path.basename(series.tlt)]
    specimen = ["--thickness", THICKNESS, "--contrast", "bright", "--no-margin"]
    for command in (
            ["info", stack[0]],
            ["reconstruct", *stack, *specimen, "--epochs", 2, "--coarse-epochs", 4, "--align",
             "refine", "-o", "tuned.mrc"],
            ["export", "tuned.h5", "-o", "exported.mrc"],
            ["baseline", "wbp", *stack, *specimen, "-o", "wbp.mrc"],
            ["evaluate", "tuned.mrc", "--series", *stack, "--contrast", "bright"],
            ["simulate", "cell", "--size", 24, "--thickness", 16, "--tilts=-40:40:20"],
            ["batch", stack[0], *specimen, "--tlt", stack[2], "--epochs", 2, "--coarse-epochs", 2,
             "-o", "batch"]):
        ended = container.tomofield(*command)
        assert ended.returncode == 0, (command, ended)


def test_what_a_read_only_container_cannot_write_is_said(container, series):
    for output in ("/input/out.mrc", "/out.mrc", "/tmp/out.mrc"):
        ended = container.tomofield("reconstruct", "/input/" + os.path.basename(series.stack),
                                    "--tlt", "/input/" + os.path.basename(series.tlt), *QUICK, "-o",
                                    output)
        said = [line for line in ended.stderr.splitlines() if line.startswith("tomofield: ")]
        assert ended.returncode == 2 and len(said) == 1 and output in said[0], ended
        assert os.listdir(container.folder) == []


# ------------------------------------------------------- file systems that do not tell the truth

@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """Returns a library that lets file systems say what they like."""
    if harness.is_sanitized():
        pytest.skip("the sanitizers have calls of their own")
    built = faults.build(tmp_path_factory.mktemp("library"))
    if built is None:
        pytest.skip("there is no C compiler")
    return built


def on_small_disk(folder, kibibytes, environment, *command):
    """Runs a command with a small disk at `folder`. Returns the run, and the names of the files that
    it left there. Skips the test where no disk can be mounted."""
    mount = [*namespace(), "sh", "-c", 'mount -t tmpfs -o size="$1"k none "$2" && shift 2 && "$@"', "sh",
             str(kibibytes), folder]
    tried = subprocess.run([*mount, "true"], capture_output=True, text=True)
    if tried.returncode != 0:
        pytest.skip(f"no disk can be mounted here: {tried.stderr.strip()}")
    script = 'cd "$1" && shift; "$@"; status=$?; echo; echo "left: $(ls -A | tr "\\n" " ")"; exit $status'
    ended = subprocess.run([*mount, "sh", "-c", script, "sh", folder, "env",
                            *[f"{key}={value}" for key, value in environment.items()],
                            *map(str, command)], capture_output=True, text=True)
    return ended, ended.stdout.splitlines()[-1].removeprefix("left: ").split()


def test_a_full_disk_is_the_reason_why_a_plan_says_nothing(series, tmp_path):
    fill = 'dd if=/dev/zero of=fill bs=4k count=255 2>/dev/null; "$@"'
    ended, _ = on_small_disk(tmp_path, 1024, {}, "sh", "-c", fill, "sh", harness.PROGRAM, "batch", series.stack,
                             "--tlt", series.tlt, *harness.QUICK, "--dry-run", "-o", "out")
    assert ended.returncode == 2 and "no space left" in ended.stderr, ended


def test_a_disk_that_says_it_is_full_is_written_with_a_warning(library, series):
    ended = []
    told = series.reconstruct("told", run=lambda *words: ended.append(harness.succeed(
        *words, env=dict(os.environ, LD_PRELOAD=library, FAULT_FREE="0"))))
    assert "its disk has only 0 left" in ended[0].stderr, ended[0].stderr
    assert told.same_as(series.reconstruct("truth"))


def test_a_full_disk_is_refused_before_the_work(series, tmp_path):
    ended, left = on_small_disk(tmp_path, 64, {}, "sh", "-c",
                                'head -c 64k /dev/zero > full; exec "$@"', "sh", harness.PROGRAM,
                                "reconstruct", *series.input, *QUICK, "-o", "out.mrc")
    said = [line for line in ended.stderr.splitlines() if line.startswith("tomofield: ")]
    assert ended.returncode == 2 and len(said) == 1 and "out.mrc" in said[0], ended
    assert "epoch" not in ended.stderr and left == ["full"], (ended.stderr, left)


@pytest.mark.parametrize("more", [[], ["--split-tilts"], ["--zarr"]])
def test_too_small_a_disk_is_refused_before_the_work(library, series, tmp_path, more):
    ended = harness.tomofield("reconstruct", *series.input, *QUICK, *more, "-o", tmp_path / "out.mrc",
                              env=dict(os.environ, LD_PRELOAD=library, FAULT_FREE="8192"))
    assert ended.returncode == 2 and "its disk has only" in ended.stderr, ended
    assert "epoch" not in ended.stderr and os.listdir(tmp_path) == []


def test_a_disk_that_says_it_has_room_ends_in_one_sentence(library, series, tmp_path):
    ended, left = on_small_disk(tmp_path, 64, {"LD_PRELOAD": library, "FAULT_FREE": str(1 << 50)},
                                harness.PROGRAM, "reconstruct", *series.input, *QUICK, "-o", "out.mrc")
    said = [line for line in ended.stderr.splitlines() if line.startswith("tomofield: ")]
    assert ended.returncode == 2 and len(said) == 1 and "out." in said[0], ended
    assert "No space left on device" in said[0] and left == [], (said, left)


@pytest.fixture(scope="module")
def large_series(tmp_path_factory):
    """Returns a stack and its tilts, whose views need a scratch file of more than 1 GiB."""
    folder = tmp_path_factory.mktemp("large")
    stack, tilts = os.path.join(folder, "large.mrc"), os.path.join(folder, "large.tlt")
    view = np.random.default_rng(1).integers(0, 100, (4096, 4096)).astype(np.int8)
    harness.write_stack(stack, np.broadcast_to(view, (17, 4096, 4096)))
    np.savetxt(tilts, np.linspace(-48, 48, 17))
    yield stack, tilts
    os.unlink(stack)


@pytest.mark.parametrize("reserve, says", (("lies", "less room than it said"),
                                           (str(errno.EOPNOTSUPP), "cannot reserve")))
def test_a_scratch_file_without_room_ends_in_one_sentence(library, large_series, tmp_path, reserve,
                                                          says):
    """The disk says that it has reserved room, and has not; or it cannot reserve any."""
    stack, tilts = large_series
    ended, left = on_small_disk(tmp_path, 4096, {"LD_PRELOAD": library, "FAULT_RESERVE": reserve},
                                harness.PROGRAM, "reconstruct", stack, "--tlt", tilts, "--thickness",
                                16, "--contrast", "bright", "--no-margin", "--tv", 1, "--epochs", 1,
                                "-o", tmp_path / "out.mrc")
    said = [line for line in ended.stderr.splitlines() if line.startswith("tomofield: ")]
    assert ended.returncode == 2 and len(said) == 1, ended
    assert str(tmp_path) in said[0] and says in said[0], said
    assert not [name for name in left if not name.endswith("-lock")], left


LIBRARY = """
import sys
import tomofield
stack, tilts, output = sys.argv[1:]
try:
    tomofield.reconstruct(stack, tlt=tilts, thickness=16, contrast="bright", with_margin=False,
                          density_variation=1, epochs=1, output=output)
except tomofield.Error as error:
    print("the host lives, and knows:", error)
"""


def test_a_scratch_file_without_room_throws_in_the_library(library, large_series, tmp_path):
    """The library has no handler of signals: the process of its user must not end."""
    module = os.path.join(os.path.dirname(os.path.abspath(harness.PROGRAM)), "python")
    if not os.path.exists(module):
        pytest.skip("the Python module was not built")
    ended, left = on_small_disk(tmp_path, 4096, {"LD_PRELOAD": library, "FAULT_RESERVE": "lies",
                                                 "PYTHONPATH": module},
                                sys.executable, "-c", LIBRARY, *large_series, tmp_path / "out.mrc")
    assert ended.returncode == 0 and "the host lives" in ended.stdout, ended
    assert str(tmp_path) in ended.stdout and "less room than it said" in ended.stdout, ended
    assert not [name for name in left if not name.endswith("-lock")], left
