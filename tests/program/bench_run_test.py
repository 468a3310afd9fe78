"""bench/run and bench/regression: rows are measured, kept and gathered; slower ones are found.

usage: bench_run_test.py TOMOFIELD SCRATCH_DIR"""

import json
import os
import subprocess
import sys

import mrcfile
import numpy as np

import harness

BENCH = os.path.abspath(os.path.join(os.path.dirname(__file__), "../../bench"))
sys.path.insert(0, BENCH)

import quality_rows  # pylint: disable=wrong-import-position
import speed_rows  # pylint: disable=wrong-import-position
import wide_band  # pylint: disable=wrong-import-position

SHARED = os.environ.get("TOMOFIELD_SHARED", "")
MAKE_CELL = os.path.join(SHARED, "tools/make_cell.py")


def bench(name, *arguments):
    return subprocess.run(["/usr/bin/python3", os.path.join(BENCH, name), *map(str, arguments)],
                          capture_output=True, text=True)


def bench_run(folder, *arguments):
    return bench("run", folder, "--program", harness.PROGRAM, "--make-cell", MAKE_CELL, "--quick",
                 *arguments)


def read_rows(folder):
    with open(os.path.join(folder, "run.json"), encoding="utf-8") as file:
        return {row["name"]: row["figures"] for row in json.load(file)["rows"]}


def test_rows_are_measured_once_and_gathered():
    folder = harness.fresh_directory("sizes")
    first = bench_run(folder, "--only", "^size.*rank", "--repeats", 1)
    assert first.returncode == 0, first.stderr
    before = read_rows(folder)
    assert len(before) == 3, before
    for figures in before.values():
        assert figures["core_seconds"][0] > 0 and figures["peak_MiB"][0] > 5, figures
    again = bench_run(folder, "--only", "^size.*rank 8", "--repeats", 2)
    assert again.returncode == 0 and again.stderr.count("repeat") == 1, again.stderr
    for name, figures in read_rows(folder).items():
        added = 1 if "rank 8" in name else 0
        assert figures["core_seconds"][:1] == before[name]["core_seconds"]
        assert len(figures["core_seconds"]) == 1 + added, name
    table = bench_run(folder, "--table", "--repeats", 2)
    assert table.stdout == again.stdout and table.stderr == "", table.stderr
    assert "| rank | 48x48/24, 11 views, rank 8 | " in table.stdout, table.stdout


def test_another_program_is_run_beside_ours():
    if not os.path.exists(MAKE_CELL):
        print("skipped: there is no make_cell.py")
        return
    folder = harness.fresh_directory("programs")
    config = os.path.join(folder, "programs.toml")
    write(config, f"[programs]\nwbp = \"{harness.PROGRAM} baseline wbp {{stack}} --tlt {{tlt}} "
          "--thickness {thickness} --contrast bright --no-margin -o {output}\"\n")
    run = bench_run(folder, "--only", "^A .*(sirt|wbp)", "--repeats", 1, "--config", config)
    assert run.returncode == 0, run.stderr
    rows = read_rows(folder)
    assert set(rows) == {"A 64/38 sirt", "A 64/38 wbp"}, rows
    for figures in rows.values():
        assert figures["wall_seconds"][0] > 0 and 5 < figures["psnr_affine_dB"][0] < 40, figures
    assert rows["A 64/38 sirt"]["estimated_MiB"][0] > 5
    for text, fact in (("[programs]\nx = \"x {stak} {output}\"", "stak"),
                       ("[programs]\nx = \"x {stack}\"", "{output}"),
                       ("[programs]\nx = 3", "no command"), ("programs", "cannot read")):
        write(config, text)
        wrong = bench_run(folder, "--table", "--config", config)
        assert wrong.returncode == 1 and fact in wrong.stderr, (text, wrong.stderr)


def test_kernels_become_a_row_a_case():
    folder = harness.fresh_directory("kernels")
    program = os.path.join(folder, "bench_kernels")
    case = {"name": "gather", "seconds": [0.002, 0.004, 0.001], "flops": 8, "bytes": 4,
            "nominal_updates": 2}
    report = {"targets": [{"target": "AVX9", "cases": [case], "ratios": {"of the bound": 0.5}}]}
    write(program, f"#!/bin/sh\ncat > \"$1\" <<'END'\n{json.dumps(report)}\nEND\n")
    os.chmod(program, 0o755)
    run = bench_run(folder, "--only", "^kernels", "--repeats", 2, "--bench-kernels", program)
    assert run.returncode == 0, run.stderr
    rows = read_rows(folder)
    assert rows["kernels AVX9"] == {"of the bound": [0.5, 0.5]}, rows
    assert rows["kernels AVX9: gather"]["seconds_a_call"] == 2 * case["seconds"]
    assert "| of the bound | 0.5 |" in run.stdout and "| gather | 2 ± 1 |" in run.stdout, run.stdout
    missing = bench_run(harness.fresh_directory("none"), "--only", "^kernels", "--bench-kernels",
                        os.path.join(folder, "none"))
    assert missing.returncode == 1 and "--only" in missing.stderr, missing.stderr


def test_the_memory_that_is_asked_for_is_read_even_if_there_is_less():
    says = "echo 'this reconstruction needs about 27.1 GiB of memory and 3.0 GiB are available' >&2"
    found = quality_rows.estimated_MiB(["/bin/sh", "-c", f"{says}; exit 2"])
    assert abs(found - 27.1 * 1024) < 1, found


def test_a_wide_series_is_the_sum_of_its_parts():
    folder = harness.fresh_directory("wide")
    run = bench_run(folder, "--only", "^wide", "--repeats", 1)
    assert run.returncode == 0, run.stderr
    figures = {name: values[0] for name, values in read_rows(folder)["wide 64x64/32"].items()}
    wide = speed_rows.QUICK.wide
    epochs = 30 * figures["epoch_of_band_core_s"] + 80 * figures["coarse_epoch_of_band_core_s"]
    start = figures["core_hours"] * 3600 * wide.rows / wide.width - epochs
    assert abs(start) < 5, (start, figures)
    series = os.path.join(folder, "phantoms/wide64x32_32_20/full.mrc")
    with mrcfile.open(series) as file:
        assert file.data.shape == (7, wide.width, wide.width)


def test_a_band_has_the_middle_rows():
    folder = harness.fresh_directory("band")
    source, band, hollow = (os.path.join(folder, name + ".mrc") for name in ("all", "band", "hollow"))
    views = np.random.default_rng(1).normal(size=(3, 20, 7)).astype(np.float32)
    harness.write_stack(source, views)
    wide_band.cut_band(source, band, 6)
    wide_band.write_hollow_copy(source, hollow)
    with mrcfile.open(band) as file:
        assert np.array_equal(file.data, views[:, 7:13])
        assert abs(float(file.voxel_size.y) - harness.PIXEL_SIZE) < 1e-4
    with mrcfile.open(hollow) as file:
        assert file.data.shape == views.shape and np.array_equal(file.data[:, 0], views[:, 0])
        assert not file.data[:, 1:].any()


def write(path, text):
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


def run_of(**figures):
    """run.json of one row."""
    return json.dumps({"rows": [{"group": "sizes", "name": "a row", "arguments": "x",
                                 "figures": figures}]})


def test_regression_tells_slower_from_noise():
    folder = harness.fresh_directory("regression")
    old, new = os.path.join(folder, "old.json"), os.path.join(folder, "new.json")
    quiet, noisy = [10.0, 10.1, 9.9], [10.0, 11.0, 9.0]
    for before, after, status, said in (
            ({"core_seconds": quiet}, {"core_seconds": [11.0, 11.1, 10.9]}, 1, "slower: a row"),
            ({"core_seconds": quiet}, {"core_seconds": [9.0, 9.1, 8.9]}, 0, "faster: a row"),
            ({"core_seconds": quiet}, {"core_seconds": [10.4, 10.4, 10.4]}, 0, "0 got worse, 0 bet"),
            ({"core_seconds": noisy}, {"core_seconds": [12.0, 13.0, 11.0]}, 0, "0 got worse, 0 bet"),
            ({"core_seconds": [10.0]}, {"core_seconds": [10.6]}, 1, "slower"),
            ({"peak_MiB": [100]}, {"peak_MiB": [111]}, 1, "larger"),
            ({"psnr_dB": [24.5]}, {"psnr_dB": [24.3]}, 1, "worse"),
            ({"psnr_dB": [24.5]}, {"psnr_dB": [24.7]}, 0, "better"),
            ({"psnr_dB": [24.5], "wall_seconds": [1]}, {"psnr_dB": [24.5], "wall_seconds": [9]}, 0,
             "1 figures compared")):
        write(old, run_of(**before))
        write(new, run_of(**after))
        found = bench("regression", old, new)
        assert found.returncode == status and said in found.stdout, (before, after, found)


def test_regression_names_a_damaged_file():
    folder = harness.fresh_directory("damaged")
    old, new = os.path.join(folder, "old.json"), os.path.join(folder, "new.json")
    good = run_of(core_seconds=[1.0])
    write(old, good)
    for text, fact in ((good[:40], "is no JSON file"), ("[]", "no list of rows"),
                       (run_of(core_seconds=[]), "'a row'"), (run_of(core_seconds="1"), "'a row'"),
                       (good.replace("1.0", "NaN"), "'a row'"),
                       (good.replace("a row", "other"), "no row in common")):
        write(new, text)
        found = bench("regression", old, new)
        assert found.returncode == 2 and fact in found.stderr, (text, found)
        assert "Traceback" not in found.stderr
    missing = bench("regression", old, os.path.join(folder, "none.json"))
    assert missing.returncode == 2 and "cannot read" in missing.stderr, missing.stderr


harness.run_tests(globals())
