"""Tests batch: the list of series, what runs, how it goes on, and the summary that it writes."""

import csv
import fcntl
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import time

import numpy as np
import pytest

import harness
import star_projects

SIZE = 32
QUICK = ["--thickness", 16, "--contrast", "bright", "--no-margin", "--leaf-size", 16, "--epochs", 2,
         "--coarse-epochs", 0, "--tv-penalty", "concave", "--view-scale", "off"]


@pytest.fixture(scope="module", name="data")
def make_data():
    """Returns a folder with two small series, a.mrc and b.mrc, and c.mrc, whose third view is
    constant, which only a run finds. The angles lie beside them."""
    folder = harness.fresh_directory("data")
    views = harness.Series("source").views[:, 2:2 + SIZE, 8:8 + SIZE].astype(np.float32)
    for name in "abc":
        if name == "c":
            views[2] = 5
        harness.write_stack(os.path.join(folder, name + ".mrc"), views)
        np.savetxt(os.path.join(folder, name + ".tlt"), harness.TILTS, fmt="%.1f")
    return folder


def pattern(data):
    return [os.path.join(data, "?.mrc"), "--tlt", "{folder}/{name}.tlt"]


# The batch gives these to each series itself.
OWN = {"stack", "--output", "--overwrite", "--resume"}


def options_of_reconstruct():
    """Returns the flag of every row of the option table, with its kind of value, as
    docs/options.md lists them."""
    page = pathlib.Path(__file__).resolve().parents[2] / "docs/options.md"
    rows = re.findall(r"^\| `([^`]*)` \| (.*?) \|", page.read_text("utf-8"), re.MULTILINE)
    return {flags.split(",")[-1].strip(): value for flags, value in rows}


def summary(folder):
    """Returns the lines of summary.csv by the names of their series."""
    with open(os.path.join(folder, "summary.csv"), encoding="utf-8", newline="") as file:
        return {line["name"]: line for line in csv.DictReader(file)}


def page(folder):
    with open(os.path.join(folder, "index.html"), encoding="utf-8") as file:
        return file.read()


def write_table(path, rows):
    with open(path, "w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(rows)
    return path


def options_of(volume):
    with open(volume[:-len(".mrc")] + ".json", encoding="utf-8") as file:
        return json.load(file)["options"]


@pytest.fixture(scope="module", name="first")
def run_first(data):
    """Returns the folder and the result of a batch of all three series."""
    folder = harness.fresh_directory("first")
    result = harness.tomofield("batch", *pattern(data), *QUICK, "-o", folder)
    return folder, result


def test_a_batch_and_its_tables_know_every_option_of_reconstruct(data):
    """No row of the option table may be forgotten."""
    options = options_of_reconstruct()
    assert len(options) > 80 and OWN < set(options), sorted(options)
    known = harness.succeed("batch", "--help-all").stdout
    missing = [flag for flag in options
               if flag not in OWN and not re.search(re.escape(flag) + r"(?![\w-])", known)]
    assert not missing
    # A column that is unknown, or that takes another kind of value, is refused with its name.
    columns = [flag[2:] for flag in options if flag not in OWN]
    table = write_table(os.path.join(harness.SCRATCH, "all.csv"),
                        [["stack", *columns], [os.path.join(data, "a.mrc"), *[""] * len(columns)]])
    harness.succeed("batch", table, "--tlt", os.path.join(data, "a.tlt"), *QUICK, "--dry-run", "-o",
                    harness.fresh_directory("all_columns"))


def test_names_are_filled_in_for_each_series(data):
    """Each file option of the table takes {folder} and {name}."""
    folder = harness.fresh_directory("filled")
    files = [flag for flag, value in options_of_reconstruct().items()
             if value.strip("` ").startswith("FILE") and flag not in OWN]
    assert {"--even", "--odd", "--mdoc", "--xf", "--aln", "--ctf", "--mask", "--local"} <= set(files)
    files.remove("--fiducials")  # these are read with the views, after the plan
    halves = harness.fresh_directory("other_halves")
    for name in "ab":
        shutil.copy(os.path.join(data, name + ".mrc"), halves)
    half = halves + "/{name}.mrc"
    # What an option needs beside it.
    others = {"--even": ["--odd", half], "--odd": ["--even", half],
              "--mtf": ["--defocus", 3]}
    for flag in files:
        angles = [] if flag == "--tlt" else ["--tlt", "{folder}/{name}.tlt"]
        refused = harness.tomofield("batch", os.path.join(data, "[ab].mrc"), *angles, *QUICK,
                                    "--dry-run", "-o", folder, flag, "{folder}/of_{name}.none",
                                    *others.get(flag, []))
        assert refused.returncode == 2, (flag, refused.stdout)
        for name in "ab":
            assert os.path.join(data, f"of_{name}.none") in refused.stderr, (flag, refused.stderr)


def test_names_are_filled_in_in_cells(data):
    folder = harness.fresh_directory("cells")
    table = write_table(os.path.join(folder, "list.csv"),
                        [["stack", "tlt", "output"],
                         *([os.path.join(data, f"{name}.mrc"), "{folder}/{name}.tlt",
                            os.path.join(folder, "{name}_x.mrc")] for name in "ab")])
    printed = harness.succeed("batch", table, *QUICK, "--dry-run", "-o", folder).stdout
    assert "2 of 2 series to reconstruct" in printed, printed
    # A name that stands for nothing is named, with its cell or its option.
    for rows, words, parts in (
            ([["stack", "tlt"], [os.path.join(data, "a.mrc"), "{folder}/{nam}.tlt"],
              [os.path.join(data, "b.mrc"), "{place}/b.tlt"]], [],
             ["line 2 of", "--tlt: '{nam}'", "line 3 of", "'{place}'", "{folder} for its folder"]),
            ([["stack", "tlt"], [os.path.join(data, "a.mrc"), "{folder}/{name.tlt"]], [],
             ["line 2 of", "--tlt: the brace of '{name' is not closed"]),
            ([["stack", "output"], [os.path.join(data, "a.mrc"), "{nam}.mrc"]], [],
             ["line 2 of", "output: '{nam}'"]),
            ([["stack"], [os.path.join(data, "a.mrc")]], ["--tlt", "{nam}.tlt"],
             ["--tlt: '{nam}' stands for nothing"])):
        write_table(table, rows)
        refused = harness.tomofield("batch", table, *words, *QUICK, "--dry-run", "-o", folder)
        assert refused.returncode == 2, refused
        for part in parts:
            assert part in refused.stderr, (part, refused.stderr)


def test_names_are_filled_in_in_the_names_of_series(data):
    folder = harness.fresh_directory("filled_names")
    table = write_table(os.path.join(folder, "list.csv"),
                        [["stack", "tlt", "name"],
                         *([os.path.join(data, f"{name}.mrc"), "{folder}/{name}.tlt", "C_{name}"]
                           for name in "ab")])
    printed = harness.succeed("batch", table, *QUICK, "--dry-run", "-o", folder).stdout
    assert "C_a: " in printed and "C_b: " in printed, printed


def test_a_batch_makes_halves(data):
    folder, halves = harness.fresh_directory("halves"), harness.fresh_directory("frames")
    random = np.random.default_rng(1)
    for name in "ab":
        for half in ("EVN", "ODD"):
            views = harness.read_volume(os.path.join(data, name + ".mrc"))
            noise = random.normal(0, 0.05 * np.ptp(views), views.shape)
            harness.write_stack(os.path.join(halves, f"{name}_{half}.mrc"),
                                (views + noise).astype(np.float32))
    harness.succeed("batch", os.path.join(data, "[ab].mrc"), "--tlt", "{folder}/{name}.tlt",
                    "--even", halves + "/{name}_EVN.mrc", "--odd", halves + "/{name}_ODD.mrc",
                    *QUICK, "-o", folder)
    for name in "ab":
        assert os.path.isfile(os.path.join(folder, f"{name}_fsc.png"))
        used = options_of(os.path.join(folder, name + ".mrc"))["input"]
        assert used["even"] == os.path.join(halves, f"{name}_EVN.mrc")


def test_a_series_that_fails_does_not_stop_the_others(data, first):
    folder, result = first
    assert result.returncode == 1, result.stderr
    assert "1 of 3 series failed: c" in result.stderr
    lines = summary(folder)
    assert [lines[name]["state"] for name in "abc"] == ["done", "done", "failed"]
    assert "section 3" in lines["c"]["reason"], lines["c"]
    for name in "ab":
        line = lines[name]
        volume = os.path.join(folder, name + ".mrc")
        assert line["output"] == volume
        assert harness.read_volume(volume).shape == (16, SIZE, SIZE)
        assert float(line["core_seconds"]) > 0 and float(line["wall_seconds"]) > 0
        assert 0.01 < float(line["peak_GiB"]) < 2
        assert line["verdict"].startswith("residual")
        assert "harness" not in line["warnings"]
    by_hand = os.path.join(harness.fresh_directory("by_hand"), "a.mrc")
    harness.succeed("reconstruct", os.path.join(data, "a.mrc"), "--tlt",
                    os.path.join(data, "a.tlt"), *QUICK, "-o", by_hand)
    assert np.array_equal(harness.read_volume(by_hand),
                          harness.read_volume(os.path.join(folder, "a.mrc")))


def test_the_page_shows_all_series_and_opens(first):
    folder, _ = first
    text = page(folder)
    for link in ("./a_xy.png", "./a.mrc", "./b.json", "./logs/c.log"):
        assert f'"{link}"' in text, link
        assert os.path.exists(os.path.join(folder, link))
    assert "./c_xy.png" not in text
    assert "1 failed" in text and "section 3" in text
    shown = subprocess.run(
        ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom",
         "--virtual-time-budget=2000", "file://" + os.path.join(folder, "index.html")],
        capture_output=True, text=True, timeout=60)
    assert shown.stdout.count("<tr>") == 4, shown.stderr


def test_files_that_are_called_like_options_are_series(data):
    folder = harness.fresh_directory("dashes")
    for name in ("-x", "--config=x"):
        for suffix in (".mrc", ".tlt"):
            shutil.copy(os.path.join(data, "a" + suffix), os.path.join(folder, name + suffix))
    harness.succeed("batch", "-o", "out", "--tlt", "{folder}/{name}.tlt", *QUICK, "--", "*.mrc",
                    cwd=folder)
    lines = summary(os.path.join(folder, "out"))
    assert {line["state"] for line in lines.values()} == {"done"}
    assert sorted(lines) == ["'--config=x", "'-x"]  # a spreadsheet would run them


def test_finished_series_are_skipped_and_others_are_tried_again(data, first):
    folder, _ = first
    before = harness.read_bytes(os.path.join(folder, "a.mrc"))
    written = os.stat(os.path.join(folder, "a.mrc")).st_mtime_ns
    refused = harness.tomofield("batch", *pattern(data), *QUICK, "-o", folder)
    assert refused.returncode == 2 and "--skip-existing" in refused.stderr
    again = harness.tomofield("batch", *pattern(data), *QUICK, "--exclude", "3", "-o", folder,
                              "--skip-existing")
    assert again.returncode == 0, again.stderr
    assert [summary(folder)[name]["state"] for name in "abc"] == ["skipped", "skipped", "done"]
    assert os.stat(os.path.join(folder, "a.mrc")).st_mtime_ns == written
    assert harness.read_bytes(os.path.join(folder, "a.mrc")) == before
    assert options_of(os.path.join(folder, "c.mrc"))["input"]["exclude"] == "3"


def test_results_that_cannot_be_read_are_not_finished(data, first):
    folder = harness.fresh_directory("unreadable")
    for file in os.listdir(first[0]):
        if file[0] in "ab" and os.path.isfile(os.path.join(first[0], file)):
            shutil.copy(os.path.join(first[0], file), folder)
    whole = {name: harness.read_bytes(os.path.join(folder, name)) for name in ("a.mrc", "b.json")}
    command = ["batch", os.path.join(data, "[ab].mrc"), *pattern(data)[1:], *QUICK,
               "--skip-existing", "-o", folder]
    for name in whole:
        open(os.path.join(folder, name), "wb").close()
        other = "b.mrc'" if name[0] == "a" else "a.mrc'"
        said = harness.tomofield(*command)
        assert said.returncode == 2 and other not in said.stderr, said.stderr
        for part in (os.path.join(folder, name), f"'{name}'", f"'{name[0]}.h5'", "remove ", "again"):
            assert part in said.stderr, (part, said.stderr)
        pathlib.Path(folder, name).write_bytes(whole[name])
    assert harness.succeed(*command).stdout.count("its results are there") == 2


def test_an_odd_file_of_a_series_is_to_be_removed(data, first):
    """`--overwrite` and `-o`, which a run advises, are those of the whole batch."""
    folder = harness.fresh_directory("odd")
    command = ["batch", os.path.join(data, "[ab].mrc"), *pattern(data)[1:], *QUICK, "-o", folder]
    for name, continues in (("b.json", False), ("b.json", True), ("b.h5", True)):
        with open(os.path.join(folder, name), "w", encoding="utf-8") as file:
            file.write("odd")
        said = harness.tomofield(*command, *(["--skip-existing"] if continues else []))
        assert said.returncode == (1 if name == "b.h5" else 2), said.stderr  # when b runs
        assert "--overwrite" not in said.stderr and f"remove '{name}'" in said.stderr, said.stderr
        assert f" from '{folder}'" in said.stderr, said.stderr
        os.remove(os.path.join(folder, name))


def test_a_pattern_without_quotes_is_answered_with_quotes(data):
    files = [os.path.join(data, f"{name}.mrc") for name in "abc"]
    folder = harness.fresh_directory("unquoted")
    said = harness.tomofield("batch", *files, *pattern(data)[1:], *QUICK, "-o", folder)
    assert said.returncode == 2 and "put a pattern in quotes" in said.stderr, said.stderr
    said = harness.tomofield("batch", files[0], "nowhere", *QUICK, "-o", folder)
    assert "'nowhere' belongs to no option" in said.stderr, said.stderr


def test_a_table_may_have_an_ending_in_capitals(data):
    folder = harness.fresh_directory("capitals")
    table = write_table(os.path.join(folder, "LIST.CSV"),
                        [["stack", "tlt", "thickness"],
                         [os.path.join(data, "a.mrc"), os.path.join(data, "a.tlt"), 16]])
    said = harness.succeed("batch", table, "-o", os.path.join(folder, "out"), "--dry-run")
    assert "1 of 1 series" in said.stdout, said.stdout


def test_a_table_gives_each_series_its_own_options(data):
    folder = harness.fresh_directory("table")
    other = os.path.join(folder, "other", "two.mrc")
    os.makedirs(os.path.dirname(other))
    table = write_table(os.path.join(folder, "list.csv"), [
        ["stack", "tlt", "name", "thickness", "exclude", "invert", "output"],
        [os.path.join(data, "a.mrc"), os.path.join(data, "a.tlt"), "one, first", "", "1,2", "", ""],
        [os.path.join(data, "b.mrc"), os.path.join(data, "b.tlt"), "two", 12, "", "TRUE", other]])
    results = os.path.join(folder, "results")
    harness.succeed("batch", table, *QUICK, "-o", results)
    one = os.path.join(results, "one, first.mrc")
    assert harness.read_volume(one).shape[0] == 16 and harness.read_volume(other).shape[0] == 12
    assert options_of(one)["input"]["exclude"] == "1,2"
    assert options_of(other)["volume"]["invert"] and not options_of(one)["volume"]["invert"]
    assert set(summary(results)) == {"one, first", "two"}
    assert '"./one%2C%20first.mrc"' in page(results) and '"./../other/two.mrc"' in page(results)


def test_all_tomograms_of_relion_are_reconstructed():
    folder = harness.fresh_directory("relion")
    star = star_projects.write_relion(folder, harness.Series("source"))
    results = os.path.join(folder, "results")
    assert QUICK[0] == "--thickness"  # which the files of RELION have
    harness.succeed("batch", star, *QUICK[2:], "-o", results)
    assert [line["state"] for line in summary(results).values()] == ["done", "done"]
    one, two = (harness.read_volume(os.path.join(results, name + ".mrc"))
                for name in ("TS_01", "TS_02"))
    assert one.shape[0] == harness.THICKNESS
    assert np.array_equal(one, two)  # the same images, in single files and in a stack
    rows = star_projects.read_rows(os.path.join(results, "tomograms.star"))
    for row, before in zip(rows, star_projects.read_rows(star), strict=True):
        assert row == {**row, **before}  # sizes are the same, since nothing is binned
        assert row["rlnTomoReconstructedTomogram"] == f"results/{before['rlnTomoName']}.mrc"
    said = harness.succeed("batch", star, *QUICK[2:], "--tilt-offset", 3, "--dry-run", "-o", results + "3")
    assert "TS_01, TS_02 will have no row for RELION" in said.stderr, said.stderr
    views = os.path.join(folder, "Tomograms/job009/tilt_series/TS_01.star")
    plan = harness.succeed("batch", views, *QUICK, "--dry-run", "-o", results + "2").stdout
    assert plan.startswith("TS_01:") and "1 of 1 series" in plan


def test_a_table_for_relion_has_the_series_with_results():
    folder = harness.fresh_directory("relion_parts")
    star = star_projects.write_relion(folder, harness.Series("source"))
    results = os.path.join(folder, "results")
    joined = os.path.join(results, "tomograms.star")
    os.makedirs(results)
    pathlib.Path(joined).write_text("of somebody else", encoding="utf-8")
    refused = harness.tomofield("batch", star, *QUICK[2:], "-o", results)
    assert refused.returncode == 2 and "not of an earlier batch" in refused.stderr, refused.stderr
    os.remove(joined)

    def names(*options):
        """Runs the batch and returns the tomograms in its table."""
        harness.tomofield("batch", star, *QUICK[2:], "-o", results, *options)
        if not os.path.exists(joined):
            return []
        return [row["rlnTomoName"] for row in star_projects.read_rows(joined)]

    def break_images():
        broken = np.full((len(harness.TILTS), harness.HEIGHT, harness.WIDTH), np.nan, np.float32)
        harness.write_stack(os.path.join(folder, "stacks/TS_02.mrcs"), broken)

    images = harness.read_bytes(os.path.join(folder, "stacks/TS_02.mrcs"))
    break_images()
    assert names() == ["TS_01"]
    pathlib.Path(folder, "stacks/TS_02.mrcs").write_bytes(images)
    assert names("--skip-existing") == ["TS_01", "TS_02"]  # the first keeps its row
    states = [line["state"] for line in summary(results).values()]
    assert states == ["skipped", "done"]
    break_images()
    assert names("--overwrite") == ["TS_01"]  # the row of an earlier result has gone
    assert names("--overwrite", "--roi", "8,8,40,28") == []  # RELION has no place for a part


def test_one_table_of_relion_by_two_names_is_joined():
    folder = harness.fresh_directory("two_names")
    star = pathlib.Path(star_projects.write_relion(folder, harness.Series("source")))
    link = star.with_name("linked.star")
    link.symlink_to(star)
    for other in (star.parent, link):
        results = os.path.join(folder, f"of_{other.name}")
        table = write_table(os.path.join(folder, "list.csv"),
                            [["stack", "series", "name"], [star, "TS_01", "TS_01"], [other, "TS_02", "TS_02"]])
        harness.succeed("batch", table, *QUICK[2:], "-o", results)
        joined = star_projects.read_rows(os.path.join(results, "tomograms.star"))
        assert [row["rlnTomoName"] for row in joined] == ["TS_01", "TS_02"]


def write_one_tomogram(folder, name):
    """Makes a project folder of RELION with one tomogram and returns its row in a table of a batch."""
    star = pathlib.Path(star_projects.write_relion(folder, harness.Series("source")))
    lines = star.read_text(encoding="utf-8").splitlines()
    kept = [line.replace("TS_01 ", f"{name} ", 1) for line in lines if not line.startswith("TS_02")]
    star.write_text("\n".join(kept) + "\n", encoding="utf-8")
    return [star.parent, pathlib.Path(folder).name]


def test_the_table_for_relion_is_its_own():
    folder = pathlib.Path(harness.fresh_directory("relion_own"))
    star = star_projects.write_relion(folder, harness.Series("source"))
    table = write_table(folder / "list.csv", [["stack", "series", "name"], [star, "TS_01", "a"], [star, "TS_02", "b"]])
    command = ["batch", table, *QUICK[2:], "-o", folder / "results"]
    harness.succeed(*command, cwd=folder)
    joined = folder / "results/tomograms.star"
    assert [row["rlnTomoName"] for row in star_projects.read_rows(str(joined))] == ["TS_01", "TS_02"]
    rows = joined.read_text(encoding="utf-8").partition("\n")[2]
    joined.write_text(rows, encoding="utf-8")  # as another program writes it again
    said = harness.tomofield(*command, "--overwrite", cwd=folder)
    assert said.returncode == 2 and "tomograms.star" in said.stderr and "earlier batch" in said.stderr, said.stderr
    assert joined.read_text(encoding="utf-8") == rows


def test_rows_of_several_tables_are_not_joined():
    """The files of each are named from its own project's folder."""
    folder = pathlib.Path(harness.fresh_directory("relion_folders"))
    rows = [write_one_tomogram(folder / name, name) for name in ("D1", "D2")]
    table = write_table(folder / "list.csv", [["stack", "name"], *rows])
    said = harness.succeed("batch", table, *QUICK[2:], "-o", folder / "results", cwd=folder)
    assert "of two tables of RELION" in said.stderr, said.stderr
    assert not (folder / "results/tomograms.star").exists() and (folder / "results/D2.star").exists()
    for pattern_of_tables, number in (("D1/*/*/tilt_series/*.star", 2), ("D?/*/*/tilt_series/TS_01.star", 2),
                                      ("D1/*/*/tomograms.star", 1)):
        plan = harness.succeed("batch", pattern_of_tables, *QUICK, "--dry-run", "-o", "other", cwd=folder)
        assert f"{number} of {number} series" in plan.stdout, plan


def test_finished_tomograms_without_a_row_are_named():
    folder = pathlib.Path(harness.fresh_directory("relion_rows"))
    star = star_projects.write_relion(folder, harness.Series("source"))
    command = ["batch", star, *QUICK[2:], "-o", folder / "results"]
    harness.succeed(*command)
    os.remove(folder / "results/TS_02.star")
    said = harness.succeed(*command, "--skip-existing")
    assert "results of TS_02 have no row" in said.stderr, said.stderr


def test_one_series_of_each_project_can_be_named():
    folder = pathlib.Path(harness.fresh_directory("relion_series"))
    star = pathlib.Path(star_projects.write_relion(folder, harness.Series("source")))
    several = harness.tomofield("batch", f"{star.parent}/", "--dry-run", "-o", "other", cwd=folder)
    assert several.returncode == 2 and "name one with --series" in several.stderr, several.stderr
    harness.succeed("batch", f"{star.parent}/", "--series", "TS_02", *QUICK[2:], "--dry-run", "-o", "other", cwd=folder)
    listed = harness.tomofield("batch", star, "--series", "TS_02", "--dry-run", "-o", "other", cwd=folder)
    assert listed.returncode == 2 and "leave --series out" in listed.stderr, listed.stderr


def test_a_tomogram_with_two_rows_is_not_joined():
    folder = pathlib.Path(harness.fresh_directory("relion_names"))
    star = star_projects.write_relion(folder, harness.Series("source"))
    table = write_table(folder / "list.csv", [["stack", "series", "name", "seed"], [star, "TS_01", "a", 1],
                                              [star, "TS_01", "b", 2]])
    said = harness.succeed("batch", table, *QUICK[2:], "-o", folder / "results", cwd=folder)
    assert "both the tomogram 'TS_01' of RELION" in said.stderr, said.stderr
    assert not (folder / "results/tomograms.star").exists()


def test_an_output_cannot_be_a_folder_of_the_batch(data):
    folder = harness.fresh_directory("output_folder")
    for output in ("out/logs", "out/logs/choice"):
        os.makedirs(os.path.join(folder, os.path.dirname(output)), exist_ok=True)
        table = write_table(os.path.join(folder, "list.csv"),
                            [["stack", "tlt", "name", "output"],
                             *[[os.path.join(data, f"{name}.mrc"), os.path.join(data, f"{name}.tlt"), name, place]
                               for name, place in (("a", output), ("b", ""))]])
        said = harness.tomofield("batch", table, *QUICK, "-o", "out", "--dry-run", cwd=folder)
        assert said.returncode == 2 and "needs a folder of this name" in said.stderr, (output, said)


def test_a_batch_that_was_stopped_while_it_replaced_results_goes_on_replacing(data):
    folder = pathlib.Path(harness.fresh_directory("stopped_overwrite"))
    command = ["batch", os.path.join(data, "[ab].mrc"), *pattern(data)[1:], *QUICK, "--at-once", 1, "--threads", 1,
               "-o", folder / "out"]
    harness.succeed(*command)
    before = {name: options_of(str(folder / "out" / name))["fit"]["seed"] for name in ("a.mrc", "b.mrc")}
    longer = [*[400 if word == 2 else word for word in command], "--seed", 7]
    run = harness.start(*longer, "--overwrite")
    state = folder / "out/logs/a.state.json"
    while run.poll() is None and '"running"' not in state.read_text(encoding="utf-8"):
        time.sleep(0.02)
    run.send_signal(signal.SIGINT)
    assert run.wait(timeout=60) == 130
    said = harness.succeed(*longer, "--skip-existing")
    assert "2 of 2 series" in said.stdout, said
    for name, seed in before.items():
        assert seed != 7 and options_of(str(folder / "out" / name))["fit"]["seed"] == 7
    assert "0 of 2 series" in harness.succeed(*longer, "--skip-existing").stdout


def test_what_no_star_file_can_hold_is_refused_before_the_work():
    folder = pathlib.Path(harness.fresh_directory("carriage_return"))
    star = pathlib.Path(star_projects.write_relion(folder, harness.Series("source")))
    for run in (["reconstruct", star, "--series", "TS_01", "-o", folder / "a\rb.mrc"],
                ["batch", star, "-o", folder / "a\rb"]):
        said = harness.tomofield(*run, *QUICK[2:], "--dry-run", cwd=folder)
        assert said.returncode == 2 and "cannot be written into a STAR file" in said.stderr, said
    text = star.read_text(encoding="utf-8").replace("'the optics'", "'the\roptics'")
    star.write_text(text, encoding="utf-8", newline="")
    said = harness.tomofield("batch", star, *QUICK[2:], "--dry-run", "-o", "out", cwd=folder)
    assert said.returncode == 2 and "_rlnOpticsGroupName has a carriage return" in said.stderr, said


def test_all_mistakes_are_found_before_anything_starts(data):
    folder = harness.fresh_directory("mistakes")
    results = os.path.join(folder, "results")

    def refusal(*rows, **keywords):
        table = write_table(os.path.join(folder, "list.csv"), rows)
        result = harness.tomofield("batch", table, *QUICK, "-o", results, **keywords)
        assert result.returncode == 2, result.stderr
        assert not os.path.exists(results)
        return result.stderr

    a, tlt = os.path.join(data, "a.mrc"), os.path.join(data, "a.tlt")
    said = refusal(["stack", "tlt", "bin"], [a, tlt, "0"], ["nowhere.mrc", tlt, ""])
    assert "line 3" in said and "nowhere.mrc" in said
    said = refusal(["stack", "tlt", "bin"], [a, tlt, "0"], [a[:-5] + "b.mrc", "no.tlt", ""])
    assert "line 2" in said and "--bin" in said and "line 3" in said and "no.tlt" in said
    too_long = 300 * "x" + ".mrc"  # for any file system
    assert "line 2" in refusal(["stack", "tlt"], [too_long, tlt])
    assert "'thicknes'" in refusal(["stack", "thicknes"], [a, 12])
    assert "'overwrite'" in refusal(["stack", "overwrite"], [a, "true"])
    assert "same name 'a'" in refusal(["stack", "tlt"], [a, tlt], [a, tlt])
    nothing = harness.tomofield("batch", a, "--tlt", tlt, "-o", results)
    assert nothing.returncode == 2 and "--thickness" in nothing.stderr
    assert "'maybe'" in refusal(["stack", "invert"], [a, "maybe"])
    said = refusal(["stack", "thicknes", "tlt", "output", "invert"],
                   [a, 12, "{foldr}/a.tlt", "", ""], [a, 12, tlt, "{nam}.mrc", "maybe"])
    for part in ("did you mean 'thickness'", "'maybe'", "'{foldr}'", "'{nam}'", "same name 'a'"):
        assert part in said, (part, said)
    said = refusal(["stack", "tlt", "bin", "output"], [a, tlt, "0", ""],
                   *([f"{a[:-5]}{name}.mrc", tlt, "", os.path.join(results, "x" + ending)]
                     for name, ending in (("b", ".mrc"), ("c", ".rec"))))
    assert "--bin" in said and "would both write" in said, said
    assert "'stack'" in refusal(["name"], ["x"])
    small_job = {**os.environ, "SLURM_JOB_ID": "1", "SLURM_MEM_PER_NODE": "8"}  # MiB
    assert "a needs about" in refusal(["stack", "tlt"], [a, tlt], env=small_job)
    nothing = harness.tomofield("batch", os.path.join(folder, "*.st"), "-o", results)
    assert nothing.returncode == 2 and "*.st" in nothing.stderr


def test_no_file_is_written_twice_or_replaces_an_input(data):
    """Every spelling of a file is the file, and a batch has files of its own."""
    folder = harness.fresh_directory("conflicts")
    results = os.path.join(folder, "results")
    os.makedirs(results)
    os.symlink(results, os.path.join(folder, "link"))
    os.symlink(os.path.join(results, "new.mrc"), os.path.join(folder, "pointer.mrc"))
    for name in "ab":
        for ending in (".mrc", ".tlt"):
            shutil.copy(os.path.join(data, name + ending), folder)
    a, b = (os.path.join(folder, name) for name in ("a.mrc", "b.mrc"))
    before = {path: harness.read_bytes(path) for path in (a, b)}

    def refusal(output_a, output_b, *options, table=os.path.join(folder, "list.csv"), name=""):
        write_table(table, [["stack", "tlt", "name", "output"],
                            [a, a[:-4] + ".tlt", name, output_a],
                            [b, b[:-4] + ".tlt", "", output_b]])
        written = harness.read_bytes(table)
        result = harness.tomofield("batch", table, *QUICK, "-o", results, *options)
        assert result.returncode == 2, (output_a, output_b, result.stderr)
        assert harness.read_bytes(table) == written, "the table is whole"
        assert {path: harness.read_bytes(path) for path in (a, b)} == before
        assert not os.path.exists(os.path.join(results, "batch.json")), "nothing has begun"
        return result.stderr

    def path(*parts):
        return os.path.join(folder, *parts)

    for options in ([], ["--overwrite"]):
        for one, other in ((path("one.mrc"), path("one.rec")),
                           (path("results", "new.mrc"), path("pointer.mrc")),
                           (path("results", "one.mrc"), path("link", "one.mrc")),
                           (path("results", "one.rec"), path("link", ".", "one.mrc"))):
            said = refusal(one, other, *options)
            assert "the series 'a' and the series 'b' would both write" in said, said
        said = refusal(path("results", "..", "results", "batch.rec"), "", *options)
        assert "the batch itself and the series 'a'" in said, said
        said = refusal(path("results", "batch.json"), "", *options)
        assert "the batch itself and this series would both write" in said, said
        for name in ("batch", "choice"):
            said = refusal("", "", *options, name=name)
            assert f"the batch itself and the series '{name}'" in said, said
        said = refusal(path("results", "..", "b.mrc"), "", *options)
        assert "the series 'b' is read from" in said or "the input" in said, said
    own = path("results", "summary.csv")
    said = refusal("", "", table=own)
    assert "the batch itself would replace" in said and "the list of the series" in said, said
    os.remove(own)
    shutil.move(b[:-4] + ".tlt", b[:-4] + "_align.json")
    said = harness.tomofield("batch", path("?.mrc"), "--tlt", b[:-4] + "_align.json", *QUICK, "-o",
                             folder, "--overwrite")
    assert said.returncode == 2 and "the input" in said.stderr, said.stderr


def test_its_configuration_is_an_input(data):
    folder = harness.fresh_directory("configured")
    for name in ("a.json", "summary.csv"):
        config = pathlib.Path(folder, name)
        config.write_text("", encoding="utf-8")
        said = harness.tomofield("batch", *pattern(data), *QUICK, "-o", folder, "--overwrite",
                                 "--config", config)
        assert said.returncode == 2 and "which the command line is read from" in said.stderr, said
        assert config.read_bytes() == b""
        config.unlink()


def test_the_file_of_a_config_cell_sets_what_a_column_may_set(data):
    """A trace of one series would replace the stack of another."""
    folder = pathlib.Path(harness.fresh_directory("config_cells"))
    for name in ("a.mrc", "a.tlt"):
        shutil.copy(os.path.join(data, name), folder)
    table = write_table(folder / "t.csv", [["stack", "tlt", "config"],
                                           [folder / "a.mrc", folder / "a.tlt", folder / "c.toml"]])
    for line in ("trace = 't.csv'", "plan = 'a.tlt'", "grid = 'a.tlt'", "overwrite = true",
                 "dry-run = true", "output = 'z.mrc'"):
        (folder / "c.toml").write_text(line, encoding="utf-8")
        before = harness.contents(folder)
        said = harness.tomofield("batch", table, *QUICK, "-o", folder / "results", cwd=folder)
        assert said.returncode == 2, said
        for fact in ("line 2 of", f"'{line.split()[0]}'", "c.toml", "set by the batch"):
            assert fact in said.stderr, (fact, said.stderr)
        assert harness.contents(folder) == before
    # As a cell does, it replaces options of the command line and of its configuration.
    (folder / "c.toml").write_text("epochs = 7\nseed = 3\n", encoding="utf-8")
    (folder / "all.toml").write_text("seed = 2\n", encoding="utf-8")
    harness.succeed("batch", table, *QUICK, "--tv", 5, "--prior", "tv", "--config", folder / "all.toml",
                    "-o", folder / "results")
    fit = options_of(os.path.join(folder, "results", "a.mrc"))["fit"]
    assert (fit["epochs"], fit["seed"]) == (7, 3), fit


def test_a_name_like_an_option_gives_no_advice_on_files(data):
    folder = harness.fresh_directory("named_overwrite")
    table = write_table(os.path.join(folder, "t.csv"),
                        [["stack", "tlt"], [os.path.join(data, "a.mrc"), "my--overwrite.tlt"]])
    said = harness.tomofield("batch", table, *QUICK, "-o", folder)
    assert said.returncode == 2 and "my--overwrite.tlt" in said.stderr, said
    assert "remove" not in said.stderr, said.stderr


@pytest.mark.parametrize("name", ["summary.csv", "index.html"])
def test_a_folder_in_the_place_of_its_own_file_is_found_first(data, name):
    folder = harness.fresh_directory("folders")
    os.makedirs(os.path.join(folder, name))
    said = harness.tomofield("batch", *pattern(data), *QUICK, "-o", folder)
    assert said.returncode == 2 and name in said.stderr and "is a folder" in said.stderr, said
    assert os.listdir(folder) == [name]


def write_renamed(folder, name):
    """Writes tomograms of RELION, the first of which is called `name`, and returns their table."""
    star = star_projects.write_relion(folder, harness.Series("source"))
    text = pathlib.Path(star).read_text(encoding="utf-8")
    pathlib.Path(star).write_text(text.replace("TS_01 ", name + " ", 1), encoding="utf-8")
    return star


def test_a_tomogram_does_not_take_the_place_of_the_table_for_relion():
    folder = harness.fresh_directory("relion_name")
    star = write_renamed(folder, "tomograms")
    results = os.path.join(folder, "results")
    said = harness.tomofield("batch", star, *QUICK[2:], "-o", results)
    assert said.returncode == 2 and "would both write" in said.stderr, said.stderr
    assert "tomograms.star" in said.stderr and not os.path.exists(results)


@pytest.mark.parametrize("name", ["index.html", "summary.csv", "batch.json", "choice.json", "logs/a.log"])
def test_files_of_others_that_are_called_like_its_own_stay(data, name):
    results = pathlib.Path(harness.fresh_directory("of_others"))
    (results / "logs").mkdir()
    (results / name).write_text("precious", encoding="utf-8")
    for more in ([], ["--overwrite"], ["--dry-run"]):
        said = harness.tomofield("batch", os.path.join(data, "a.mrc"), *pattern(data)[1:], *QUICK, *more,
                                 "-o", results)
        assert said.returncode == 2 and name in said.stderr and "earlier batch" in said.stderr, said.stderr
    assert (results / name).read_text(encoding="utf-8") == "precious"


def sbatch_that_runs(folder, commands):
    """Returns the environment with an sbatch that runs these commands of the shell."""
    program = pathlib.Path(folder) / "sbatch"
    program.write_text(f"#!/bin/sh\n{commands}\n", encoding="utf-8")
    program.chmod(0o755)
    return {**os.environ, "PATH": f"{folder}:/usr/bin:/bin"}


def fake_sbatch(folder, answer):
    """Returns the environment with an sbatch that answers this."""
    return sbatch_that_runs(folder, f"printf '{answer}'")


def test_what_slurm_cannot_take_leaves_the_earlier_batch_as_it_is(data):
    folder = pathlib.Path(harness.fresh_directory("refused"))
    results, programs, spaced = folder / "results", folder / "programs", folder / "a b"
    programs.mkdir()
    spaced.mkdir()
    command = ["batch", os.path.join(data, "a.mrc"), *pattern(data)[1:], *QUICK, "-o", results]
    harness.succeed(*command)
    files = {path: path.read_bytes() for path in results.rglob("*") if path.is_file()}
    with_sbatch = fake_sbatch(programs, "55\\n")
    for environment, where, part in ((with_sbatch, spaced, "start the command in a folder"),
                                     ({**os.environ, "PATH": "/nowhere"}, folder, "sbatch is not there")):
        said = harness.tomofield(*command, "--overwrite", "--slurm", cwd=where, env=environment)
        assert said.returncode == 2 and part in said.stderr, said.stderr
    tilts = folder / os.fsdecode(b"t\xff")
    tilts.mkdir()
    shutil.copy(os.path.join(data, "a.tlt"), tilts)
    for more in (["--dry-run"], []):
        said = harness.tomofield(*command[:2], "--tlt", tilts / "{name}.tlt", *command[4:], "--overwrite", *more)
        assert said.returncode == 2 and "not UTF-8" in said.stderr, said.stderr
    assert files == {path: path.read_bytes() for path in results.rglob("*") if path.is_file()}


def test_files_of_others_in_the_folder_of_a_batch_stay(data):
    """A batch has its list, its summary and its page; others of its names may be of somebody else."""
    folder = pathlib.Path(harness.fresh_directory("others_in_batch"))
    results = folder / "results"
    command = ["batch", os.path.join(data, "a.mrc"), *pattern(data)[1:], *QUICK, "-o", results]
    harness.succeed(*command)
    for name in ("choice.json", "batch.sbatch", "logs/b.log", "logs/b.state.json", "logs/choice/b.log"):
        mine = results / name
        mine.parent.mkdir(exist_ok=True)
        mine.write_text("precious", encoding="utf-8")
        inputs = os.path.join(data, "[ab].mrc")
        said = harness.tomofield("batch", inputs, *command[2:], "--overwrite", "--slurm",
                                 env=fake_sbatch(folder, "55\\n"))
        assert said.returncode == 2 and name in said.stderr and "earlier batch" in said.stderr, said.stderr
        assert mine.read_text(encoding="utf-8") == "precious"
        mine.unlink()
    for _ in range(2):  # the second finds the script of the first
        harness.succeed(*command, "--overwrite", "--slurm", env=fake_sbatch(folder, "55\\n"))


def test_tasks_of_another_batch_in_the_folder_make_nothing(data):
    folder = harness.fresh_directory("waiting")
    results = os.path.join(folder, "results")

    def submit(name, *more):
        said = harness.succeed("batch", os.path.join(data, name), *pattern(data)[1:], *QUICK, "--slurm",
                               "-o", results, *more, env=fake_sbatch(folder, "55\\n"))
        script = os.path.join(folder, f"{name}.sbatch")
        shutil.copy(os.path.join(results, "batch.sbatch"), script)  # as Slurm keeps it
        return said, script

    def run_task(script):
        return subprocess.run(["sh", script], env={**os.environ, "SLURM_ARRAY_TASK_ID": "1"},
                              capture_output=True, text=True, timeout=300, check=False)

    _, first = submit("a.mrc")
    said, second = submit("b.mrc")
    assert "has not finished a:" in said.stderr, said.stderr
    task = run_task(first)
    assert task.returncode == 2 and "list of another batch" in task.stderr, task.stderr
    assert not os.path.exists(os.path.join(results, "b.mrc"))
    assert run_task(second).returncode == 0 and os.path.exists(os.path.join(results, "b.mrc"))


@pytest.mark.parametrize("answer, number", [
    ("note\\n55;cluster\\nsbatch: more\\n", "55"), ("queued\\n", None), ("0\\n", None),
    ("99999999999999999999999\\n", None), ("4294967296\\n", None), ("\\0\\0\\n", None)])
def test_the_answer_of_sbatch_is_a_number(data, answer, number):
    folder = harness.fresh_directory("answer")
    said = harness.tomofield("batch", os.path.join(data, "a.mrc"), *pattern(data)[1:], *QUICK, "--slurm",
                             "-o", os.path.join(folder, "results"), env=fake_sbatch(folder, answer))
    if number:
        assert said.returncode == 0 and f"Slurm job {number}" in said.stdout, said
    else:
        assert said.returncode == 2 and "look with squeue" in said.stderr, said.stderr


def test_an_sbatch_that_fails_silently_has_its_status(data):
    folder = harness.fresh_directory("silent")
    environment = fake_sbatch(folder, "")
    with open(os.path.join(folder, "sbatch"), "a", encoding="utf-8") as program:
        program.write("exit 3\n")
    said = harness.tomofield("batch", os.path.join(data, "a.mrc"), *pattern(data)[1:], *QUICK, "--slurm",
                             "-o", os.path.join(folder, "results"), env=environment)
    assert said.returncode == 2 and "failed with status 3" in said.stderr, said.stderr


def test_a_tomogram_may_be_called_like_a_placeholder():
    folder = harness.fresh_directory("braces")
    star = write_renamed(folder, "{name}")
    results = os.path.join(folder, "results")
    harness.succeed("batch", star, *QUICK[2:], "-o", results, cwd=folder)
    with open(os.path.join(results, "batch.json"), encoding="utf-8") as file:
        jobs = json.load(file)["jobs"]
    assert any("--series={name}" in job["command"] for job in jobs), jobs


def test_two_tomograms_of_one_name_are_told_apart_in_the_star_file():
    folder = harness.fresh_directory("one_name")
    star = star_projects.write_relion(folder, harness.Series("source"))
    lines = pathlib.Path(star).read_text(encoding="utf-8").splitlines()
    row = next(line for line in lines if line.startswith("TS_01 "))
    pathlib.Path(star).write_text("\n".join(lines[:lines.index(row) + 1] + [row]) + "\n", encoding="utf-8")
    said = harness.tomofield("batch", star, *QUICK[2:], "-o", os.path.join(folder, "results"))
    assert said.returncode == 2 and "rlnTomoName of its own" in said.stderr, said.stderr


def test_dry_run_tells_what_is_needed_and_makes_nothing(data):
    results = os.path.join(harness.fresh_directory("dry"), "results")
    said = harness.succeed("batch", *pattern(data), *QUICK, "--dry-run", "-o", results).stdout
    assert said.count("of processor time") == 3 and "3 of 3 series" in said
    assert not os.path.exists(results)


def test_a_plan_for_programs_has_what_a_run_needs(data):
    folder = harness.fresh_directory("plan")
    plan, volume = os.path.join(folder, "plan.json"), os.path.join(folder, "a.mrc")
    command = ["reconstruct", os.path.join(data, "a.mrc"), "--tlt", os.path.join(data, "a.tlt"),
               *QUICK, "-o", volume]
    harness.succeed(*command, "--plan", plan)
    with open(plan, encoding="utf-8") as file:
        needs = json.load(file)
    assert os.listdir(folder) == ["plan.json"]
    assert 0 < needs["memory_bytes_of_one_thread"] <= needs["memory_bytes"] < 1 << 30
    assert needs["core_seconds"] > 0
    assert needs["result_bytes"] > 4 * 16 * SIZE * SIZE + 4 * needs["parameters"]
    assert needs["disk_bytes"] > needs["result_bytes"]
    refused = harness.tomofield(*command, "--plan", plan)
    assert refused.returncode == 2 and "--plan" in refused.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_batch_that_is_stopped_goes_on(data, number):
    """Ctrl-C stops all series in order. If the batch is killed, the system stops its series."""
    folder = harness.fresh_directory("stopped")
    long = [*harness.merge(QUICK, ["--epochs", 4000]), "--checkpoint-minutes", 0]
    run = harness.start("batch", *pattern(data), *long, "--at-once", 1, "--threads", 1, "-o",
                        folder)
    model = os.path.join(folder, "a.h5")
    while not os.path.exists(model) and run.poll() is None:
        time.sleep(0.02)
    run.send_signal(number)
    _, errors = run.communicate(timeout=60)
    assert run.returncode == (-signal.SIGKILL if number == signal.SIGKILL else 130), errors
    if number == signal.SIGINT:
        assert "--skip-existing" in errors
        assert summary(folder)["a"]["state"] == "stopped"
        assert summary(folder)["b"]["state"] == "waiting"
    lock = os.path.join(folder, ".a.h5.tomofield-lock")
    for _ in range(500):  # the series saves its checkpoint
        if not os.path.exists(lock):
            break
        time.sleep(0.02)
    assert not os.path.exists(os.path.join(folder, "a.mrc"))
    again = harness.start("batch", os.path.join(data, "a.mrc"), *pattern(data)[1:], *long,
                          "--skip-existing", "-o", folder)
    log = os.path.join(folder, "logs", "a.log")
    while again.poll() is None and "resum" not in harness.read_bytes(log).decode():
        time.sleep(0.02)
    again.send_signal(signal.SIGTERM)
    again.communicate(timeout=60)
    assert "resum" in harness.read_bytes(log).decode()


def test_a_series_that_cannot_start_fails_alone(data):
    """The folder of its results is one that nobody can write to."""
    folder = harness.fresh_directory("no_start")
    results = os.path.join(folder, "results")
    program = pathlib.Path(folder, "tomofield")
    program.write_text('#!/bin/sh\ncase "$*" in *--plan=*|*--plan*) ;; *a.mrc*) rm "$0";; esac\n'
                       f'exec {harness.PROGRAM} "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    said = harness.tomofield("batch", *pattern(data), *QUICK, "--choose", "each", "--at-once", 1, "-o", results,
                             env={**os.environ, "TOMOFIELD_LAUNCHER": str(program)})
    states = {name: row["state"] for name, row in summary(results).items()}
    assert said.returncode == 1 and list(states.values()).count("failed") == 2, (said, states)
    assert "cannot be run" in "".join(row["reason"] for row in summary(results).values())


@pytest.mark.parametrize("number, to_all", [(signal.SIGTERM, False), (signal.SIGINT, True)])
def test_a_stop_while_sbatch_answers_submits_nothing(data, number, to_all):
    folder = harness.fresh_directory("slow_sbatch")
    run = harness.start("batch", *pattern(data), *QUICK, "--tv", 5, "--prior", "tv", "--slurm", "-o",
                        os.path.join(folder, "results"), start_new_session=True,
                        env=sbatch_that_runs(folder, f"touch {folder}/asked; sleep 30; echo 77"))
    while not os.path.exists(os.path.join(folder, "asked")):
        time.sleep(0.05)
        assert run.poll() is None, run.communicate()
    os.killpg(run.pid, number) if to_all else run.send_signal(number)
    said = run.communicate(timeout=20)[1]
    assert run.returncode == 128 + number and "no job was submitted" in said, (run.returncode, said)


def test_a_job_that_was_submitted_before_sbatch_refused_another_is_named(data):
    folder = harness.fresh_directory("half_submitted")
    said = harness.tomofield("batch", *pattern(data), *QUICK[:-4], "--slurm", "-o", os.path.join(folder, "results"),
                             env=sbatch_that_runs(folder, 'case "$*" in *--array=*) echo 77;; '
                                                          "*) echo no more; exit 1;; esac"))
    assert said.returncode == 2 and "no more" in said.stderr and "scancel 77" in said.stderr, said


def test_a_task_that_cannot_be_submitted_again_says_so_in_the_summary(data):
    folder = harness.fresh_directory("not_again")
    results = os.path.join(folder, "results")
    command = ["batch", os.path.join(data, "a.mrc"), *pattern(data)[1:],
               *harness.merge(QUICK, ["--epochs", 4000]), "--tv", 5, "--prior", "tv", "--slurm", "-o", results]
    harness.succeed(*command, env=fake_sbatch(folder, "55\\n"))
    task = subprocess.Popen(["sh", os.path.join(results, "batch.sbatch")], stderr=subprocess.PIPE, text=True,
                            env={**sbatch_that_runs(folder, "echo at the limit; exit 1"),
                                 "SLURM_ARRAY_TASK_ID": "1"})
    model = os.path.join(results, "a.h5")
    while "a.log" not in os.listdir(os.path.join(results, "logs")) or \
            b"epoch 1/" not in harness.read_bytes(os.path.join(results, "logs/a.log")):
        time.sleep(0.05)
        assert task.poll() is None, task.communicate()
    task.send_signal(signal.SIGUSR1)
    said = task.communicate(timeout=60)[1]
    assert task.returncode == 128 + signal.SIGUSR1 and "at the limit" in said, (task.returncode, said)
    assert os.path.exists(model) and summary(results)["a"]["state"] == "stopped"
    assert "at the limit" in summary(results)["a"]["reason"]


def test_a_series_that_lacks_the_choice_of_its_batch_says_so_in_the_summary(data):
    """The task of Slurm that chooses was stopped, and those after it run all the same."""
    folder = harness.fresh_directory("no_choice")
    results = os.path.join(folder, "results")
    at = QUICK.index("--tv-penalty")
    environment = fake_sbatch(folder, "55\n")
    harness.succeed("batch", *pattern(data), *QUICK[:at], *QUICK[at + 2:], "--slurm", "-o", results, env=environment)
    task = subprocess.run(["sh", os.path.join(results, "batch.sbatch")], capture_output=True, text=True,
                          env={**environment, "SLURM_ARRAY_TASK_ID": "1"})
    assert task.returncode == 0 and "chooses for itself" in task.stderr, task
    line = summary(results)["a"]
    assert line["state"] == "done" and "made no choice" in line["reason"], line


def test_a_series_that_ends_before_it_speaks_has_a_reason(data):
    folder = harness.fresh_directory("silent")
    launcher = pathlib.Path(folder, "launch.sh")
    launcher.write_text('#!/bin/bash\ncase "$*" in *--plan=*) ;; *b.mrc*) kill -TERM $$;; esac\n'
                        f'exec {harness.PROGRAM} "$@"\n', encoding="utf-8")
    launcher.chmod(0o755)
    harness.tomofield("batch", *pattern(data), *QUICK, "--choose", "each", "-o", os.path.join(folder, "results"),
                      env={**os.environ, "TOMOFIELD_LAUNCHER": str(launcher)})
    assert "signal 15" in summary(os.path.join(folder, "results"))["b"]["reason"]


def test_a_series_that_another_run_writes_is_waited_for(data):
    """The runs of a batch that was killed may still end in order, and their files are no faults."""
    folder = harness.fresh_directory("still_running")
    pathlib.Path(folder, "a.h5").write_bytes(b"half written")
    with open(os.path.join(folder, ".a.mrc.tomofield-lock"), "w", encoding="ascii") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        said = harness.tomofield("batch", *pattern(data), *QUICK, "--skip-existing", "-o", folder)
    assert said.returncode == 2 and "another run writes" in said.stderr, said
    assert "wait until it has ended" in said.stderr and "remove" not in said.stderr, said


def test_a_series_that_was_killed_before_its_first_checkpoint_is_run_again(data):
    """Its lock says whose the pictures are that its trials have drawn."""
    folder = harness.fresh_directory("killed_early")
    pathlib.Path(folder, "a_xy.png").write_bytes(b"a picture")
    command = ["batch", *pattern(data), *QUICK, "--skip-existing", "-o", folder]
    refused = harness.tomofield(*command)
    assert refused.returncode == 2 and "remove 'a_xy.png'" in refused.stderr, refused
    pathlib.Path(folder, ".a.mrc.tomofield-lock").write_text("process 1 on node7", encoding="ascii")
    harness.tomofield(*command)
    assert summary(folder)["a"]["state"] == "done"


def test_a_series_that_is_killed_ends_alone(data):
    folder = harness.fresh_directory("killed")
    rows = [[os.path.join(data, name + ".mrc"), os.path.join(data, name + ".tlt"), epochs]
            for name, epochs in (("b", 2), ("a", 4000))]
    table = write_table(os.path.join(folder, "list.csv"), [["stack", "tlt", "epochs"], *rows])
    run = harness.start("batch", table, *QUICK, "--at-once", 1, "-o", folder)
    log = os.path.join(folder, "logs", "a.log")
    while run.poll() is None and not (os.path.exists(log)
                                      and b"reconstruct " in harness.read_bytes(log)):
        time.sleep(0.02)  # the larger series goes first
    with open(f"/proc/{run.pid}/task/{run.pid}/children", encoding="ascii") as file:
        child, = map(int, file.read().split())
    os.kill(child, signal.SIGKILL)
    _, errors = run.communicate(timeout=60)
    assert run.returncode == 1 and "1 of 2 series failed: a" in errors, errors
    lines = summary(folder)
    assert lines["a"]["state"] == "failed" and "killed" in lines["a"]["reason"]
    assert lines["b"]["state"] == "done"
