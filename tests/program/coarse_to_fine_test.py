"""reconstruct's coarse stage: its options, its plan, and --resume in and after it.

usage: coarse_to_fine_test.py TOMOFIELD SCRATCH_DIR"""

import json
import os

import h5py

import harness

COARSE, FINE, SUBSETS = 40, 3, 7
OPTIONS = harness.merge(harness.QUICK, ["--leaf-size", 32, "--rank", 3, "--coarse-epochs", COARSE,
                                        "--epochs", FINE, "--subsets", SUBSETS])
series = harness.Series("series")


def command(results, *options):
    return ["reconstruct", *series.input, "-o", results.volume_path, *harness.merge(OPTIONS, options)]


def fresh_results(name):
    return harness.Results(os.path.join(harness.fresh_directory(name), "out.mrc"))


def psnr(results):
    return harness.psnr(results.volume, series.truth)


whole = fresh_results("whole")
harness.succeed(*command(whole))


def test_plan_and_figures_count_both_stages():
    plan = harness.succeed(*command(fresh_results("plan"), "--dry-run")).stdout
    assert f"{(COARSE + FINE) * SUBSETS} steps" in plan, plan
    assert f"epochs: {COARSE} of pixels 2 x 2, {FINE} at full resolution\n" in plan, plan
    with open(whole.json_path) as file:
        document = json.load(file)
    assert document["options"]["fit"]["coarse_epochs"] == COARSE
    assert [stage["bin"] for stage in document["figures"]["stages"]] == [2, 1]
    assert document["figures"]["steps"] == (COARSE + FINE) * SUBSETS
    assert len(document["figures"]["mean_squared_residual_per_noise_variance"]) == COARSE + FINE


def test_the_coarse_stage_helps():
    alone = fresh_results("alone")
    harness.succeed(*command(alone, "--coarse-epochs", 0))
    print(f"PSNR {psnr(whole):.2f} dB, {psnr(alone):.2f} dB without")
    assert psnr(whole) > psnr(alone)


def test_leaves_too_small_have_no_coarse_stage():
    result = harness.succeed(*command(fresh_results("small"), "--leaf-size", 16))
    assert "no coarse stage" in result.stderr and "--leaf-size" in result.stderr, result.stderr
    result = harness.succeed(*command(fresh_results("off"), "--coarse-epochs", 0))
    assert "no coarse stage" not in result.stderr, result.stderr


def test_faulty_options_are_refused():
    for option, value in (("--coarse-epochs", -1), ("--coarse-bin", 1), ("--coarse-bin", 65)):
        result = harness.tomofield(*command(fresh_results("faulty"), option, value))
        assert result.returncode == 2 and option in result.stderr, result


def vertices_when_stopped(results, *options):
    """Of a leaf's side, as often as a run was stopped and resumed until it was done."""
    vertices = set()

    def remember_stage():
        with h5py.File(results.model_path) as model:
            vertices.add(int(model["field/leaves/nx"][0]))

    harness.finish_with_stops(command(results, "--resume", "--threads", 1, *options),
                              remember_stage, most=60)
    return vertices


def test_runs_stopped_in_either_stage_end_alike():
    results = fresh_results("resumed")
    vertices = vertices_when_stopped(results)
    assert 17 in vertices, f"no run was caught in the coarse stage: {vertices}"
    assert results.same_as(whole)


def test_leaves_of_a_grid_are_fitted_at_a_quarter_of_the_width_first():
    grid = ["--field", "grid", "--coarse-epochs", 2 * COARSE]
    options = [word for word in harness.merge(OPTIONS, grid) if word not in ("--leaf-size", 32)]
    undisturbed = fresh_results("grid")
    harness.succeed("reconstruct", *series.input, "-o", undisturbed.volume_path, *options)
    with open(undisturbed.json_path) as file:
        document = json.load(file)
    assert document["options"]["field"]["leaf_size"] == 64
    assert document["options"]["field"]["depth"] == 0
    assert [(stage["bin"], stage["epochs"]) for stage in document["figures"]["stages"]] \
        == [(4, COARSE), (2, COARSE), (1, FINE)]
    results = fresh_results("grid_resumed")
    vertices = vertices_when_stopped(results, *grid, "--leaf-size", 64)
    assert vertices & {17, 33}, f"no run was caught in a coarse stage: {vertices}"
    assert results.same_as(undisturbed)


harness.run_tests(globals())
