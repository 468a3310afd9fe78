"""Tests what reconstruct refuses: it exits with 2, says one sentence and writes nothing."""

import json
import os
import re
import resource
import signal
import struct

import mrcfile
import numpy as np
import pytest

import harness
from harness import fresh_directory, is_sanitized, read_bytes, run_measured, write_stack

NX, NY, NUM_VIEWS = 40, 33, 7
TILTS = np.linspace(-60, 60, NUM_VIEWS)

views = np.random.default_rng(1).normal(10, 1, (NUM_VIEWS, NY, NX)).astype(np.float32)


@pytest.fixture(scope="module")
def inputs():
    """Returns the folder of all input files."""
    return fresh_directory("inputs")


@pytest.fixture(scope="module", name="path")
def make_path(inputs):
    def path(name):
        return os.path.join(inputs, name)

    return path


@pytest.fixture(scope="module", name="text_file")
def make_text_file(path):
    def text_file(name, text):
        with open(path(name), "w") as file:
            file.write(text)
        return path(name)

    return text_file


@pytest.fixture(scope="module", name="stack_file")
def make_stack_file(path):
    def stack_file(name, values=views):
        write_stack(path(name), values, 10)
        return path(name)

    return stack_file


@pytest.fixture(scope="module", name="patched_stack")
def make_patched_stack(path, stack):
    def patched_stack(name, *patches):
        """Writes the good stack with other bytes in its header."""
        contents = bytearray(read_bytes(stack))
        for at, value in patches:
            contents[at : at + len(value)] = value
        with open(path(name), "wb") as file:
            file.write(contents)
        return path(name)

    return patched_stack


@pytest.fixture(scope="module")
def stack(stack_file):
    """Returns the path of a stack that is as it should be."""
    return stack_file("good.mrc")


@pytest.fixture(scope="module")
def tlt(text_file):
    """Returns the path of the stack's tilts."""
    return text_file("good.tlt", "".join(f"{tilt:.1f}\n" for tilt in TILTS))


@pytest.fixture(scope="module")
def good(tlt):
    """Returns options that are right for the stack."""
    return ["--tlt", tlt, "--thickness", 20, "--contrast", "bright"]


@pytest.fixture(scope="module")
def out():
    """Returns the path of a volume that nothing may write."""
    return os.path.join(fresh_directory("results"), "out.mrc")


def snapshot(*directories):
    """Returns the bytes of every file in some directories."""
    found = {}
    for directory in directories:
        for folder, _, names in os.walk(directory):
            for name in names:
                found[os.path.join(folder, name)] = read_bytes(os.path.join(folder, name))
    return found


@pytest.fixture(scope="module", name="refuse")
def make_refuse(inputs):
    def refuse(words, *arguments, status=2, **keywords):
        """Checks that the program refuses these arguments for a reason that has these words."""
        watched = os.path.dirname(inputs), harness.SCRATCH
        before = snapshot(*watched)
        result = harness.tomofield(*arguments, **keywords)
        assert result.returncode == status, (arguments, result)
        complaints = [line for line in result.stderr.splitlines() if line.startswith("tomofield: ")]
        assert len(complaints) == 1 and complaints[0] == result.stderr.splitlines()[-1], result.stderr
        # A person can read the sentence: it has no number of three hundred digits.
        assert len(complaints[0]) < 700 and not re.search(r"\d{25}", complaints[0]), complaints[0]
        for sign in ("terminate called", "internal error", "what()", "Traceback", "Aborted"):
            assert sign not in result.stderr, result.stderr
        for word in words:
            assert str(word) in complaints[0], (word, complaints[0])
        assert snapshot(*watched) == before, arguments
        return complaints[0]

    return refuse


@pytest.fixture(scope="module", name="refuse_series")
def make_refuse_series(good, out, refuse, stack):
    def refuse_series(words, file=stack, *options):
        """Checks the same for a series; its options replace the good ones."""
        refuse(words, "reconstruct", file, "-o", out, *harness.merge(good, options))

    return refuse_series


def test_counts_that_differ(refuse_series, stack, text_file):
    short = text_file("short.tlt", "0\n1\n2\n")
    refuse_series([short, stack, 3, NUM_VIEWS], stack, "--tlt", short)
    long = text_file("long.tlt", "1\n" * (NUM_VIEWS + 1))
    refuse_series([long, stack, NUM_VIEWS + 1, NUM_VIEWS], stack, "--tlt", long)
    few = text_file("few.xf", "1 0 0 1 0 0\n" * 5)
    refuse_series([few, stack, 5, NUM_VIEWS], stack, "--xf", few)
    few = text_file("few.xtilt", "0\n" * 2)
    refuse_series([few, stack, 2, NUM_VIEWS], stack, "--xtilt", few)
    empty = text_file("empty.tlt", "")
    refuse_series([empty, 0, NUM_VIEWS], stack, "--tlt", empty)


def test_angles_that_are_none(out, refuse, refuse_series, stack, text_file):
    for line, word in (("twelve", "twelve"), ("nan", "nan"), ("inf", "inf"), ("80.5", "80.5"),
                       ("-81", "-81"), ("1e400", "1e400"), ("3,5", "3,5")):
        name = text_file("angles.tlt", "0\n1\n" + line + "\n3\n4\n5\n6\n")
        refuse_series([name, "line 3", word], stack, "--tlt", name)
    refuse_series([stack], stack, "--tlt", stack)  # swapped
    refuse(["--tlt"], "reconstruct", stack, "-o", out, "--thickness", 20)  # none at all
    bad = text_file("bad.xf", "1 0 0 1 0 0\n" * 6 + "0 0 0 0 0 0\n")
    refuse_series([bad, "line 7"], stack, "--xf", bad)
    bad = text_file("bad.aln", "what is this\n")
    refuse_series([bad], stack, "--aln", bad)


def test_files_that_are_missing_or_something_else(inputs, path, refuse_series, stack, tlt):
    absent = path("absent")
    refuse_series([absent], absent)
    for option in ("--tlt", "--xf", "--xtilt", "--aln", "--mdoc"):
        refuse_series([absent], stack, option, absent)
    refuse_series([inputs], inputs)
    refuse_series([inputs], stack, "--tlt", inputs)
    refuse_series([tlt], tlt)
    refuse_series(["/dev/null"], "/dev/null")
    refuse_series(["x" * 20], "x" * 300)  # longer than a file's name may be


def test_damaged_stacks(patched_stack, path, refuse_series, stack):
    whole = read_bytes(stack)
    for length in (0, 500, 1024, len(whole) - 1):
        with open(path("torn.mrc"), "wb") as file:
            file.write(whole[:length])
        refuse_series([path("torn.mrc"), length] + [len(whole)] * (length >= 1024), path("torn.mrc"))
    integer = lambda value: struct.pack("<i", value)
    for name, at, value in (
        ("negative.mrc", 0, integer(-5)),
        ("zero.mrc", 4, integer(0)),
        ("huge.mrc", 0, integer(2**31 - 1) * 3),
        ("mode.mrc", 12, integer(99)),
        ("complex.mrc", 12, integer(4)),
        ("skip.mrc", 92, integer(-1024)),
        ("far.mrc", 92, integer(2**31 - 1)),
        ("noise.mrc", 0, bytes(range(7, 231))),
    ):
        name = patched_stack(name, (at, value))
        refuse_series([name], name)


def test_pixels_that_are_no_measurements(good, out, refuse_series, stack, stack_file, text_file):
    for value in (np.nan, np.inf, -np.inf):
        values = views.copy()
        values[4, :2] = value  # 80 of 1320: 6 %
        name = stack_file("holes.mrc", values)
        refuse_series([name, "80", "section 5", "--exclude 5"], name)
    values = views.copy()
    values[4, 3, :4] = [np.nan, np.inf, -np.inf, np.nan]
    name = stack_file("four.mrc", values)
    result = harness.succeed("reconstruct", name, "-o", out, *good, "--dry-run")
    assert re.search("warning: .*section 5.* 4 NaN or infinite", result.stderr), result.stderr
    values = views.copy()
    values[2] = 7
    name = stack_file("constant.mrc", values)
    refuse_series([name, "section 3", "constant", "--exclude 3"], name)
    harness.succeed("reconstruct", name, "-o", out, *good, "--dry-run", "--exclude", 3)
    for scale in (1e-30, 1e-42):
        tiny = stack_file("tiny.mrc", views * np.float32(scale))
        refuse_series([tiny, "in every view", "same value"], tiny)
    huge = stack_file("huge.mrc", views * np.float32(1e16))
    refuse_series([huge, "in every view", "beyond"], huge)
    for factor in (1e30, 1e16):
        values = views.copy()
        values[4] *= np.float32(factor)
        large = stack_file("factor.mrc", values)
        refuse_series([large, "section 5", "beyond", "--exclude 5"], large)
    values = views.copy()
    values[4, 3, 3] = 1e38
    name = stack_file("one.mrc", values)
    result = harness.succeed("reconstruct", name, "-o", out, *good, "--dry-run")
    assert re.search("warning: .*section 5.* 1 NaN or infinite", result.stderr), result.stderr
    refuse_series(["8", "1 to 7"], stack, "--exclude", 8)
    refuse_series(["two"], stack, "--exclude", "two")
    refuse_series([stack], stack, "--exclude", f"1-{NUM_VIEWS}")  # none is left
    refuse_series(["--log"], stack, "--contrast", "bright", "--log")
    negative = stack_file("negative.mrc", -views)
    refuse_series([negative, "--log"], negative, "--contrast", "dark", "--log")
    away = text_file("away.xf", "1 0 0 1 1000 0\n" * NUM_VIEWS)
    refuse_series([stack, "section 1"], stack, "--xf", away)


def test_views_in_other_units_are_named(good, refuse_series, stack_file, tmp_path):
    """One view decides the fit, or lets it diverge, if its numbers are a thousand times others."""
    structured = views + 5 * np.sin(np.arange(NX, dtype=np.float32) / 5)
    for factor in (1e4, 1e12, 1e-6, 1e-12):
        values = structured.copy()
        values[4] *= np.float32(factor)
        name = stack_file("units.mrc", values)
        refuse_series(["section 5", "other units", "--exclude 5"], name)
    for factor in (1e4, 1e8, 1e12):  # the empty beam is then that of this view
        values = structured.max() + 50 - structured
        values[4] *= np.float32(factor)
        refuse_series(["section 5", "other units", "--exclude 5"], stack_file("units.mrc", values),
                      "--contrast", "dark")
    for factor, offset, says in ((100, 0, "times those of the other views"),
                                 (0.01, 0, "times those of the other views"),
                                 (1, 100, "grey level of section 5 (tilt"), (1, 2, None)):
        values = structured.copy()
        values[4] = values[4] * np.float32(factor) + np.float32(offset)
        name = stack_file("units.mrc", values)
        said = harness.succeed("reconstruct", name, "-o", tmp_path / f"{factor}_{offset}.mrc",
                               *good).stderr
        if says:
            assert says in said and "--exclude 5" in said, (factor, offset, said)
        else:
            assert "section 5" not in said, said


def test_contrast_transfers_that_no_view_can_show(refuse_series, stack, path):
    """The rings of the transfer would be narrower than the view can tell apart."""
    for options in (["--defocus", 1000], ["--defocus", 3, "--pixel-size", 0.001]):
        refuse_series(["section 1", "defocus", "pixel size"], stack, *options, "--voltage", 300,
                      "--cs", 2.7, "--amplitude-contrast", 0.07)


def test_simulated_contrast_transfers_that_no_view_can_show(path):
    """They would take any time and memory, and no signal would stop them."""
    for voxel_A, defocus_um in ((1, "50:50"), (0.001, "2:4"), (1, "4:4")):
        said = harness.tomofield("simulate", path("rings"), "--size", 48, "--thickness", 24, "--tilts=-60:60:20",
                                 "--voxel-size", voxel_A, "--defocus", defocus_um)
        assert said.returncode == 2 and "smaller defocus" in said.stderr, said
    assert not os.path.exists(path("rings"))


def test_exposures_that_are_none(path, refuse_series, stack, text_file):
    for key in ("ExposureDose", "PriorRecordDose"):
        for value in ("nan", "-3", "much"):
            sections = [f"[ZValue = {i}]\nTiltAngle = {tilt}\n{key} = {value if i == 2 else 3}\n"
                        for i, tilt in enumerate(TILTS)]
            mdoc = text_file("doses.mdoc", "PixelSpacing = 10\n\n" + "\n".join(sections))
            refuse_series([mdoc, "line 13", value], stack, "--mdoc", mdoc)


def test_options_that_make_no_sense(good, out, refuse, refuse_series, stack, tlt):
    for option, values in {
        "--thickness": [0, -5, "nan", "inf", 1e12, "thick", ""],
        "--leaf-size": [0, -16, 17, 8, 1 << 20, 32.5],
        "--bin": [0.5, 0, -2, "nan", "inf", 1000],
        "--angpix": [5, -1, "nan"],
        "--pixel-size": [0, -1, "nan", "inf"],
        "--subsets": [0, -1, 1.5, 1e30],
        "--epochs": [0, -3, 99999999999],
        "--rank": [0, 1000],
        "--vertex-spacing": [0, -1, "nan", 1000],
        "--margin-spacing": [0, "nan", 1e9],
        "--learning-rate": [0, -1, "nan", "inf"],
        "--tv": [-1, "nan", "inf"],
        "--tv-factors": [-1, "nan"],
        "--bcc": [-1, "nan"],
        "--ifp": [-1, "inf"],
        "--ifp-ring": ["median"],
        "--checkpoint-minutes": [-1, "nan"],
        "--seed": [-1, 1.5, 1e40],
        "--black-level": ["nan", "-inf", 1e15],
        "--hand": [0, 2],
        "--center": ["nan", "20,nan", 1e9, "20,-1e9", "1,2,3"],
        "--roi": ["0,0,41,33", "-1,0,9,9", "5,5,5,9", "9,9,3,3", "0,0,9", "0,0,9,9,9", "a,b,c,d",
                  "0,0,9,99999999999999999999"],
        "--field": ["mesh"],
        "--contrast": ["grey"],
        "--mode": [0, 3],
        "--axes": ["zyx"],
        "--view-scale": ["maybe"],
        "--threads": [0, 5000],
    }.items():
        for value in values:
            refuse_series([option.split("-")[2]], stack,
                          f"{option}={value}")
    refuse_series(["--nonsense"], stack, "--nonsense")
    refuse_series(["more.mrc"], stack, "more.mrc")
    refuse_series(["--bin", "--angpix"], stack, "--bin", 2, "--angpix", 20)
    refuse_series(["--overwrite", "--resume"], stack, "--overwrite", "--resume")
    refuse(["--thickness"], "reconstruct", stack, "-o", out, "--tlt", tlt)
    refuse(["-o", "--output"][1:], "reconstruct", stack, *good)
    refuse(["stack"], "reconstruct", "-o", out, *good)
    refuse(["reconstrct"], "reconstrct")
    refuse_series(["--leaf-size"], stack, "--leaf-size", 0, "--coarse-bin", 2147483647)
    refuse_series(["--align", "--engine slab"], stack, "--align", "full", "--engine", "ray")
    # Every mistake is named at once.
    refuse_series(["--tv", "--rank", "--leaf-size"], stack, "--tv", -1, "--rank", 0,
                  "--leaf-size", 1)


def test_usage_is_what_is_typed():
    for words in ([], ["reconstruct"], ["baseline"], ["baseline", "tv"], ["compare"]):
        usage = f"Usage: {' '.join(['tomofield', *words])} [OPTIONS]"
        assert usage in harness.succeed(*words, "--help").stdout, usage


@pytest.fixture(scope="module", name="refuse_output")
def make_refuse_output(good, refuse, stack):
    def refuse_output(words, output, *options):
        refuse(words, "reconstruct", stack, "-o", output, *good, *options)

    return refuse_output


def test_outputs_that_cannot_be_written(inputs, path, refuse_output, stack):
    for output in (os.path.join(inputs, "no", "out.mrc"), os.path.join(stack, "out.mrc"),
                   "/proc/nowhere/out.mrc", "/dev/full", inputs, inputs + "/", "",
                   os.path.join(inputs, "x" * 300)):
        refuse_output([output[:40]], output, "--overwrite")
    refuse_output(["out.h5", ".mrc"], path("out.h5"))
    refuse_output(["out.json", ".mrc"], path("out.json"))


def test_outputs_that_exist_are_kept(good, refuse, refuse_output, stack):
    directory = fresh_directory("existing")
    for name in ("out.mrc", "out.h5", "out.json", "out_xy.png", "out_yz.png"):
        existing = os.path.join(directory, name)
        with open(existing, "w") as file:
            file.write("years of work")
        refuse_output([existing, "--overwrite"], os.path.join(directory, "out.mrc"))
        refuse_output([existing, "--overwrite"], os.path.join(directory, "out.mrc"), "--dry-run")
        os.remove(existing)
    for method in ("sirt", "tv"):
        refuse(["good.mrc"], "baseline", method, stack, "-o", stack, *good, "--overwrite")


def test_the_input_is_never_the_output(good, inputs, path, refuse, refuse_output, stack, text_file,
                                       tlt):
    os.symlink(stack, path("link.mrc"))
    os.link(stack, path("same.mrc"))
    for output in (stack, os.path.join(inputs, ".", "good.mrc"), path("link.mrc"),
                   path("same.mrc"), os.path.relpath(stack)):
        for options in ([], ["--overwrite"], ["--resume"]):
            refuse_output(["input", stack], output, *options)
    # The files beside the output are no inputs either: the JSON would replace the angles.
    angles = text_file("angles.json", open(tlt).read())
    refuse(["input", angles], "reconstruct", stack, "-o", path("angles.mrc"),
           *harness.merge(good, ["--tlt", angles]), "--overwrite")


def test_a_full_disk(good, refuse, stack):
    def with_little_room():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))

    for name, options in (("model", []), ("checkpoint", ["--checkpoint-minutes", 0])):
        directory = fresh_directory("full")
        refuse([directory], "reconstruct", stack, "-o", os.path.join(directory, "out.mrc"),
               *good, "--no-margin", "--epochs", 1, *options,
               preexec_fn=with_little_room, restore_signals=False)
        assert os.listdir(directory) == []


def test_memory_is_estimated_first(out, path, text_file):
    # The views of 4096 × 4096 pixels repeat one tile.
    tile = np.random.default_rng(2).integers(0, 100, (256, 256), dtype=np.int8)
    large = path("large.mrc")
    with mrcfile.new_mmap(large, (2, 4096, 4096), mrc_mode=0) as file:
        for section in range(2):
            file.data[section] = np.tile(tile, (16, 16))
        file.set_image_stack()
        file.voxel_size = 1
    options = ["-o", out, "--tlt", text_file("two.tlt", "0\n10\n"), "--contrast", "bright"]
    before = os.listdir(os.path.dirname(out))
    status, text, mebibytes = run_measured("reconstruct", large, *options, "--thickness", 50,
                                           "--bin", 8, "--dry-run")
    assert status == 0 and re.search(r"about \d+\.\d\d GiB of memory", text), text
    assert (mebibytes < 1024 or is_sanitized()), mebibytes
    status, text, mebibytes = run_measured("reconstruct", large, *options, "--thickness", 100000,
                                           "--roi", "0,0,4096,16")
    assert status == 2 and (mebibytes < 1024 or is_sanitized()), (status, text, mebibytes)
    assert re.search(r"tomofield: .*needs about \d{3,}\.\d GiB .* \d+\.\d GiB .*--bin", text), text
    for method, own in (("ingp", "--table-bits"), ("fourier-net", "--width"), ("sirt", "--threads")):
        status, text, _ = run_measured("baseline", method, large, *options, "--thickness", 100000,
                                       "--roi", "0,0,4096,16")
        assert status == 2 and re.search(r"GiB.*--bin.*" + own, text), text
    assert os.listdir(os.path.dirname(out)) == before == []
    os.remove(large)


def test_a_stack_of_nothing_is_answered_in_little_memory(out, path, stack, text_file):
    # The header promises 61 views of 4096 × 4096 floats, and the file is sparse.
    header = bytearray(read_bytes(stack)[:1024])
    header[0:12] = struct.pack("<3i", 4096, 4096, 61)
    header[28:40] = struct.pack("<3i", 4096, 4096, 61)
    header[40:52] = struct.pack("<3f", 40960, 40960, 61)
    empty = path("empty.mrc")
    with open(empty, "wb") as file:
        file.write(header)
        file.truncate(1024 + 61 * 4096 * 4096 * 4)
    angles = text_file("all.tlt", "".join(f"{tilt}\n" for tilt in range(-60, 61, 2)))
    status, text, mebibytes = run_measured("reconstruct", empty, "-o", out, "--tlt", angles,
                                           "--thickness", 300, "--bin", 4, "--dry-run")
    assert status == 2 and "in every view" in text and "same value" in text, text
    assert (mebibytes < 1024 or is_sanitized()), mebibytes
    os.remove(empty)


def test_unknown_options_are_named_with_those_that_are_like_them():
    for arguments, says in ((["--thicknes", "160"], "no option --thicknes (did you mean --thickness?);"),
                            (["--algn", "refine"], "no option --algn (did you mean --aln or --align?);"),
                            (["--zzzzzz=3", "-q", "-3"], "no option --zzzzzz; there is no option -q;"),
                            (["--axis", 85], "no option --axis (did you mean --axes?);"),
                            (["--thick", 85], "no option --thick (did you mean --thickness?);"),
                            (["--tv-weight", 3], "no option --tv-weight (did you mean --tv?);"),
                            (["a", "b", "--thickness", 3, "-o", "c.mrc"], "'a', 'b' belong to no option")):
        result = harness.tomofield("reconstruct", "series.mrc", *arguments)
        assert result.returncode == 2 and says in result.stderr, result.stderr


def test_a_stack_that_is_not_there_comes_before_what_it_would_need(inputs):
    for command in (["reconstruct"], ["align"], ["baseline", "wbp"]):
        for arguments in ([], ["--thickness", "0x"], ["-o", "x.mrc"]):
            result = harness.tomofield(*command, "nope.mrc", *arguments, cwd=inputs)
            assert result.returncode == 2 and "'nope.mrc' does not exist" in result.stderr, result
    result = harness.tomofield("reconstruct", "nope.mrc", "--thicknes", 3, cwd=inputs)
    assert "no option --thicknes" in result.stderr, result


def test_options_are_named_as_they_are_written(stack):
    for arguments, says in (
            (["reconstruct", stack, "--bin", 2, "--bin", 4], "--bin is given twice: give it once;"),
            (["reconstruct", stack, "--bin=2", "--bin=2", "--bin=2"], "--bin is given 3 times: give"),
            (["export", stack, "--angpix", 5, "--voxel-size", 6],
             "--angpix and --voxel-size are one option: give one of them;"),
            (["export", stack, "-o", "x.mrc", "--angpix", 0], "--angpix: must be a number from"),
            (["export", stack, "-o", "x.mrc", "--voxel-size", 0], "--voxel-size: must be a number"),
            (["export", stack, "--angpix", 5, "--bin", 2], "--angpix")):
        result = harness.tomofield(*arguments)
        assert result.returncode == 2 and says in result.stderr, (arguments, result.stderr)


def test_an_option_without_its_value_takes_no_other_word(good, out, refuse, stack):
    for option in ("--exclude=", "--thickness=", "--tlt="):
        refuse([f"{option} has no value"], "reconstruct", stack, *good, option, "-o", out)
    refuse(["give -o x.mrc"], "reconstruct", stack, *good, "-o=x.mrc")


def test_volumes_have_no_name_of_another_format(tmp_path):
    stack = tmp_path / "series.mrc"
    write_stack(stack, np.zeros((3, 8, 8), np.float32))
    for name in ("x.tif", "x.H5"):
        result = harness.tomofield("reconstruct", stack, "--thickness", 4, "-o", tmp_path / name)
        assert result.returncode == 2 and "the volume is an MRC file" in result.stderr, result.stderr


def test_strips_are_no_views(tmp_path):
    stack, angles = tmp_path / "strips.mrc", tmp_path / "strips.tlt"
    write_stack(stack, np.random.default_rng(1).normal(100, 1, (14, 1, 32)).astype(np.float32))
    np.savetxt(angles, np.linspace(-50, 50, 14))
    for command in (["reconstruct"], ["baseline", "wbp"], ["baseline", "sirt"]):
        result = harness.tomofield(*command, stack, "--tlt", angles, "--thickness", 16, "-o",
                                   tmp_path / "x.mrc", "--contrast", "bright")
        assert result.returncode == 2 and "views of 32 × 1 pixels" in result.stderr, result.stderr


def test_oblong_pixels_are_refused(refuse_series, patched_stack):
    for at, pixels, size in ((40, NX, 20), (44, NY, 5), (44, NY, 10.1)):
        stack = patched_stack("oblong.mrc", (at, np.float32(pixels * size).tobytes()))
        refuse_series(["only square ones", "--pixel-size", f" {size:g} "], stack)


def test_tilts_that_hardly_differ_are_no_series(refuse_series, stack, text_file):
    for step in (0, 1e-9, 1e-3):
        file = text_file("equal.tlt", "".join(f"{step * i:.9f}\n" for i in range(NUM_VIEWS)))
        refuse_series([file, "no tilt series", str(NUM_VIEWS)], stack, "--tlt", file)


def test_tilts_in_radians_are_doubted(stack, text_file):
    radians = np.radians(np.linspace(-60, 60, NUM_VIEWS))
    for tilts, is_doubted in ((radians, True), (3 * radians, False)):
        file = text_file("radians.tlt", "".join(f"{tilt:.5f}\n" for tilt in tilts))
        ended = harness.succeed("info", stack, "--tlt", file)
        assert ("give degrees" in ended.stderr) == is_doubted, ended.stderr


def test_x_axis_tilts_and_bins_that_make_no_sense(refuse_series, stack, text_file):
    for tilt in ("91", "-80.5"):
        file = text_file("steep.xtilt", "0\n" * 3 + tilt + "\n" + "0\n" * (NUM_VIEWS - 4))
        refuse_series([file, "section 4", "80"], stack, "--xtilt", file)
    file = text_file("half_steep.xtilt", "50\n" * NUM_VIEWS)
    refuse_series([file, "100", "--x-axis-tilt"], stack, "--xtilt", file, "--x-axis-tilt", -50)
    for number in (3, 6, 12):
        refuse_series(["--coarse-bin", "power of two"], stack, "--coarse-bin", number)


def test_memory_is_that_of_leaves_larger_than_the_region(tmp_path):
    """Trials have fields of their own, which are as large as that of the run."""
    if is_sanitized():
        pytest.skip("sanitizers use memory of their own")
    stack, angles, plan = (tmp_path / name for name in ("large.mrc", "large.tlt", "plan.json"))
    write_stack(stack, np.random.default_rng(1).normal(100, 10, (14, 64, 64)).astype(np.float32))
    np.savetxt(angles, np.linspace(-50, 50, 14))
    command = ["reconstruct", stack, "--tlt", angles, "--thickness", 64, "--contrast", "bright",
               "--epochs", 1, "--coarse-epochs", 2, "--prior", "tv", "--leaf-size", 512,
               "--no-margin", "-o", tmp_path / "x.mrc"]
    harness.succeed(*command, "--plan", plan)
    status, said, peak_MiB = run_measured(*command)
    assert status == 0, said
    planned_MiB = json.loads(plan.read_text())["memory_bytes"] / 2**20
    assert 0.5 * planned_MiB < peak_MiB < 1.1 * planned_MiB, (peak_MiB, planned_MiB)


def test_views_of_few_pixels_are_refused(tmp_path):
    stack = tmp_path / "series.mrc"
    write_stack(stack, np.random.default_rng(1).normal(100, 1, (14, 32, 32)).astype(np.float32))
    angles = tmp_path / "series.tlt"
    np.savetxt(angles, np.linspace(-50, 50, 14))
    result = harness.tomofield("reconstruct", stack, "--tlt", angles, "--thickness", 16, "--bin", 8,
                               "--dry-run", "-o", tmp_path / "x.mrc")
    assert result.returncode == 2 and "views of 4 × 4 pixels show nothing" in result.stderr, result.stderr
