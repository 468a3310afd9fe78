"""Tests the stages of reconstruct, coarse pixels and plain vertices before factors: their options,
the plan, and --resume in and after them."""

import json

import h5py
import pytest

import harness

COARSE, FINE, SUBSETS = 40, 3, 7
OPTIONS = harness.merge(harness.QUICK, ["--leaf-size", 32, "--rank", 3, "--coarse-epochs", COARSE,
                                        "--epochs", FINE, "--subsets", SUBSETS])


@pytest.fixture(scope="module")
def series():
    """Returns a small simulated series."""
    return harness.Series("series")


@pytest.fixture(scope="module", name="command")
def make_command(series):
    def command(results, *options):
        return ["reconstruct", *series.input, "-o", results.volume_path,
                *harness.merge(OPTIONS, options)]

    return command


@pytest.fixture(scope="module", name="psnr")
def make_psnr(series):
    def psnr(results):
        return harness.psnr(results.volume, series.truth)

    return psnr


@pytest.fixture(scope="module")
def whole(command):
    """Returns the results of an undisturbed run."""
    results = harness.fresh_results("whole")
    harness.succeed(*command(results))
    return results


def test_plan_and_metrics_count_both_stages(command, whole):
    plan = harness.succeed(*command(harness.fresh_results("plan"), "--dry-run")).stdout
    assert f"{(COARSE + FINE) * SUBSETS} steps" in plan, plan
    assert f"epochs: {COARSE} of pixels 2 x 2, {FINE} at full resolution\n" in plan, plan
    with open(whole.json_path) as file:
        document = json.load(file)
    assert document["options"]["fit"]["coarse_epochs"] == COARSE
    assert [stage["bin"] for stage in document["metrics"]["stages"]] == [2, 1]
    assert document["metrics"]["steps"] == (COARSE + FINE) * SUBSETS
    assert len(document["metrics"]["mean_squared_residual_per_noise_variance"]) == COARSE + FINE


def test_the_coarse_stage_helps(command, psnr, whole):
    alone = harness.fresh_results("alone")
    harness.succeed(*command(alone, "--coarse-epochs", 0))
    print(f"PSNR {psnr(whole):.2f} dB, {psnr(alone):.2f} dB without")
    assert psnr(whole) > psnr(alone)


def test_leaves_too_small_have_no_coarse_stage(command):
    result = harness.succeed(*command(harness.fresh_results("small"), "--leaf-size", 16))
    assert "no coarse stage" in result.stderr and "--leaf-size" in result.stderr, result.stderr
    result = harness.succeed(*command(harness.fresh_results("less"), "--leaf-size", 64,
                                      "--coarse-bin", 64, "--dry-run"))
    assert "at most 4 × 4 and not 64 × 64 (--coarse-bin)" in result.stderr, result.stderr
    result = harness.succeed(*command(harness.fresh_results("off"), "--coarse-epochs", 0))
    assert "no coarse stage" not in result.stderr, result.stderr


def test_faulty_options_are_refused(command):
    for option, value in (("--coarse-epochs", -1), ("--vertex-epochs", -1), ("--coarse-bin", 1),
                          ("--coarse-bin", 65)):
        result = harness.tomofield(*command(harness.fresh_results("faulty"), option, value))
        assert result.returncode == 2 and option in result.stderr, result


@pytest.fixture(scope="module", name="stages_when_stopped")
def make_stages_when_stopped(command):
    def stages_when_stopped(results, *options):
        """Stops and resumes a run until it is done, and returns (kind of field, vertices of a
        leaf's side) of every checkpoint."""
        stages = set()

        def remember_stage():
            with h5py.File(results.model_path) as model:
                field = model["field"]
                stages.add((field.attrs["kind"].decode(), int(field["leaves/nx"][0])))

        harness.finish_with_stops(command(results, "--resume", "--threads", 1, *options),
                                  remember_stage, most=60)
        return stages

    return stages_when_stopped


def test_runs_stopped_in_either_stage_end_alike(stages_when_stopped, whole):
    results = harness.fresh_results("resumed")
    stages = stages_when_stopped(results)
    assert ("vm", 17) in stages, f"no run was caught in the coarse stage: {stages}"
    assert results.same_as(whole)


VERTICES_FIRST = ["--rank", 20, "--vertex-epochs", 8, "--coarse-epochs", 10, "--epochs", 6]


@pytest.fixture(scope="module")
def with_vertices(command):
    """Returns the results of an undisturbed run that begins with plain vertices."""
    results = harness.fresh_results("vertices")
    harness.succeed(*command(results, *VERTICES_FIRST))
    return results


def metrics(results):
    with open(results.json_path) as file:
        return json.load(file)["metrics"]


def residuals(results):
    return metrics(results)["mean_squared_residual_per_noise_variance"]


def test_factors_begin_as_plain_vertices(command, psnr, with_vertices):
    plan = harness.succeed(*command(harness.fresh_results("plan"), *VERTICES_FIRST, "--dry-run")).stdout
    assert "epochs: 10 of pixels 2 x 2 with plain vertices, 8 at full resolution with plain " \
        "vertices, 6 at full resolution\n" in plan, plan
    assert [(stage["field"], stage["bin"], stage["epochs"])
            for stage in metrics(with_vertices)["stages"]] \
        == [("grid", 2, 10), ("grid", 1, 8), ("vm", 1, 6)]
    with h5py.File(with_vertices.model_path) as model:
        assert model["field"].attrs["kind"] == b"vm"
    of_factors = harness.fresh_results("factors")
    harness.succeed(*command(of_factors, "--rank", 20, "--vertex-epochs", 0, "--coarse-epochs", 10,
                             "--epochs", 14))
    print(f"PSNR {psnr(with_vertices):.2f} dB, {psnr(of_factors):.2f} dB of factors alone")
    assert psnr(with_vertices) > psnr(of_factors)


def test_factors_go_on_where_vertices_were(with_vertices):
    found = residuals(with_vertices)
    last_of_vertices, first_of_factors = found[10 + 8 - 1], found[10 + 8]
    # The optimiser restarts. Factors of rank 3 would lose most of the values and have 2.2 times.
    assert first_of_factors < 1.5 * last_of_vertices, found


def test_held_out_views_are_predicted_in_every_stage(command):
    results = harness.fresh_results("held")
    harness.succeed(*command(results, *VERTICES_FIRST, "--hold-out", 4))
    curve = metrics(results)["held_out"]["error_by_epoch"]
    assert len(curve) == 24 and curve[-1] == min(curve), curve


def test_an_early_stop_is_one_of_factors(command):
    results = harness.fresh_results("early")
    stopping = ["--hold-out", 4, "--tv", 0, "--epochs", 90, "--early-stop", 2]
    harness.succeed(*command(results, *harness.merge(VERTICES_FIRST, stopping)))
    curve = metrics(results)["held_out"]["error_by_epoch"]
    of_factors = curve[18:]
    assert min(curve) < min(of_factors), f"nothing before would have stopped it: {curve}"
    assert 3 <= len(of_factors) == 3 + of_factors.index(min(of_factors)) < 90, curve


def test_trials_of_the_penalty_are_the_same_whatever_factors_begin_with(command):
    def trials(name, *options):
        results = harness.fresh_results(name)
        harness.succeed(*command(results, "--rank", 20, "--tv-penalty", "auto", *options))
        return [(trial["tv_penalty"], trial["held_out_error"])
                for trial in metrics(results)["tuning"]["trials"]]

    vertices = ["--coarse-epochs", 8, "--vertex-epochs", 1, "--epochs", 1]  # of 10
    factors = ["--coarse-epochs", 8, "--vertex-epochs", 0, "--epochs", 3]  # of 30
    assert trials("trials", *vertices) == trials("trials_of_factors", *factors)


def test_the_usual_factors_begin_as_vertices(series):
    def epochs(*options):
        plan = harness.succeed("reconstruct", *series.input, "-o",
                               harness.fresh_results("plan").volume_path, "--thickness", harness.THICKNESS,
                               "--contrast", "bright", "--field", "vm", "--dry-run", *options).stdout
        return next(line for line in plan.splitlines() if line.startswith("epochs: "))

    vertices, factors = " with plain vertices", " at full resolution"
    assert epochs() == f"epochs: 160 of pixels 2 x 2{vertices}, 10{factors}{vertices}, 10{factors}"
    assert epochs("--epochs", 4) \
        == f"epochs: 64 of pixels 2 x 2{vertices}, 4{factors}{vertices}, 4{factors}"
    assert epochs("--vertex-epochs", 0) == f"epochs: 160 of pixels 2 x 2, 30{factors}"
    assert epochs("--rank", 8) == f"epochs: 160 of pixels 2 x 2, 30{factors}"
    assert epochs("--rank", 8, "--vertex-epochs", 3) \
        == f"epochs: 160 of pixels 2 x 2{vertices}, 3{factors}{vertices}, 10{factors}"


def test_vertices_have_no_variation_of_factors(command, with_vertices):
    results = harness.fresh_results("factor_variation")
    harness.succeed(*command(results, *VERTICES_FIRST, "--tv-factors", 5))
    assert residuals(results)[:18] == residuals(with_vertices)[:18]
    assert residuals(results)[18:] != residuals(with_vertices)[18:]


def test_runs_stopped_before_there_are_factors_end_alike(stages_when_stopped, with_vertices):
    results = harness.fresh_results("vertices_resumed")
    stages = stages_when_stopped(results, *VERTICES_FIRST)
    assert stages & {("grid", 17), ("grid", 33)}, f"no run was caught with vertices: {stages}"
    assert results.same_as(with_vertices)


def test_leaves_of_a_grid_are_fitted_at_a_quarter_of_the_width_first(series, stages_when_stopped):
    grid = ["--field", "grid", "--coarse-epochs", 2 * COARSE]
    options = [word for word in harness.merge(OPTIONS, grid) if word not in ("--leaf-size", 32)]
    undisturbed = harness.fresh_results("grid")
    harness.succeed("reconstruct", *series.input, "-o", undisturbed.volume_path, *options)
    with open(undisturbed.json_path) as file:
        document = json.load(file)
    assert document["options"]["field"]["leaf_size"] == 64
    assert document["options"]["field"]["depth"] == 0
    assert [(stage["bin"], stage["epochs"]) for stage in document["metrics"]["stages"]] \
        == [(4, COARSE), (2, COARSE), (1, FINE)]
    results = harness.fresh_results("grid_resumed")
    stages = stages_when_stopped(results, *grid, "--leaf-size", 64)
    assert stages & {("grid", 17), ("grid", 33)}, f"no run was caught in a coarse stage: {stages}"
    assert results.same_as(undisturbed)
