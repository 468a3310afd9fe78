"""Tests bench/run, bench/regression, bench/methods and bench/scaling: they measure, keep and gather
rows, and find those that got slower."""

import argparse
import glob
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


def bench(name, *arguments, **keywords):
    return subprocess.run(["/usr/bin/python3", os.path.join(BENCH, name), *map(str, arguments)],
                          capture_output=True, text=True, **keywords)


def bench_run(folder, *arguments):
    return bench("run", folder, "--program", harness.PROGRAM, "--quick", *arguments)


def read_json(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def read_rows(folder):
    run = read_json(os.path.join(folder, "run.json"))
    return {row["name"]: row["figures"] for row in run["rows"]}


def write(path, text):
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


def write_program(path, script):
    write(path, "#!/bin/sh\n" + script)
    os.chmod(path, 0o755)


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
    version = harness.succeed("--version").stdout
    (commit,) = read_json(os.path.join(folder, "run.json"))["commits"]
    assert version.startswith("tomofield ") and version.endswith(f" ({commit})\n"), version
    table = bench_run(folder, "--table", "--repeats", 2)
    assert table.stdout == again.stdout and table.stderr == "", table.stderr
    assert "| rank | 48x48/24, 11 views, rank 8 | " in table.stdout, table.stdout


def test_another_program_is_run_beside_ours():
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
    report = {"commit": "abc1234",
              "targets": [{"target": "AVX9", "cases": [case], "ratios": {"of the bound": 0.5}}]}
    write_program(program, f"cat > \"$1\" <<'END'\n{json.dumps(report)}\nEND\n")
    run = bench_run(folder, "--only", "^kernels", "--repeats", 2, "--bench-kernels", program)
    assert run.returncode == 0, run.stderr
    rows = read_rows(folder)
    assert rows["kernels AVX9"] == {"of the bound": [0.5, 0.5]}, rows
    assert rows["kernels AVX9: gather"]["seconds_a_call"] == 2 * case["seconds"]
    assert "| of the bound | 0.5 |" in run.stdout and "| gather | 2 ± 1 |" in run.stdout, run.stdout
    assert "; commit abc1234;" in run.stdout, run.stdout  # not that of tomofield
    path = os.path.join(folder, "run/kernels_2.json")
    other = read_json(path)
    other["machine"]["cpu"] = "A second machine"
    write(path, json.dumps(other))
    table = bench_run(folder, "--table", "--repeats", 2)
    assert len(read_json(os.path.join(folder, "run.json"))["machines"]) == 2
    assert "A second machine, " in table.stdout and "; " in table.stdout.splitlines()[0], table.stdout
    missing = bench_run(harness.fresh_directory("none"), "--only", "^kernels", "--bench-kernels",
                        os.path.join(folder, "none"))
    assert missing.returncode == 1 and "--only" in missing.stderr, missing.stderr


def test_the_memory_that_is_asked_for_is_read_even_if_there_is_less():
    says = "echo 'this reconstruction needs about 27.1 GiB of memory and 3.0 GiB are available' >&2"
    found = quality_rows.dry_run(["/bin/sh", "-c", f"{says}; exit 2"])
    assert set(found) == {"MiB"} and abs(found["MiB"] - 27.1 * 1024) < 1, found


def test_a_wide_series_is_measured_by_a_band():
    folder = harness.fresh_directory("wide")
    run = bench_run(folder, "--only", "^wide", "--repeats", 1)
    assert run.returncode == 0, run.stderr
    figures = {name: values[0] for name, values in read_rows(folder)["wide 64x64/32"].items()}
    assert figures["estimated_of_whole_MiB"] >= figures["estimated_of_band_MiB"] > 5, figures
    assert figures["peak_of_band_MiB"] > 5, figures
    series = os.path.join(folder, "phantoms/wide64x32_32_20/full.mrc")
    with mrcfile.open(series) as file:
        assert file.data.shape == (7, 64, 64)


def option_of(command, option, default):
    return int(command[command.index(option) + 1]) if option in command else default


def test_a_wide_series_is_the_sum_of_its_parts(monkeypatch):
    wide = speed_rows.WideSeries(width=64, rows=16, timed_epochs=2, timed_coarse_epochs=4)

    def epochs(command, full=25, coarse=60):  # as defaults of reconstruct
        return option_of(command, "--epochs", full), option_of(command, "--coarse-epochs", coarse)

    def run_measured(command):
        full, coarse = epochs(command)
        return quality_rows.Usage(7 + 3 * full + 0.5 * coarse, 100 + full,
                                  15 + 6 * full + coarse)

    monkeypatch.setattr(speed_rows, "run_measured", run_measured)
    monkeypatch.setattr(quality_rows, "dry_run",
                        lambda command: {"MiB": 300, "steps": 11 * sum(epochs(command))})
    monkeypatch.setattr(wide_band, "band_series", lambda *_: "folder")
    monkeypatch.setattr(wide_band, "estimate_of_whole", lambda *_: 900)
    options = argparse.Namespace(program="tomofield")
    rows = speed_rows.measure_wide(options, wide, "wide", "scratch")["wide"]
    hours = 4 / 3600  # of as many bands
    expected = {"peak_of_band_MiB": 103, "estimated_of_band_MiB": 300, "estimated_of_whole_MiB": 900,
                "epoch_of_band_core_s": 3, "coarse_epoch_of_band_core_s": 0.5,
                "core_hours": (7 + 25 * 3 + 60 * 0.5) * hours,
                "epoch_of_band_wall_s": 6, "coarse_epoch_of_band_wall_s": 1,
                "wall_hours": (15 + 25 * 6 + 60) * hours}
    assert set(rows) == set(expected), rows
    for name, value in expected.items():
        assert len(rows[name]) == 1 and abs(rows[name][0] - value) < 1e-9, (name, rows)


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


def run_of(arguments="x", **figures):
    """Returns a run.json of two rows; `arguments` are those of the second."""
    return json.dumps({"rows": [{"group": "sizes", "name": "a row", "arguments": "x",
                                 "figures": figures},
                                {"group": "sizes", "name": "another", "arguments": arguments,
                                 "figures": {"wall_seconds": [1]}}]})


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
            ({"peak_of_band_MiB": [100]}, {"peak_of_band_MiB": [111]}, 1, "larger"),
            ({"psnr_dB": [24.5]}, {"psnr_dB": [24.3]}, 1, "worse"),
            ({"psnr_dB": [24.5]}, {"psnr_dB": [24.7]}, 0, "better"),
            ({"psnr_dB": [24.5], "wall_seconds": [1]}, {"psnr_dB": [24.5], "wall_seconds": [9]}, 0,
             "1 figures compared")):
        write(old, run_of(**before))
        write(new, run_of(**after))
        found = bench("regression", old, new)
        assert found.returncode == status and said in found.stdout, (before, after, found)


def test_regression_names_what_has_no_partner():
    folder = harness.fresh_directory("unpaired")
    old, new = os.path.join(folder, "old.json"), os.path.join(folder, "new.json")
    write(old, run_of("--epochs 4", psnr_dB=[24.5]))
    write(new, run_of("--epochs 5", psnr_dB=[24.5]))
    found = bench("regression", old, new)
    assert found.returncode == 0, found
    assert found.stdout.splitlines()[:2] == [f"only in {old}: another: --epochs 4",
                                             f"only in {new}: another: --epochs 5"], found.stdout


def write_row(folder, size, iterations, psnr):
    """Writes a row of bench/methods of `baseline sirt`."""
    arguments = f"baseline sirt --iterations {iterations}"
    os.makedirs(os.path.join(folder, "methods"), exist_ok=True)
    write(os.path.join(folder, "methods",
                       f"A_0.01_sirt_{arguments.replace(' ', '_')}_{size}_101.json"),
          json.dumps({"arguments": arguments, "core_seconds": 400,
                      "scores": {"psnr_raw_dB": psnr, "ssim_raw": 0.5}}))


def test_methods_go_on_from_settings_that_were_kept_off_the_usual_start():
    folder = harness.fresh_directory("methods")
    for iterations, psnr in ((57, 20.0), (80, 22.0), (113, 21.0)):  # without the usual 40
        write_row(folder, 48, iterations, psnr)
    only = ["--only", "^A 0.01 sirt", "--budget", 0]  # one row
    table = bench("methods", folder, "--size", 48, "--table", *only)
    assert "| sirt | iterations 80 | 22.00 | " in table.stdout, table
    assert "| – | 1.2e+03 | – |" in table.stdout, table.stdout  # of all three
    # The table shows a climb from the default start if there is one.
    write_row(folder, 48, 40, 19.0)
    table = bench("methods", folder, "--size", 48, "--table", *only)
    assert "| sirt | iterations 40 | 19.00 | " in table.stdout, table
    run = bench("methods", folder, "--size", 32, "--start-from", 48, "--program", harness.PROGRAM,
                *only)
    assert run.returncode == 0, run.stderr
    rows = glob.glob(os.path.join(folder, "methods/*_32_101.json"))
    assert [os.path.basename(row) for row in rows] == [
        "A_0.01_sirt_baseline_sirt_--iterations_80_32_101.json"], rows


def test_scaling_keeps_whole_rows_of_the_same_arguments():
    folder = harness.fresh_directory("scaling")
    process = {"bands": 4, "seconds_computing": 1.6, "bytes_sent_per_step": 2000}
    figures = {"steps": 16, "views": 96 * [0], "parameters": 1, "processes": 4 * [process]}
    runs, broken = os.path.join(folder, "runs"), os.path.join(folder, "broken")
    write_program(os.path.join(folder, "tomofield"), f"""
[ "$1" = simulate ] && exit
[ -e {broken} ] && echo 'there is no memory' >&2 && exit 2
echo >> {runs}
while [ "$1" != -o ]; do shift; done
echo '{json.dumps({"metrics": figures})}' > "${{2%.mrc}}.json"
""")
    write_program(os.path.join(folder, "mpirun"), "shift 2\nexec \"$@\"\n")

    def scaling(*options):
        return bench("scaling", folder, "--program", os.path.join(folder, "tomofield"), "--only",
                     "^grid 128", "--repeats", 1, *options, env={**os.environ, "PATH": f"{folder}:{os.environ['PATH']}"})

    write(broken, "")
    failed = scaling()
    assert failed.returncode == 1 and "there is no memory" in failed.stderr, failed
    assert not glob.glob(os.path.join(folder, "scaling/*.json*"))
    os.remove(broken)
    first = scaling()
    assert first.returncode == 0, first
    assert "| grid 128/75 | 4 | 25.0 | 100 / 100 / 100 |" in first.stdout, first
    assert scaling("--table").stdout == scaling().stdout == first.stdout
    assert len(harness.read_bytes(runs)) == 3
    path = os.path.join(folder, "scaling/grid_128_75_2.json")
    write(path, json.dumps({**read_json(path), "arguments": "other ones"}))
    assert scaling().stdout == first.stdout and len(harness.read_bytes(runs)) == 4


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
