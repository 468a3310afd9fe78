"""Tests files that were made to break the program. Each ends with status 2 and one short sentence,
or is read."""

import os
import re
import resource
import shutil

import h5py
import numpy as np
import pytest

import harness
from harness import QUICK

# A file may be of any kind; a sentence about it may not take longer.
SECONDS = 20


@pytest.fixture(scope="module")
def series():
    series = harness.Series("hostile")
    series.volume = os.path.join(series.directory, "cell", "truth.mrc")
    return series


def refuse(words, *arguments, **keywords):
    """Checks that a command ends with status 2 and one sentence, soon, and returns the sentence."""
    result = harness.tomofield(*arguments, timeout=SECONDS, **keywords)
    assert result.returncode == 2, (arguments, result.returncode, result.stderr[-1000:])
    complaint = result.stderr.splitlines()[-1]
    assert complaint.startswith("tomofield: ") and "internal error" not in complaint, result.stderr
    assert len(complaint) < 1000, len(complaint)
    assert not re.search("[\x00-\x1f\x7f]", complaint), repr(complaint)
    for word in words:
        assert str(word) in complaint, (word, complaint)
    return complaint


def readers(series, *options):
    """Returns every command that reads a series, with these options."""
    output = os.path.join(harness.SCRATCH, "out.mrc")
    sizes = ["--thickness", harness.THICKNESS, "--contrast", "bright"]
    files = harness.merge(series.input, options)
    return [["info", *files], ["reconstruct", *files, *sizes, "-o", output],
            ["baseline", "wbp", *files, *sizes, "-o", output],
            ["evaluate", series.volume, "--series", *files]]


def write(name, contents):
    path = os.path.join(harness.SCRATCH, name)
    with open(path, "wb") as file:
        file.write(contents.encode() if isinstance(contents, str) else contents)
    return path


def test_transforms_whose_determinant_is_not_finite(series):
    for line in ("1e200 1e200 1e200 2e200 0 0", "1 0 0 1 1e300 0", "1e9 0 0 1e9 0 0"):
        xf = write("wild.xf", (line + "\n") * len(harness.TILTS))
        for command in readers(series, "--xf", xf):
            refuse([xf, "line 1"], *command)


def test_angle_files_of_several_columns(series):
    tlt = write("euler.txt", "".join(f"0.0 {tilt} 0.0\n" for tilt in harness.TILTS))
    for command in readers(series, "--tlt", tlt):
        refuse([tlt, "line 1", "one column"], *command)


def test_a_large_or_long_text_file(series):
    for name, contents, word in (("large.tlt", b"1\n" * (33 << 20), "16 MiB"),
                                 ("long.tlt", b"x" * (1 << 20), "line 1")):
        tlt = write(name, contents)
        refuse([tlt, word], *readers(series, "--tlt", tlt)[0])


def test_a_configuration_with_other_than_ascii_letters_outside_of_texts(series):
    for contents in (b"N\xef\xb4\xbf", b"thickness = 24\n\xef\xb4\xbf = 1\n",
                     b"roi = [0, 0, 16, +0'''''\xcf\xa4, 16]\n"):
        config = write("letters.toml", contents)
        refuse([config, "ASCII"], "reconstruct", *series.input, "--thickness", 24, "-o", "out.mrc",
               "--config", config)


@pytest.fixture(scope="module")
def model(series):
    """Returns the results of a short fit."""
    return series.reconstruct("model", "--epochs", 2, "--coarse-epochs", 0)


def resume(series, model, path):
    """Returns the command that would continue from a file in place of the model."""
    folder = harness.fresh_directory("resume")
    shutil.copy(model.volume_path, os.path.join(folder, "out.mrc"))
    os.symlink(path, os.path.join(folder, "out.h5"))
    return ["reconstruct", *series.input, "-o", os.path.join(folder, "out.mrc"), "--resume",
            *harness.merge(QUICK, ["--epochs", 2, "--coarse-epochs", 0])]


def model_readers(series, model, path):
    return [["info", path], ["export", path, "-o", os.path.join(harness.SCRATCH, "box.mrc")],
            ["evaluate", series.volume, "--model", path], resume(series, model, path)]


def test_models_that_crashed_the_program(series, model, shared_data):
    folder = shared_data / "hostile"
    if not folder.is_dir():
        pytest.skip(f"{folder} is no folder")
    files = [*sorted(folder.glob("crash-h5-*")), *sorted(folder.glob("compact_*.h5"))]
    assert len(files) > 10
    for path in files:
        for command in model_readers(series, model, path):
            refuse([], *command)


def test_models_of_other_kinds_of_hdf5(series, model):
    """They are refused in words, whatever HDF5's library makes of them."""
    def with_array(path, make):
        shutil.copy(model.model_path, path)
        with h5py.File(path, "r+", libver="latest") as file:
            del file["field/parameters"]
            make(file["field"])
        return path

    raw = write("raw", bytes(4000))
    cases = {
        "soft.h5": lambda f: f.__setitem__("parameters", h5py.SoftLink("/geometry/tilt_deg")),
        "external.h5": lambda f: f.__setitem__("parameters", h5py.ExternalLink("/dev/zero", "/a")),
        "storage.h5": lambda f: f.create_dataset("parameters", (1000,), "f4",
                                                 external=[(raw, 0, 4000)]),
        "chunks.h5": lambda f: f.create_dataset("parameters", (1 << 40,), "f4", chunks=(1 << 20,)),
        "empty.h5": lambda f: f.create_dataset("parameters", (1 << 40,), "f4"),
    }
    for name, make in cases.items():
        path = with_array(os.path.join(harness.SCRATCH, name), make)
        for command in model_readers(series, model, path):
            refuse([name] if "--resume" not in command else [], *command)
    sparse = os.path.join(harness.SCRATCH, "sparse.h5")
    shutil.copy(model.model_path, sparse)
    with h5py.File(sparse, "r+", libver="latest") as file:  # 4 TiB that take no room
        layout = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        layout.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        layout.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
        large = h5py.h5d.create(file["training/doubles"].id, b"large", h5py.h5t.IEEE_F64LE,
                                h5py.h5s.create_simple((1 << 39,)), layout)
        h5py.Dataset(large).attrs["xxh64"] = np.bytes_(b"0" * 16)
    refuse([sparse, "memory"], "info", sparse)
    old = os.path.join(harness.SCRATCH, "old.h5")
    with h5py.File(model.model_path) as source, h5py.File(old, "w") as file:
        for name in source:
            source.copy(name, file)
        file.attrs.update(source.attrs)
    for command in model_readers(series, model, old):
        refuse(["superblock"], *command)


def test_pipes_and_devices_are_no_files(series, model):
    pipe = os.path.join(harness.SCRATCH, "pipe")
    os.mkfifo(pipe)
    files = harness.SCRATCH
    output = ["-o", os.path.join(files, "out.mrc")]
    sizes = ["--thickness", harness.THICKNESS, "--contrast", "bright"]
    for path in (pipe, "/dev/zero", "/dev/full"):
        refuse([path], "info", path)
        for option in ("--tlt", "--xf", "--xtilt", "--aln", "--mdoc", "--fiducials", "--mask"):
            if option in ("--fiducials", "--mask"):
                command = ["reconstruct", *series.input, *sizes, *output, option, path]
            else:
                command = ["info", *harness.merge(series.input, [option, path])]
            refuse([path], *command)
        refuse([path], "reconstruct", *series.input, *sizes, *output, "--config", path)
        refuse([path], "export", path, *output)
        for command in ([path], [series.volume, path], [series.volume, "--fsc", path],
                        [series.volume, "--model", path],
                        [series.volume, "--fsc", series.volume, "--fsc-mask", path],
                        [series.volume, "--series", path, "--tlt", series.tlt]):
            refuse([path], "evaluate", *command)
    # A pipe in place of a checkpoint, and of the trials of a tuning.
    refuse([], *resume(series, model, pipe))
    os.remove(os.path.join(harness.SCRATCH, "resume", "out.h5"))
    os.mkfifo(os.path.join(harness.SCRATCH, "resume", "out_tune.json"))
    refuse(["out_tune.json"], "reconstruct", *series.input, "-o",
           os.path.join(harness.SCRATCH, "resume", "out.mrc"), "--resume", "--tune", *QUICK)


def test_a_huge_number_of_threads(series):
    for number in ("99999999", "1" + 30 * "0"):
        result = harness.tomofield("info", *series.input, timeout=3 * SECONDS,
                                   env=dict(os.environ, OMP_NUM_THREADS=number))
        assert result.returncode == 0, (number, result.returncode, result.stderr[-1000:])


def test_threads_that_the_system_does_not_grant(series):
    """Their stacks take the memory that there is, so the run ends with a sentence or well."""
    if harness.is_sanitized():
        pytest.skip("sanitizers need more address space")

    def little_memory():
        resource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30))

    result = harness.tomofield("info", *series.input, timeout=3 * SECONDS, preexec_fn=little_memory,
                               env=dict(os.environ, OMP_NUM_THREADS="1024"))
    assert result.returncode in (0, 2), (result.returncode, result.stderr[-1000:])
    assert "terminate" not in result.stderr, result.stderr
    assert result.returncode == 0 or "--threads" in result.stderr, result.stderr


def test_a_limit_of_the_size_of_files(series):
    def small_files():
        resource.setrlimit(resource.RLIMIT_FSIZE, (10000, 10000))

    output = os.path.join(harness.fresh_directory("small"), "out.mrc")
    refuse(["out"], "reconstruct", *series.input, "-o", output,
           *harness.merge(QUICK, ["--epochs", 1]), preexec_fn=small_files)
    assert os.listdir(os.path.dirname(output)) == []


def test_messages_do_not_control_the_terminal(series, model):
    name = "\x1b[31mred\x1b]0;title\x07\n\x9b.mrc"
    for command in (["info", name], ["info", series.stack, "--tlt", name],
                    ["evaluate", os.path.join(harness.SCRATCH, name)]):
        refuse(["\\x1b[31mred"], *command)
    angles = write("control.tlt", "\x1b[2Jclear\n" * len(harness.TILTS))
    refuse(["\\x1b[2J"], "info", *harness.merge(series.input, ["--tlt", angles]))
    path = os.path.join(harness.SCRATCH, "control.h5")
    shutil.copy(model.model_path, path)
    with h5py.File(path, "r+", libver="latest") as file:
        file["training/integers"].move("step", "\x1b]0;owned\x07")
    shown = harness.succeed("info", path).stdout
    assert "\\x1b]0;owned\\x07" in shown and "\x1b" not in shown, shown
