"""compare: what it runs, how it goes on, and the report that it writes.

usage: compare_test.py TOMOFIELD SCRATCH_DIR"""

import csv
import json
import os
import re
import shutil
import signal
import subprocess

import skimage.io

import harness

series = harness.Series("series")
TRUTH = os.path.join(series.directory, "truth.mrc")
harness.write_stack(TRUTH, series.truth.astype("f4"))
QUICK = ["--thickness", harness.THICKNESS, "--contrast", "bright", "--no-margin"]
OURS = ("ours=reconstruct --leaf-size 16 --rank 4 --epochs {} --subsets 7 --tv-penalty concave")


def compare(folder, *options, epochs=4, run=harness.succeed):
    return run("compare", *series.input, *QUICK, "-o", folder, "--methods", "sirt",
               "--also", OURS.format(epochs), "--truth", TRUTH, *options)


def read(folder, name):
    with open(os.path.join(folder, name), encoding="utf-8") as file:
        return file.read()


def test_every_method_is_run_scored_and_shown():
    folder = harness.fresh_directory("all")
    compare(folder, "--center", "24,12")
    rows = json.loads(read(folder, "comparison.json"))["methods"]
    assert [row["method"] for row in rows] == ["sirt", "ours"]
    for row in rows:
        assert row["core_seconds"] > 0 and row["peak_MiB"] > 5, row
        scores = os.path.join(folder, "scores.json")
        harness.succeed("evaluate", row["volume"], TRUTH, "--json", scores, "--overwrite")
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


def test_halves_and_held_out_views_give_figures_without_a_truth():
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
            assert json.load(file)["figures"]["held_out"]["error"] == row["held_out_error"], row
        views = {}
        for half in ("odd", "even"):
            with open(os.path.join(folder, f"{row['method']}.{half}.json")) as file:
                record = json.load(file)
            views[half] = {view["tilt_deg"] for view in record["figures"]["views"]}
        assert not views["odd"] & views["even"] and len(views["odd"] | views["even"]) == 20
    assert "Shell correlation of odd and even views" in read(folder, "report.html")


def test_every_method_that_can_be_is_tuned():
    folder = harness.fresh_directory("tuned")
    harness.succeed("compare", *series.input, *QUICK, "-o", folder, "--tune", "--methods", "wbp",
                    "--also", "s=baseline sirt --iterations 5", "--also",
                    "t=baseline tv --iterations 20 --weight 90", "--view-scale", "on", "--hold-out", 4)
    tunings = {}
    for name in ("wbp", "s", "t"):
        with open(os.path.join(folder, name + ".json")) as file:
            record = json.load(file)
        assert record["options"]["fit_view_scale"] is True
        tunings[name] = record["figures"]["tuning"]
    assert tunings["wbp"]["chosen"]["cutoff"] <= 0.5 and tunings["s"]["chosen"]["iterations"] > 5
    assert tunings["t"]["chosen"]["weight"] < 90
    rows = {row["method"]: row for row in json.loads(read(folder, "comparison.json"))["methods"]}
    for name in ("wbp", "s", "t"):
        with open(os.path.join(folder, name + ".held_out.json")) as file:
            record = json.load(file)
        held_out, tuning = record["figures"]["held_out"], record["figures"]["tuning"]
        assert record["options"]["method"] == tuning["chosen"], "the runs that score are not tuned"
        assert rows[name]["held_out_error"] == held_out["error"]
        scored = {view["view"] for view in held_out["views"]}
        assert scored and not scored & set(tuning["predicted_views"])
    assert tuning["chosen"]["weight"] < 90
    assert "tuned anew" in read(folder, "report.html")


def test_it_goes_on_where_it_stopped():
    folder = harness.fresh_directory("resumed")
    run = compare(folder, epochs=20000, run=harness.start)
    for line in run.stderr:
        if line.startswith("ours: running"):
            break
    run.send_signal(signal.SIGTERM)
    _, errors = run.communicate()
    assert run.returncode == 143 and folder in errors, errors
    assert not os.path.exists(os.path.join(folder, "report.html"))
    first = harness.read_bytes(os.path.join(folder, "sirt.row.json"))
    for file in ("ours.mrc", "ours.h5", "ours.json"):
        if os.path.exists(os.path.join(folder, file)):
            os.remove(os.path.join(folder, file))
    said = compare(folder).stderr
    assert "sirt: there already" in said and "ours: running" in said, said
    assert harness.read_bytes(os.path.join(folder, "sirt.row.json")) == first
    other = compare(folder, epochs=5, run=harness.tomofield)
    assert other.returncode == 2 and "--overwrite" in other.stderr, other.stderr
    compare(folder, "--overwrite", epochs=5)


def test_mistakes_are_named():
    folder = harness.fresh_directory("mistakes")
    for options, fact in ((["--methods", "magic"], "'magic'"), (["--also", "x"], "NAME=COMMAND"),
                          (["--also", "x=export y"], "'export'"),
                          (["--also", "sirt=baseline sirt"], "twice"),
                          (["--truth", "nowhere.mrc"], "nowhere.mrc")):
        words = harness.merge(["--methods", "sirt", "--truth", TRUTH], options)
        result = harness.tomofield("compare", *series.input, *QUICK, "-o", folder, *words)
        assert result.returncode == 2 and fact in result.stderr, (options, result.stderr)
    failing = harness.tomofield("compare", *series.input, *QUICK, "-o", folder, "--methods", "sirt",
                                "--also", "bad=baseline tv --weight -1")
    assert failing.returncode == 2, failing.stderr
    assert "bad failed with status 2" in failing.stderr and "bad.log" in failing.stderr


def test_chromium_shows_every_picture_without_errors():
    if not shutil.which("chromium"):
        print("skipped: there is no chromium")
        return
    folder = harness.fresh_directory("shown")
    compare(folder)
    script = ("<script>onload = () => { document.title = [...document.images].filter("
              "i => i.complete && i.naturalWidth > 0).length + ' shown'; }</script></body>")
    page = os.path.join(folder, "checked.html")
    with open(page, "w", encoding="utf-8") as file:
        file.write(read(folder, "report.html").replace("</body>", script))
    shown = subprocess.run(["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom",
                            "--enable-logging=stderr", "--user-data-dir=" + folder + "/profile",
                            "file://" + page], capture_output=True, text=True, timeout=120)
    assert "<title>12 shown</title>" in shown.stdout, shown.stdout[:2000]
    assert "CONSOLE" not in shown.stderr, shown.stderr


harness.run_tests(globals())
