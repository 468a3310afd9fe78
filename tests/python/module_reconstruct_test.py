"""tomofield.reconstruct() gives what the program gives, and stops when it is told to."""

import _thread
import inspect
import json
import logging
import multiprocessing
import os
import pathlib
import re
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import tomofield


def test_arrays_with_the_defaults_give_the_bits_of_the_program(series):
    reports = []
    made = tomofield.reconstruct(series.views, series.tilt_deg, thickness=16, contrast="bright",
                                 with_margin=False, pixel_size_A=10, progress=reports.append)
    assert made.is_finished
    assert made.tomogram.values.dtype == np.float32
    assert made.tomogram.voxel_size_A == 10
    np.testing.assert_array_equal(made.tomogram, series.tomogram)
    np.testing.assert_array_equal(made.model.sample(made.model.region()), series.tomogram)
    assert reports[-1].fraction_done == 1.0 and {r.is_trial for r in reports} == {True, False}
    written = tomofield.read_record(series.folder / "tomogram.mrc")
    assert made.options["fit"] == written.options["fit"]
    assert made.verdict.startswith("verdict: residual") and isinstance(made.warnings, list)


def test_metrics_are_not_nested(series):
    written = read_json(series, "tomogram.json")
    record = tomofield.read_record(series.folder / "tomogram.mrc")
    assert record.metrics == written["metrics"] and record.options == written["options"]
    assert record.metrics["verdict"]["line"] == record.verdict
    assert tomofield.read_metrics(series.folder / "tomogram.json") == record.metrics


def test_files_with_the_defaults_give_the_bytes_of_the_program(series, tmp_path):
    made = tomofield.reconstruct(series.folder / "s.mrc", tlt=str(series.folder / "s.tlt"),
                                 thickness=16, contrast="bright", with_margin=False,
                                 output=tmp_path / "t.mrc")
    assert made.tomogram is None
    assert (tmp_path / "t.mrc").read_bytes() == (series.folder / "tomogram.mrc").read_bytes()
    assert made.record == tomofield.read_record(tmp_path / "t.mrc")
    assert sorted(os.listdir(tmp_path)) == [
        "t.h5", "t.json", "t.mrc", "t_choice.png", "t_denoise.png", "t_mask.png", "t_prior.png",
        "t_report.html", "t_xy.png", "t_xz.png", "t_yz.png"]


def read_json(series, name):
    return json.loads((series.folder / name).read_text())


def test_layouts_and_types_of_arrays_do_not_matter(series, quick):
    usual = tomofield.reconstruct(series.views, series.tilt_deg, **quick).tomogram
    flipped = np.asfortranarray(series.views.astype(np.float64))
    again = tomofield.reconstruct(flipped, list(series.tilt_deg), **quick).tomogram
    np.testing.assert_array_equal(usual, again)


def test_the_callback_stops_it_and_resume_goes_on(series, quick, tmp_path):
    whole = tomofield.reconstruct(series.views, series.tilt_deg, **quick).tomogram
    stopped = tomofield.reconstruct(series.views, series.tilt_deg, **quick,
                                    progress=lambda p: p.fraction_done < 0.5)
    assert not stopped.is_finished
    assert (stopped.tomogram, stopped.model, stopped.metrics) == (None, None, {})
    assert "stopped" in stopped._repr_html_()
    output = tmp_path / "t.mrc"
    assert not tomofield.reconstruct(series.views, series.tilt_deg, **quick, output=output,
                                     progress=lambda p: False).is_finished
    assert not output.exists()
    resumed = tomofield.reconstruct(series.views, series.tilt_deg, **quick, output=output,
                                    resume=True)
    np.testing.assert_array_equal(resumed.model.sample(resumed.model.region()), whole)


def test_an_exception_of_the_callback_comes_back(series, quick):
    def fail(progress):
        raise ZeroDivisionError("of the callback")
    with pytest.raises(ZeroDivisionError, match="of the callback"):
        tomofield.reconstruct(series.views, series.tilt_deg, **quick, progress=fail)


def test_an_exception_of_the_callback_leaves_a_checkpoint(series, quick, tmp_path):
    def fail(progress):
        if progress.fraction_done > 0.3:
            raise ZeroDivisionError("of the callback")
    output = tmp_path / "t.mrc"
    with pytest.raises(ZeroDivisionError, match="of the callback"):
        tomofield.reconstruct(series.views, series.tilt_deg, **quick, progress=fail, output=output)
    assert (tmp_path / "t.h5").exists() and not output.exists()
    first = []
    made = tomofield.reconstruct(series.views, series.tilt_deg, **quick, output=output, resume=True,
                                 progress=first.append)
    assert made.is_finished and first[0].fraction_done > 0.3


def test_ctrl_c_stops_it_and_leaves_a_checkpoint(series, quick, tmp_path):
    steps = []

    def interrupt(progress):
        steps.append(progress)
        if len(steps) == 3:
            _thread.interrupt_main()
    with pytest.raises(KeyboardInterrupt):
        tomofield.reconstruct(series.views, series.tilt_deg, **{**quick, "epochs": 50},
                              progress=interrupt, output=tmp_path / "t.mrc")
    assert len(steps) == 3
    assert (tmp_path / "t.h5").exists() and not (tmp_path / "t.mrc").exists()


def test_ctrl_c_is_obeyed_while_something_is_logged(series, quick):
    """A handler of signals may raise inside the logger, whose other errors are ignored."""
    class Interrupting(logging.Handler):
        def emit(self, record):
            _thread.interrupt_main()
            time.sleep(0)  # the handler of the signal runs between two instructions of Python
    handler, logger, steps = Interrupting(), logging.getLogger("tomofield"), []
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel("INFO")
    try:
        with pytest.raises(KeyboardInterrupt):
            tomofield.reconstruct(series.views, series.tilt_deg, **{**quick, "epochs": 50},
                                  progress=steps.append)
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)
    assert len(steps) < 3


def test_ctrl_c_is_obeyed_while_another_thread_reconstructs(series, quick):
    has_begun, is_over = threading.Event(), threading.Event()

    def other():
        tomofield.reconstruct(series.views, series.tilt_deg, **{**quick, "epochs": 5000},
                              progress=lambda p: has_begun.set() or not is_over.is_set())
    thread = threading.Thread(target=other)
    thread.start()
    has_begun.wait()
    timer = threading.Timer(0.5, _thread.interrupt_main)
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            tomofield.reconstruct(series.views, series.tilt_deg, **quick)
        assert thread.is_alive()
    finally:
        is_over.set()
        thread.join()
        timer.join()


def test_ctrl_c_is_obeyed_while_an_array_is_converted(tmp_path):
    values = np.random.default_rng(1).random((300, 300, 300))
    for delay_s in (0.005, 0.01, 0.02):
        timer = threading.Timer(delay_s, _thread.interrupt_main)
        is_finished = False
        with pytest.raises(KeyboardInterrupt):
            timer.start()
            tomofield.write_mrc(tmp_path / "t.mrc", values, 1.0, overwrite=True)
            is_finished = True
            time.sleep(10)
        assert not is_finished, delay_s
        timer.join()


def test_a_folder_that_changes_meanwhile_moves_no_output(series, quick, tmp_path, monkeypatch):
    for name in ("begun", "other"):
        (tmp_path / name).mkdir()
    (tmp_path / "other" / "t.mrc").write_text("precious", encoding="utf-8")
    monkeypatch.chdir(tmp_path / "begun")
    tomofield.reconstruct(series.views, series.tilt_deg, **quick, output="t.mrc",
                          progress=lambda p: os.chdir(tmp_path / "other"))
    assert (tmp_path / "begun" / "t.mrc").exists()
    assert [path.name for path in (tmp_path / "other").iterdir()] == ["t.mrc"]
    assert (tmp_path / "other" / "t.mrc").read_text(encoding="utf-8") == "precious"


def test_a_null_character_does_not_end_a_sentence(series, quick):
    with pytest.raises(tomofield.Error, match=r"x00b'.*(dB|MB)"):
        tomofield.reconstruct(series.views, series.tilt_deg, **{**quick, "budget": "a\0b"})


def test_any_answer_of_a_callback_counts_as_true_or_false(series, quick):
    for answer, is_finished in (([], False), ([1], True), ("", False), (0, False), (None, True)):
        made = tomofield.reconstruct(series.views, series.tilt_deg, **quick, progress=lambda p: answer)
        assert made.is_finished == is_finished, answer
    with pytest.raises(ValueError, match="ambiguous"):
        tomofield.reconstruct(series.views, series.tilt_deg, **quick,
                              progress=lambda p: np.array([1, 2]))


def test_halves_are_files(series, quick, tmp_path):
    with pytest.raises(tomofield.Error, match="halves are written as files"):
        tomofield.reconstruct(series.views, series.tilt_deg, **quick, split_tilts=True)
    made = tomofield.reconstruct(series.views, series.tilt_deg, **quick, split_tilts=True,
                                 output=tmp_path / "t.mrc")
    assert made.is_finished and made.model is None and made.tomogram is None
    assert made.metrics["halves"]["of"] == "tilts"
    even = tomofield.Model(tmp_path / "t_EVN.h5")
    assert even.sample(even.region()).shape == series.tomogram.shape
    stack, even, odd = series.folder / "s.mrc", tmp_path / "even.mrc", tmp_path / "odd.mrc"
    noise = np.random.default_rng(1).normal(0, 0.02 * series.views.std(), series.views.shape).astype(np.float32)
    for half, sign in ((even, 1), (odd, -1)):
        tomofield.write_mrc(half, series.views + sign * noise, 10)
    again = tomofield.reconstruct(stack, tlt=series.folder / "s.tlt", even=even, odd=odd,
                                  **quick, output=tmp_path / "f.mrc")
    assert again.metrics["halves"]["of"] == "frames"
    halves = [tomofield.read_mrc(tmp_path / f"f_{name}_Vol.mrc").values for name in ("EVN", "ODD")]
    assert np.corrcoef(*map(np.ravel, halves))[0, 1] > 0.9
    with pytest.raises(tomofield.Error, match="are equal"):
        odd.write_bytes(even.read_bytes())
        tomofield.reconstruct(stack, tlt=series.folder / "s.tlt", even=even, odd=odd, **quick,
                              output=tmp_path / "f.mrc", overwrite=True)


def test_messages_go_to_the_logger(series, quick, caplog):
    views = series.views.copy()
    views[2, 5, 7] = np.nan
    with caplog.at_level("INFO", logger="tomofield"):
        tomofield.reconstruct(views, series.tilt_deg, **quick)
    levels = {record.levelname: record.getMessage() for record in caplog.records}
    assert "1 NaN" in levels["WARNING"] and "section 3" in levels["WARNING"]
    assert "INFO" in levels


def test_other_threads_run_meanwhile(series, quick):
    """They wait for the step in which the callback runs: with the interpreter locked, for ever."""
    has_begun, has_run = threading.Event(), threading.Event()

    def other():
        has_begun.wait()
        has_run.set()
    thread = threading.Thread(target=other)
    thread.start()
    tomofield.reconstruct(series.views, series.tilt_deg, **{**quick, "epochs": 200},
                          progress=lambda p: has_begun.set() or not has_run.is_set())
    assert has_run.is_set()
    thread.join()


def test_it_runs_in_any_thread(series, quick):
    here = tomofield.reconstruct(series.views, series.tilt_deg, **quick).tomogram
    made = []
    threads = [threading.Thread(target=lambda: made.append(
        tomofield.reconstruct(series.views, series.tilt_deg, **quick).tomogram)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) == 2
    for there in made:
        np.testing.assert_array_equal(here, there)


def test_bad_input_is_refused_in_a_sentence(series, quick):
    views, tilts = series.views, series.tilt_deg
    with pytest.raises(tomofield.Error, match="absent.mrc"):
        tomofield.reconstruct("absent.mrc", **quick)
    with pytest.raises(tomofield.Error, match="images of 32 × 32 pixels"):
        tomofield.reconstruct(views, tilts[:-1], **quick)
    for wrong in (series.views + 1j, series.views.astype(str), series.views.astype("M8[s]")):
        with pytest.raises(tomofield.Error, match="real numbers"):
            tomofield.reconstruct(wrong, series.tilt_deg, **quick)
    for tilt in (np.nan, np.inf):
        with pytest.raises(tomofield.Error, match="tilt angles of views in memory': the tilt angle "
                                                  "of section 1 is not a finite number"):
            tomofield.reconstruct(series.views, [tilt, *list(series.tilt_deg)[1:]], **quick)
    with pytest.raises(tomofield.Error, match="tilt angle 85° of section 1 is beyond"):
        tomofield.reconstruct(series.views, [85, *list(series.tilt_deg)[1:]], **quick)
    with pytest.raises(tomofield.Error, match="2 dimensions"):
        tomofield.reconstruct(views[0], tilts, **quick)
    with pytest.raises(tomofield.Error, match="tilt_deg"):
        tomofield.reconstruct(views, **quick)
    with pytest.raises(tomofield.Error, match="need pixel_size_A"):
        tomofield.reconstruct(views, tilts, **{**quick, "pixel_size_A": None})
    with pytest.raises(tomofield.Error, match="series names one"):
        tomofield.reconstruct(views, tilts, **quick, series="TS_01")
    with pytest.raises(tomofield.Error, match="xf"):
        tomofield.reconstruct(views, tilts, xf="a.xf", **quick)
    with pytest.raises(tomofield.Error, match="thickness"):
        tomofield.reconstruct(views, tilts, **{**quick, "thickness": -3})
    with pytest.raises(tomofield.Error, match="contrast is one of 'dark', 'bright', not 'grey'"):
        tomofield.reconstruct(views, tilts, **{**quick, "contrast": "grey"})
    with pytest.raises(TypeError, match="rank cannot be 'many'"):
        tomofield.reconstruct(views, tilts, **{**quick, "rank": "many"})
    with pytest.raises(TypeError, match="with_margin cannot be None"):
        tomofield.reconstruct(views, tilts, **{**quick, "with_margin": None})
    with pytest.raises(tomofield.Error, match="--resume .* --overwrite"):
        tomofield.reconstruct(views, tilts, **quick, resume=True, overwrite=True, output="x.mrc")
    with pytest.raises(TypeError, match="no option 'ranks'"):
        tomofield.reconstruct(views, tilts, **quick, ranks=3)
    with pytest.raises(tomofield.Error, match="cannot read 'absent.json'"):
        tomofield.read_metrics("absent.mrc")


def test_every_option_of_the_library_is_a_typed_keyword():
    core = {name for name in dir(tomofield._core.Choices) if not name.startswith("_")}
    assert core - {"stack", "copy", "settings"} == set(tomofield.Options.__annotations__)


def test_every_row_of_the_option_table_is_a_keyword():
    page = pathlib.Path(__file__).parents[2] / "docs" / "options.md"
    names = set(re.findall(r"\| `(\w+)` \| `[a-z_.]+[\w.]*` \|$", page.read_text(), re.MULTILINE))
    assert len(names) > 50
    keywords = set(tomofield.Options.__annotations__) | set(
        inspect.signature(tomofield.reconstruct).parameters)
    assert names - keywords == {"stack"}  # the first argument, with arrays as well


def test_options_keep_what_they_are_set_to():
    values = {"contrast": "bright", "penalty": "smooth", "roi": (1, 2, 3, 4), "leaf_size": 64,
              "voxel_type": "int16", "seed": 2**63 + 1, "take_log": True, "exclude": "1-3"}
    core = tomofield._projects.chosen(tomofield._core.Choices(), values)
    for name, value in values.items():
        found = getattr(core, name)
        assert (tuple(found) if name == "roi" else found) == value
    core.penalty = core.roi = core.leaf_size = None
    assert core.penalty is None and core.roi is None and core.leaf_size is None


@pytest.mark.parametrize("place", ("progress", "filter"))
@pytest.mark.parametrize("body", ("lock.acquire()", "while True: pass", "time.sleep(6)"))
def test_the_interpreter_ends_beside_code_of_the_user(place, body):
    """It runs in a daemon thread, and the end does not wait for it longer than for some seconds."""
    script = f"""
import builtins, logging, threading, time
import numpy as np
import tomofield
views = np.random.default_rng(1).normal(100, 10, (21, 32, 32)).astype(np.float32)
lock = threading.Lock()
lock.acquire()
begun = threading.Event()
def stay(*given):
    begun.set()
    {body}
    return True
progress = None
if {place!r} == "filter":
    logging.getLogger("tomofield").setLevel(logging.INFO)
    logging.getLogger("tomofield").addFilter(stay)
else:
    progress = stay
threading.Thread(target=lambda: tomofield.reconstruct(
    views, np.linspace(-60, 60, 21), thickness=16, pixel_size_A=10, contrast="bright",
    density_variation=1.0, prior="tv", progress=progress), daemon=True).start()
begun.wait()

class Last:  # lets other threads run while the interpreter ends
    def __del__(self, sleep=time.sleep):
        sleep(2)

builtins.last = Last()
"""
    module = os.path.dirname(os.path.dirname(tomofield.__file__))
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True,
                           env={**os.environ, "PYTHONPATH": module}, timeout=60, check=False)
    assert ended.returncode == 0, (ended.returncode, ended.stderr)


@pytest.mark.parametrize("work", [
    "tomofield.reconstruct(views, tilts, epochs=1000, thickness=16, contrast='bright', "
    "pixel_size_A=10, density_variation=1.0, prior='tv')",
    "[tomofield.score_volume(views, views) for _ in iter(int, 1)]",
    "exec('try: [tomofield.score_volume(views, views) for _ in iter(int, 1)]\\nfinally: print(5, flush=True)')",
    "exec('try: tomofield.reconstruct(views, tilts, epochs=1000, thickness=16, pixel_size_A=10, "
    "density_variation=1.0, prior=\\'tv\\')\\nfinally: print(5, flush=True)')",
    "[tomofield.score_volume(wide, wide) for _ in iter(int, 1)]",  # most of it converts the arrays
    "model.sample(tomofield.Box((16, 16, 8), (700, 700, 700), euler_deg=(10, 20, 30)))"])
def test_the_interpreter_ends_in_order_beside_a_daemon_thread(series, work):
    script = f"""
import builtins, threading, time
import numpy as np
import tomofield
views = np.random.default_rng(1).normal(100, 10, (21, 32, 32)).astype(np.float32)
tilts = np.linspace(-60, 60, 21)
wide = np.broadcast_to(np.linspace(0, 1, 400, dtype=np.longdouble), (300, 400, 400))
model = tomofield.Model({str(series.folder / "tomogram.h5")!r})
begun = threading.Event()
def work():
    begun.set()
    {work}
threading.Thread(target=work, daemon=True).start()
begun.wait()
time.sleep(1)

class Last:  # lets other threads run while the interpreter ends
    def __del__(self, sleep=time.sleep):
        sleep(1)

builtins.last = Last()
"""
    module = os.path.dirname(os.path.dirname(tomofield.__file__))
    for _ in range(3):
        ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True,
                               env={**os.environ, "PYTHONPATH": module, "PYTHONUNBUFFERED": ""}, timeout=60, check=False)
        assert ended.returncode == 0 and not ended.stderr, (ended.returncode, ended.stderr)


@pytest.mark.parametrize("work, said", (
    ("pass", ""), ("tomofield.score_volume(views, views)", ""),
    ("tomofield.reconstruct(views, tilts, **options)", "forked while its parent was reconstructing"),
    ("tomofield.baseline(views, 'wbp', tilts, pixel_size_A=10, thickness=16)", "('spawn')")))
def test_a_process_that_is_forked_beside_a_reconstruction_ends(work, said):
    """It has none of its parent's threads, for which it would wait in vain."""
    script = f"""
import os, sys, threading, time
import numpy as np
import tomofield
views = np.random.default_rng(1).normal(100, 10, (21, 32, 32)).astype(np.float32)
tilts = np.linspace(-60, 60, 21)
options = dict(epochs=10000, thickness=16, contrast="bright", pixel_size_A=10,
               density_variation=1.0, prior="tv")
begun = threading.Event()
threading.Thread(target=lambda: tomofield.reconstruct(
    views, tilts, progress=lambda progress: begun.set(), **options), daemon=True).start()
begun.wait()
child = os.fork()
if child == 0:
    try:
        {work}
    except tomofield.Error as error:
        print(error, flush=True)
    sys.exit(5)
for _ in range(3000):
    ended, status = os.waitpid(child, os.WNOHANG)
    if ended:
        print("status", os.waitstatus_to_exitcode(status))
        break
    time.sleep(0.02)
else:
    os.kill(child, 9)
"""
    module = os.path.dirname(os.path.dirname(tomofield.__file__))
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True,
                           env={**os.environ, "PYTHONPATH": module}, timeout=60, check=False)
    assert ended.stdout.endswith("status 5\n"), (ended.stdout, ended.stderr)
    assert said in ended.stdout and (said or ended.stdout == "status 5\n"), ended.stdout


def test_processes_that_are_forked_beside_a_reconstruction_sample(tmp_path):
    """Its threads hold locks for moments at which some of these processes begin."""
    script = f"""
import os, sys, threading, time
import numpy as np
import tomofield
views = np.random.default_rng(1).normal(100, 10, (21, 32, 32)).astype(np.float32)
options = dict(thickness=16, contrast="bright", pixel_size_A=10, density_variation=1.0, prior="tv",
               coarse_epochs=0, fit_view_scale=False, black_level=0.0, bead_diameter_nm=0.0,
               spike_rank=0)
model = tomofield.reconstruct(views, np.linspace(-60, 60, 21), epochs=1, **options).model
def reconstruct():
    while True:
        tomofield.reconstruct(views, np.linspace(-60, 60, 21), epochs=2, **options)
threading.Thread(target=reconstruct, daemon=True).start()
for number in range(60):
    child = os.fork()
    if child == 0:
        model.sample(tomofield.Box((16, 16, 8), (8, 8, 8)))
        os._exit(5)
    for _ in range(1000):
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            break
        time.sleep(0.01)
    if not ended or os.waitstatus_to_exitcode(status) != 5:
        print(f"process {{number}} hangs or failed", flush=True)
        os.kill(child, 9)
        os._exit(1)
os._exit(0)
"""
    module = os.path.dirname(os.path.dirname(tomofield.__file__))
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=tmp_path,
                           env={**os.environ, "PYTHONPATH": module}, timeout=300, check=False)
    assert ended.returncode == 0, (ended.stdout, ended.stderr)


def test_a_process_that_is_forked_after_a_reconstruction_reconstructs(series, quick):
    tomofield.reconstruct(series.views, series.tilt_deg, **quick)
    child = multiprocessing.get_context("fork").Process(
        target=tomofield.reconstruct, args=(series.views, series.tilt_deg), kwargs=quick)
    child.start()
    child.join(60)
    assert child.exitcode == 0
