"""Tests compare: the runs that it makes, how it goes on, and the report that it writes."""

import csv
import html
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import time

import numpy as np
import pytest
import skimage.io

import harness

QUICK = ["--thickness", harness.THICKNESS, "--contrast", "bright", "--no-margin"]
OURS = ("ours=reconstruct --leaf-size 16 --rank 4 --epochs {} --subsets 7 --tv-penalty concave")


@pytest.fixture(scope="module")
def series():
    """Returns a small simulated series."""
    return harness.Series("series")


@pytest.fixture(scope="module")
def truth(series):
    """Returns the path of the series' truth."""
    path = os.path.join(series.directory, "truth.mrc")
    harness.write_stack(path, series.truth.astype("f4"))
    return path


@pytest.fixture(scope="module", name="compare")
def make_compare(series, truth):
    def compare(folder, *options, epochs=4, run=harness.succeed):
        return run("compare", *series.input, *QUICK, "-o", folder, "--methods", "sirt",
                   "--also", OURS.format(epochs), "--truth", truth, *options)

    return compare


def read(folder, name):
    with open(os.path.join(folder, name), encoding="utf-8") as file:
        return file.read()


def test_every_method_is_run_scored_and_shown(compare, truth):
    folder = harness.fresh_directory("all")
    compare(folder, "--center", "24,12")
    rows = json.loads(read(folder, "comparison.json"))["methods"]
    assert [row["method"] for row in rows] == ["sirt", "ours"]
    for row in rows:
        assert row["core_seconds"] > 0 and row["peak_MiB"] > 5, row
        scores = os.path.join(folder, "scores.json")
        harness.succeed("evaluate", row["volume"], truth, "--json", scores, "--overwrite")
        with open(scores) as file:
            assert json.load(file)["psnr_raw_dB"] == row["psnr_dB"], row
        again = os.path.join(folder, "by_hand.mrc")
        harness.succeed(*row["command"], "-o", again, "--overwrite")
        assert harness.read_bytes(again) == harness.read_bytes(row["volume"]), row["command"]
    table = list(csv.DictReader(read(folder, "comparison.csv").splitlines()))
    assert [float(entry["psnr_dB"]) for entry in table] == [row["psnr_dB"] for row in rows]
    page = read(folder, "report.html")
    assert page.count("data:image/png") == 3 * (3 + 1), "planes and details of truth and methods"
    assert not re.search(r'(src|href)="(?!data:)', page), "the page asks for another file"
    profile = page[page.index("<h2>Profile</h2>"):page.index("<h2>Shell correlation")]
    names = re.findall(r'<text x="708.0"[^>]*>([^<]*)<', profile)
    assert names == ["SIRT", "ours", "truth"], names
    better = rows[1]["psnr_dB"] > rows[0]["psnr_dB"]
    cell = re.search(r'class="([^"]*)">%.2f<' % rows[1]["psnr_dB"], page).group(1)
    assert ("better" in cell) == better and ("best" in cell) == better, cell
    shades = [skimage.io.imread(os.path.join(folder, "pictures", name + "_xy.png")).mean()
              for name in ("truth", "ours")]
    assert abs(shades[0] - shades[1]) < 40, shades


def test_regions_and_a_profile_can_be_given(series):
    folder = harness.fresh_directory("places")
    line, boxes = "4.5,20.5,8.5,27.5,20.5,8.5", ("2,2,2,8,8,8", "12,12,4,20,20,10")
    arguments = ("compare", *series.input, *QUICK, "--methods", "wbp,sirt", "-o", folder)
    harness.succeed(*arguments, "--foreground", boxes[0], "--background", boxes[1], "--profile", line)
    for row in json.loads(read(folder, "comparison.json"))["methods"]:
        scores, table = (os.path.join(folder, name) for name in ("scores.json", "by_hand.csv"))
        harness.succeed("evaluate", row["volume"], "--cnr", "--foreground", boxes[0], "--background",
                        boxes[1], "--profile", line, "--profile-csv", table, "--json", scores,
                        "--overwrite")
        with open(scores) as file:
            assert json.load(file)["contrast"]["cnr"] == pytest.approx(row["cnr"])
        profile = list(csv.DictReader(read(folder, "profile.csv").splitlines()))
        by_hand = list(csv.DictReader(read(folder, "by_hand.csv").splitlines()))
        assert [p[row["method"]] for p in profile] == [p["volume"] for p in by_hand]
        assert len(profile) == 24
    assert "as given" in read(folder, "report.html")
    for wrong, says in ((("--profile", "0,0,0,900,0,0"), "outside"),
                        (("--foreground", "0,0,0,900,9,9", "--background", boxes[1]), "--foreground")):
        result = harness.tomofield(*arguments, "--overwrite", *wrong)
        assert result.returncode == 2 and says in result.stderr, result.stderr
    assert os.path.exists(os.path.join(folder, "wbp.mrc")), "nothing was removed"


def test_regions_are_chosen_on_sirt(series):
    folder = harness.fresh_directory("chosen")
    harness.succeed("compare", *series.input, *QUICK, "--methods", "wbp,sirt", "-o", folder)
    scores = os.path.join(folder, "scores.json")
    harness.succeed("evaluate", os.path.join(folder, "sirt.mrc"), "--cnr", "--json", scores)
    rows = json.loads(read(folder, "comparison.json"))["methods"]
    with open(scores) as file:
        assert json.load(file)["contrast"]["cnr"] == pytest.approx(rows[1]["cnr"])
    assert "chosen on the volume of SIRT" in read(folder, "report.html")


def test_halves_and_held_out_views_give_metrics_without_a_truth(compare):
    folder = harness.fresh_directory("halves")
    compare(folder, "--halves", "--hold-out", 4, "--exclude", "3")
    rows = json.loads(read(folder, "comparison.json"))["methods"]
    assert [row["method"] for row in rows] == ["sirt", "ours"]
    for row in rows:
        assert row["cnr"] > 0 and row["enl"] > 0, row
        assert row["fsc_halves_0.143_A"] > 1.9 * harness.PIXEL_SIZE, row
        by_hand = os.path.join(folder, "by_hand")
        harness.succeed(*row["command"], "-o", by_hand + ".mrc", "--overwrite", "--hold-out", 4)
        with open(by_hand + ".json") as file:
            assert json.load(file)["metrics"]["held_out"]["error"] == row["held_out_error"], row
        views = {}
        for half in ("odd", "even"):
            with open(os.path.join(folder, f"{row['method']}.{half}.json")) as file:
                record = json.load(file)
            views[half] = {view["tilt_deg"] for view in record["metrics"]["views"]}
        assert not views["odd"] & views["even"] and len(views["odd"] | views["even"]) == 20
    assert "Shell correlation of odd and even views" in read(folder, "report.html")


def test_every_method_that_can_be_is_tuned(series):
    folder = harness.fresh_directory("tuned")
    harness.succeed("compare", *series.input, *QUICK, "-o", folder, "--tune", "--methods", "wbp",
                    "--also", "s=baseline sirt --iterations 5", "--also",
                    "t=baseline tv --iterations 20 --weight 90", "--view-scale", "on", "--hold-out", 4)
    tunings = {}
    for name in ("wbp", "s", "t"):
        with open(os.path.join(folder, name + ".json")) as file:
            record = json.load(file)
        assert record["options"]["fit_view_scale"] is True
        tunings[name] = record["metrics"]["tuning"]
    assert tunings["wbp"]["chosen"]["cutoff"] <= 0.5 and tunings["s"]["chosen"]["iterations"] > 5
    assert tunings["t"]["chosen"]["weight"] < 90
    rows = {row["method"]: row for row in json.loads(read(folder, "comparison.json"))["methods"]}
    for name in ("wbp", "s", "t"):
        with open(os.path.join(folder, name + ".held_out.json")) as file:
            record = json.load(file)
        held_out, tuning = record["metrics"]["held_out"], record["metrics"]["tuning"]
        assert record["options"]["method"] == tuning["chosen"], "the runs that score are not tuned"
        assert rows[name]["held_out_error"] == held_out["error"]
        scored = {view["view"] for view in held_out["views"]}
        assert scored and not scored & set(tuning["predicted_views"])
    assert tuning["chosen"]["weight"] < 90
    assert "tuned again" in read(folder, "report.html")


def wait_for_line(run, start):
    for line in run.stderr:
        if line.startswith(start):
            return
    raise AssertionError(run.communicate())


def wait_until(is_so):
    deadline = time.monotonic() + 120
    while not is_so():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def stop(run):
    run.send_signal(signal.SIGTERM)
    _, errors = run.communicate()
    assert run.returncode == 143, errors
    return errors


def row_of(folder, name):
    return json.loads(read(folder, name + ".row.json"))


def remove(folder, *names):
    for name in names:
        os.remove(os.path.join(folder, name))


def test_it_goes_on_where_it_stopped(series):
    folder = harness.fresh_directory("resumed")
    often = ["--also", OURS.format(4000) + " --checkpoint-minutes 0"]
    command = ["compare", *series.input, *QUICK, "-o", folder, "--methods", "sirt", *often]
    run = harness.start(*command)
    wait_until(lambda: os.path.exists(os.path.join(folder, "ours.h5")))
    errors = stop(run)
    assert folder in errors and "--overwrite" not in errors, errors
    assert not os.path.exists(os.path.join(folder, "report.html"))
    first = harness.read_bytes(os.path.join(folder, "sirt.row.json"))
    stopped = row_of(folder, "ours")
    assert stopped["progress"] == "stopped" and stopped["core_seconds"] > 0, stopped
    run = harness.start(*command)
    wait_for_line(run, "ours: running")
    wait_until(lambda: "resuming" in read(folder, "ours.log"))
    assert "killed" not in stop(run)
    assert harness.read_bytes(os.path.join(folder, "sirt.row.json")) == first
    later = row_of(folder, "ours")
    for cost in ("core_seconds", "wall_seconds"):
        assert later[cost] > stopped[cost] + 0.01, (stopped, later)


def test_what_a_run_has_cost_stays_with_it(compare):
    folder = harness.fresh_directory("costs")
    compare(folder)
    rows = {name: row_of(folder, name) for name in ("sirt", "ours")}
    remove(folder, "ours.mrc", "sirt.mrc", "sirt.json")
    said = compare(folder).stderr
    assert "sirt: running" in said and "ours: running" in said, said
    assert "resuming" in read(folder, "ours.log")
    assert row_of(folder, "ours") == rows["ours"], "the fit was not made again"
    assert row_of(folder, "sirt")["wall_seconds"] != rows["sirt"]["wall_seconds"]
    table = {row["method"]: row for row in json.loads(read(folder, "comparison.json"))["methods"]}
    assert table["ours"]["core_seconds"] == rows["ours"]["core_seconds"]

    killed = dict(rows["ours"], progress="running")
    with open(os.path.join(folder, "ours.row.json"), "w") as file:
        json.dump(killed, file)
    assert "ours goes on from a run that was killed" in compare(folder).stderr
    both = row_of(folder, "ours")
    assert both["core_seconds"] > killed["core_seconds"] and both["progress"] == "finished"


def test_a_stopped_tuning_keeps_its_trials(compare):
    folder = harness.fresh_directory("stopped_tuning")
    trials = os.path.join(folder, "ours_tune.json")
    run = compare(folder, "--tune", epochs=60, run=harness.start)
    wait_until(lambda: os.path.exists(trials))
    stop(run)
    assert not os.path.exists(os.path.join(folder, "ours.h5"))
    before, costs = harness.read_bytes(trials), row_of(folder, "ours")
    run = compare(folder, "--tune", epochs=60, run=harness.start)
    wait_until(lambda: harness.read_bytes(trials) != before)
    stop(run)
    assert len(json.loads(harness.read_bytes(trials))["trials"]) > len(json.loads(before)["trials"])
    assert row_of(folder, "ours")["core_seconds"] > costs["core_seconds"] > 0


def test_overwrite_leaves_nothing_old(compare):
    folder = harness.fresh_directory("overwritten")
    compare(folder)
    run = compare(folder, "--overwrite", run=harness.start)
    wait_for_line(run, "sirt: running")
    assert "without --overwrite" in stop(run)
    old = {"report.html", "comparison.json", "comparison.csv", "ours.mrc", "ours.h5"}
    assert not old & set(os.listdir(folder)), os.listdir(folder)
    said = compare(folder).stderr
    assert "sirt: running" in said and "ours: running" in said, said


def test_overwrite_names_the_runs_that_it_leaves(series):
    folder = harness.fresh_directory("fewer")
    command = ["compare", series.stack, "--tlt", series.tlt, *QUICK, "-o", folder, "--methods"]
    harness.succeed(*command, "wbp,sirt", "--hold-out", 4)
    said = harness.succeed(*command, "wbp", "--overwrite").stderr
    assert "also has what an older comparison made: sirt, sirt.held_out, wbp.held_out." in said, said
    assert os.path.exists(os.path.join(folder, "sirt.mrc"))


def test_what_a_row_was_made_from_is_watched(series):
    folder, files = harness.fresh_directory("changed"), harness.fresh_directory("changed_files")
    tlt, config = os.path.join(files, "copy.tlt"), os.path.join(files, "sirt.toml")
    shutil.copyfile(series.tlt, tlt)
    with open(config, "w") as file:
        file.write("iterations = 3\n")
    command = ["compare", series.stack, "--tlt", tlt, *QUICK, "-o", folder, "--methods", "wbp",
               "--also", "few=baseline sirt --config " + config]
    harness.succeed(*command)
    before = {name: row_of(folder, name) for name in ("wbp", "few")}

    def refused(*facts, command=command):
        result = harness.tomofield(*command)
        assert result.returncode == 2, result.stderr
        for fact in (*facts, "--overwrite"):
            assert fact in result.stderr, (fact, result.stderr)

    for path, name in ((tlt, "wbp.row.json"), (config, "few.row.json")):
        times = os.stat(path)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns + 1000))
        refused(f"'{path}' has changed since", name)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    refused("--hand", "-1", command=[*command, "--hand=-1"])
    row = json.loads(json.dumps(before["few"]))
    row["origin"]["tomofield"] = "0.0.1"
    with open(os.path.join(folder, "few.row.json"), "w") as file:
        json.dump(row, file)
    refused("0.0.1", "few.row.json")
    huge = dict(before["few"], peak_bytes=1e300)
    del row["origin"], row["wall_seconds"]
    for text in (json.dumps(row), json.dumps(huge), "{", "[]"):
        with open(os.path.join(folder, "few.row.json"), "w") as file:
            file.write(text)
        refused("few.row.json")
    os.remove(os.path.join(folder, "few.row.json"))
    os.mkfifo(os.path.join(folder, "few.row.json"))
    refused("few.row.json", "not a regular file")
    os.remove(os.path.join(folder, "few.row.json"))
    assert row_of(folder, "wbp") == before["wbp"]
    assert os.path.exists(os.path.join(folder, "few.mrc"))


def test_a_run_that_fails_is_named_and_its_costs_are_kept(compare):
    folder = harness.fresh_directory("failing")
    run = compare(folder, epochs=20000, run=harness.start)
    wait_until(lambda: os.path.exists(os.path.join(folder, "ours.log")))
    with open(f"/proc/{run.pid}/task/{run.pid}/children", encoding="ascii") as file:
        os.kill(int(file.read()), signal.SIGKILL)
    _, errors = run.communicate()
    assert run.returncode == 2, errors
    assert "ours failed with status 137" in errors and "ours.log" in errors, errors
    assert row_of(folder, "ours")["progress"] == "stopped"
    assert row_of(folder, "sirt")["progress"] == "finished", "what is finished stays"


@pytest.fixture(scope="module", name="refuse")
def make_refuse(series, truth):
    def refuse(folder, facts, *options):
        """Checks that a mistake is found before anything is made."""
        words = harness.merge(["--methods", "sirt", "--truth", truth], options)
        result = harness.tomofield("compare", *series.input, *QUICK, "-o", folder, *words)
        assert result.returncode == 2, (options, result.stderr)
        for fact in facts:
            assert fact in result.stderr, (fact, options, result.stderr)
        assert not os.listdir(os.path.dirname(folder)), (options, os.listdir(os.path.dirname(folder)))

    return refuse


def test_mistakes_are_named_before_anything_is_made(compare, refuse, series):
    parent = harness.fresh_directory("mistakes")
    folder = os.path.join(parent, "new", "folder")
    os.makedirs(os.path.dirname(folder))
    for options, fact in ((["--methods", "magic"], "'magic'"), (["--also", "x"], "NAME=COMMAND"),
                          (["--also", "x=export y"], "'export'"),
                          (["--also", "sirt=baseline sirt"], "twice"),
                          (["--also", "truth=baseline sirt"], "'truth'"),
                          (["--also", "comparison=baseline sirt"], "'comparison'"),
                          (["--also", "sirt.even=baseline sirt"], "sirt.even"),
                          (["--truth", "nowhere.mrc"], "nowhere.mrc")):
        refuse(folder, [fact], *options)
    refuse(folder, ["bad: ", "--weight"], "--also", "bad=baseline tv --weight -1")
    refuse(folder, ["bad: ", "--magic"], "--also", "bad=reconstruct --magic")
    for option in ("--trace x.json", "--choice x.json", "--plan=x.json", "--dry-run"):
        refuse(folder, ["bad: ", "is not for a comparison"], "--also", f"bad=reconstruct {option}")
    refuse(folder, ["bad: ", "nowhere.toml"], "--also", "bad=reconstruct --config nowhere.toml")
    refuse(folder, ["part", "24 × 24 × 24", "sirt", "48 × 36 × 24"],
           "--also", "part=baseline sirt --roi 0,0,24,24")
    refuse(folder, ["turned", "48 × 24 × 36", "sirt", "48 × 36 × 24"],
           "--also", "turned=baseline sirt --axes xzy")
    other = os.path.join(series.directory, "other_truth.mrc")
    for values, voxel in ((series.truth, 2 * harness.PIXEL_SIZE),
                          (np.repeat(series.truth, 3, axis=1), harness.PIXEL_SIZE)):
        harness.write_stack(other, values.astype("f4"), voxel)
        refuse(folder, ["other_truth.mrc", "sirt", "48 × 36 × 24"], "--truth", other)
    file = os.path.join(parent, "file")
    open(file, "w").close()
    result = compare(os.path.join(file, "folder"), run=harness.tomofield)
    assert result.returncode == 2 and "cannot be made" in result.stderr, result.stderr


def test_own_options_may_have_several_values(series):
    folder = harness.fresh_directory("several_values")
    harness.succeed("compare", *series.input, *QUICK, "-o", folder, "--methods", "wbp", "--also",
                    "whole=baseline wbp --roi 0,0,48,36")
    assert harness.read_bytes(os.path.join(folder, "whole.mrc")) == harness.read_bytes(
        os.path.join(folder, "wbp.mrc"))


def test_a_series_that_is_called_like_an_option_is_compared(series):
    folder = harness.fresh_directory("dashes")
    shutil.copy(series.tlt, os.path.join(folder, "x.tlt"))
    for name in ("-x.mrc", "--overwrite"):
        shutil.copy(series.stack, os.path.join(folder, name))
        harness.succeed("compare", "--tlt", "x.tlt", *QUICK, "-o", f"of{name}", "--methods", "wbp",
                        "--", name, cwd=folder)


def test_no_volume_of_another_size_is_compared(compare):
    folder = harness.fresh_directory("sizes")
    compare(folder)
    report = read(folder, "report.html")
    harness.write_stack(os.path.join(folder, "ours.mrc"), np.zeros((24, 24, 24), "f4"))
    result = compare(folder, run=harness.tomofield)
    assert result.returncode == 2, result.stderr
    for fact in ("ours gives 24 × 24 × 24", "sirt gives 48 × 36 × 24"):
        assert fact in result.stderr, result.stderr
    assert read(folder, "report.html") == report


def test_chromium_shows_every_picture_without_errors(compare):
    if not shutil.which("chromium"):
        pytest.skip("there is no chromium")
    folder = harness.fresh_directory("shown")
    compare(folder)
    script = ("<script>onload = () => { document.title = [...document.images].filter("
              "i => i.complete && i.naturalWidth > 0).length + ' shown'; }</script></body>")
    page = os.path.join(folder, "checked.html")
    with open(page, "w", encoding="utf-8") as file:
        file.write(read(folder, "report.html").replace("</body>", script))
    without_sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []  # root cannot have one
    shown = subprocess.run(["chromium", "--headless", *without_sandbox, "--disable-gpu",
                            "--dump-dom", "--enable-logging=stderr", "--user-data-dir=" + folder + "/profile",
                            "file://" + page], capture_output=True, text=True, timeout=120)
    assert "<title>12 shown</title>" in shown.stdout, shown.stdout[:2000]
    assert "CONSOLE" not in shown.stderr, shown.stderr


def refused(folder, facts, *command):
    """Checks that a comparison stops with these facts before it writes anything."""
    before = harness.contents(folder)
    result = harness.tomofield("compare", *command, *QUICK, "-o", folder)
    assert result.returncode == 2, result
    for fact in facts:
        assert fact in result.stderr, (fact, result.stderr)
    assert harness.contents(folder) == before


def test_the_commands_of_the_report_are_words_of_a_shell(series):
    folder = harness.fresh_directory("commands")
    stack = os.path.join(folder, "a$(touch PWN) b.mrc")
    shutil.copy(series.input[0], stack)
    harness.succeed("compare", stack, *series.input[1:], "--methods", "wbp", *QUICK, "-o", os.path.join(folder, "c"))
    with open(os.path.join(folder, "c/report.html"), encoding="utf-8") as file:
        listing = re.search(r"<h2>Commands</h2>.*?<pre[^>]*>(.*?)</pre>", file.read(), re.DOTALL)[1]
    (line,) = html.unescape(re.sub("<[^>]*>", "", listing)).strip().splitlines()
    assert stack in shlex.split(line), line


def test_a_method_that_is_killed_is_said_to_be_killed(series):
    folder = harness.fresh_directory("killed_method")
    run = harness.start("compare", *series.input, "--methods", "wbp", "--also", OURS.format(4000), *QUICK, "-o", folder)
    log = os.path.join(folder, "ours.log")
    while not os.path.exists(log) or b"epoch" not in harness.read_bytes(log):
        time.sleep(0.05)
        assert run.poll() is None, run.communicate()
    subprocess.run(["pkill", "-KILL", "-P", str(run.pid)], check=True)
    said = run.communicate(timeout=60)[1]
    assert run.returncode != 0 and "it was killed" in said, said


def test_files_that_it_has_not_made_are_kept(series):
    folder = harness.fresh_directory("others")
    os.mkdir(os.path.join(folder, "pictures"))
    command = [*series.input, "--methods", "wbp,sirt", "--hold-out", 4]
    for name in ("wbp.mrc", "wbp.h5", "sirt.json", "sirt.log", "wbp_xy.png", "wbp_mask.png",
                 "sirt.held_out.mrc", "wbp.held_out.log", "report.html", "comparison.csv",
                 "pictures/wbp_detail.png"):
        path = os.path.join(folder, name)
        with open(path, "w") as file:
            file.write("years of work")
        refused(folder, [path, "--overwrite"], *command)
        os.remove(path)
    os.mkdir(os.path.join(folder, "wbp.log"))
    refused(folder, ["wbp.log"], *command, "--overwrite")
    os.rmdir(os.path.join(folder, "wbp.log"))
    harness.succeed("compare", *command, *QUICK, "-o", folder)
    os.remove(os.path.join(folder, "wbp.mrc"))
    harness.succeed("compare", *command, *QUICK, "-o", folder)
    # What a new method would write is not the comparison's either.
    with open(os.path.join(folder, "tv.log"), "w") as file:
        file.write("years of work")
    refused(folder, ["tv.log"], *series.input, "--methods", "wbp,sirt,tv", "--hold-out", 4)
    harness.succeed("compare", *command, *QUICK, "-o", folder, "--overwrite")


def test_its_inputs_are_never_replaced(series, truth):
    folder = harness.fresh_directory("own_inputs")

    def copy(source, name):
        return shutil.copyfile(source, os.path.join(folder, name))

    also = ["--methods", "wbp", "--also", "tilt=baseline wbp"]
    for name in ("tilt.log", "tilt.row.json", "wbp.json", "report.html", "tilt_mask.png"):
        angles = copy(series.tlt, name)
        for options in ([], ["--overwrite"]):
            refused(folder, ["input", angles], series.stack, "--tlt", angles, *also, *options)
        os.remove(angles)
    known = copy(truth, "wbp.mrc")
    refused(folder, ["input", known], *series.input, *also, "--truth", known, "--overwrite")
    os.remove(known)
    config = os.path.join(folder, "tilt.json")
    for text in ("iterations = 3\n", f"fiducials = \"{folder}/wbp.log\"\n"):
        with open(config, "w") as file:
            file.write(text)
        with open(os.path.join(folder, "wbp.log"), "w") as file:
            file.write("1 1 1\n")
        # The file of a method, one that it names, and the comparison's own.
        refused(folder, ["input", "wbp.log" if "fid" in text else config], *series.input,
                "--methods", "wbp" if "fid" in text else "sirt", "--also",
                ("other" if "fid" in text else "tilt") + "=baseline sirt --config " + config,
                "--overwrite")
    with open(config, "w") as file:
        file.write("hand = -1\n")
    refused(folder, ["input", config], *series.input, *also, "--config", config, "--overwrite")


def test_two_comparisons_do_not_share_a_folder(compare):
    folder = harness.fresh_directory("shared")
    run = compare(folder, epochs=20000, run=harness.start)
    wait_for_line(run, "ours: running")
    for options in ([], ["--overwrite"]):
        result = compare(folder, *options, run=harness.tomofield)
        assert result.returncode == 2, result
        assert f"process {run.pid} " in result.stderr and folder in result.stderr, result.stderr
    stop(run)
    assert not [name for name in os.listdir(folder) if name.startswith(".")], os.listdir(folder)


def is_alive(process):
    """Returns true for a process that runs; one that nobody has waited for yet has ended."""
    try:
        with open(f"/proc/{process}/stat", encoding="ascii") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_no_child_outlives_it(compare, number):
    folder = harness.fresh_directory("killed")
    run = compare(folder, epochs=20000, run=harness.start)
    wait_for_line(run, "ours: running")
    wait_until(lambda: os.path.exists(os.path.join(folder, "ours.log"))
               and re.search(r"epoch \d+/", read(folder, "ours.log")))  # no trial any more
    with open(f"/proc/{run.pid}/task/{run.pid}/children", encoding="ascii") as file:
        child = int(file.read())
    run.send_signal(number)
    run.communicate()
    wait_until(lambda: not is_alive(child))
    assert os.path.exists(os.path.join(folder, "ours.h5")), "the child saved its checkpoint"


def test_foreign_files_stay_whatever_a_method_writes(series, truth):
    """Runs write more files with some options, and remove pictures of earlier runs."""
    folder = harness.fresh_directory("foreign")
    quick = "q=reconstruct --epochs 1 --coarse-epochs 2 --prior tv --tv 5 "
    for name, options in (("q_denoise.png", ""), ("q_fsc.png", ""), ("q_EVN.h5", "--split-tilts"),
                          ("q_align.json", "--align refine"), ("q_alignment.json", "--alignment-json")):
        foreign = os.path.join(folder, name)
        with open(foreign, "w", encoding="utf-8") as file:
            file.write("mine")
        refused = harness.tomofield("compare", *series.input, *QUICK, "-o", folder, "--methods", "wbp", "--also",
                                    quick + options)
        assert refused.returncode == 2 and f"{name}' exists" in refused.stderr, refused.stderr
        assert read(folder, name) == "mine"
        os.remove(foreign)
    store = os.path.join(folder, "s.zarr")
    harness.succeed("baseline", "wbp", *series.input, *QUICK, "--zarr", "-o", os.path.join(folder, "s.mrc"))
    for name in os.listdir(folder):
        if name != "s.zarr":
            os.remove(os.path.join(folder, name))
    before = {name: os.stat(os.path.join(store, name)).st_mtime_ns for name in os.listdir(store)}
    refused = harness.tomofield("compare", *series.input, *QUICK, "-o", folder, "--methods", "wbp", "--also",
                                "s=baseline sirt --iterations 3 --zarr")
    assert refused.returncode == 2 and "s.zarr' exists" in refused.stderr, refused.stderr
    assert before == {name: os.stat(os.path.join(store, name)).st_mtime_ns for name in os.listdir(store)}
    shutil.rmtree(store)
    refused = harness.tomofield("compare", *series.input, *QUICK, "-o", folder, "--methods", "wbp", "--also",
                                "q_align=baseline wbp --cutoff 0.3", "--also", quick + "--align refine")
    assert refused.returncode == 2 and "two results would both be" in refused.stderr, refused.stderr
    half = shutil.copy(truth, os.path.join(folder, "q_EVN_Vol.mrc"))
    before = open(half, "rb").read()
    refused = harness.tomofield("compare", *series.input, *QUICK, "-o", folder, "--methods", "wbp", "--also",
                                quick + "--split-tilts", "--truth", half, "--overwrite")
    assert refused.returncode == 2 and "q_EVN_Vol.mrc" in refused.stderr, refused.stderr
    assert open(half, "rb").read() == before


def test_a_stopped_overwrite_goes_on_without_it(series):
    """Files of the older run that no run has replaced yet are the comparison's own."""
    folder = harness.fresh_directory("stopped_overwrite")
    command = ["compare", *series.input, *QUICK, "-o", folder, "--threads", 1, "--methods", "sirt", "--also",
               "q=reconstruct --epochs 1 --coarse-epochs 2 --prior tv --tv 5 --split-tilts"]
    harness.succeed(*command)
    assert os.path.exists(os.path.join(folder, "q_fsc.png"))
    program = harness.start(*command, "--overwrite")
    while program.poll() is None and os.path.exists(os.path.join(folder, "report.html")):
        time.sleep(0.01)
    program.send_signal(signal.SIGINT)
    program.communicate(timeout=120)
    if program.returncode != 0:  # it was not finished before the signal came
        harness.succeed(*command)
    assert os.path.exists(os.path.join(folder, "report.html"))
