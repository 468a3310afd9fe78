"""Tests evaluate against scikit-image and plain numpy."""

import json
import os
import re
import signal
import struct
import subprocess

import mrcfile
import numpy as np
import scipy.ndimage
import skimage.io
from skimage.metrics import structural_similarity

import harness

SEAM = os.path.abspath(os.path.join(os.path.dirname(__file__), "../../bench/seam.py"))


def path(name):
    return os.path.join(harness.SCRATCH, name)


def save(name, volume, voxel_size=10.0, origin=(0, 0, 0), label=None):
    with mrcfile.new(path(name), overwrite=True) as file:
        file.set_data(volume.astype(np.float32))
        file.set_volume()
        file.voxel_size = voxel_size
        file.header.origin = origin
        if label:
            file.header.label[0], file.header.nlabl = label, 1
    return path(name)


def run(*arguments):
    return harness.tomofield("evaluate", *arguments)


def evaluate(*arguments):
    """Returns the metrics of one comparison, and the run with its output."""
    result = run(*arguments, "--json", path("score.json"), "--overwrite")
    assert result.returncode == 0, result.stderr
    return json.load(open(path("score.json"))), result


def expected_score(reconstruction, truth):
    """Returns the scores as numpy and scikit-image give them."""
    peak = truth.max() - min(0, truth.min())
    x, y = reconstruction.astype(np.float64) / peak, truth.astype(np.float64) / peak
    covariance = np.cov(x.ravel(), y.ravel(), bias=True)
    scale = covariance[0, 1] / covariance[0, 0]
    fitted = scale * x + y.mean() - scale * x.mean()

    def decibels(image):
        return -10 * np.log10(np.mean((image - y) ** 2))

    return {
        "psnr_raw_dB": decibels(x),
        "psnr_affine_dB": decibels(fitted),
        "ssim_raw": structural_similarity(y, x, data_range=1.0),
        "ssim_affine": structural_similarity(y, fitted, data_range=1.0),
        "correlation": covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1]),
        "scale": scale,
        "offset": peak * (y.mean() - scale * x.mean()),
        "peak": peak,
    }


def check_score(score, expected):
    for name, value in expected.items():
        tolerance = 1e-3 if "psnr" in name else 1e-5
        assert abs(score[name] - value) < tolerance, (name, score[name], value)


def random_pair(shape, seed):
    random = np.random.default_rng(seed)
    truth = scipy.ndimage.gaussian_filter(random.normal(size=shape), 1.5)
    truth = (truth - truth.min()) / (truth.max() - truth.min()) - 0.1
    reconstruction = 0.6 * truth + 0.2 + 0.03 * random.normal(size=shape)
    return reconstruction.astype(np.float32), truth.astype(np.float32)


def test_opposite_contrast_is_said():
    truth = np.random.default_rng(3).random((12, 16, 16))
    files = [save(name, volume) for name, volume in (
        ("inverted.mrc", 2 - 3 * truth), ("same.mrc", truth + 1),
        ("other.mrc", np.random.default_rng(4).random(truth.shape)), ("truth_3.mrc", truth))]
    for file in files[:3]:
        said = run(file, files[3])
        assert said.returncode == 0, said.stderr
        assert ("opposite contrast" in said.stdout) == (file == files[0]), said.stdout


def test_random_volumes_against_scikit_image():
    for seed, shape in enumerate([(20, 64, 50), (7, 41, 33), (31, 7, 90)]):
        reconstruction, truth = random_pair(shape, seed)
        score, _ = evaluate(save("a.mrc", reconstruction), save("b.mrc", truth))
        check_score(score, expected_score(reconstruction, truth))


def test_phantom_against_scikit_image():
    directory = path("phantom")
    options = ["--size", "64", "--thickness", "40", "--tilts", "0:0:1"]
    harness.succeed("simulate", directory, *options)
    truth = mrcfile.read(os.path.join(directory, "truth.mrc"))
    blurred = scipy.ndimage.gaussian_filter(truth, (3, 1, 1)) * 0.8 + 0.05
    score, result = evaluate(save("a.mrc", blurred), os.path.join(directory, "truth.mrc"))
    check_score(score, expected_score(blurred, truth))
    assert "64 × 64 × 40" in result.stdout and "PSNR" in result.stdout
    assert "%.3f" % score["psnr_affine_dB"] in result.stdout


def centred_part(volume, shape):
    """Returns the part of this shape in the middle of a volume."""
    starts = [(n - k) // 2 for n, k in zip(volume.shape, shape)]
    return volume[tuple(slice(first, first + k) for first, k in zip(starts, shape))]


def test_volumes_of_different_sizes_are_compared_on_their_common_centre():
    # The sizes differ on every axis, by odd numbers in both directions.
    reconstruction, truth = random_pair((24, 60, 51), 5)
    for a, b in (
        (reconstruction, truth),
        (reconstruction[:, 3:, :], truth[1:-2]),
        (reconstruction[2:-1], truth[:, 1:-4, 1:]),
    ):
        score, _ = evaluate(save("a.mrc", a), save("b.mrc", b))
        shape = np.minimum(a.shape, b.shape)
        check_score(score, expected_score(centred_part(a, shape), centred_part(b, shape)))
        box = np.array(score["box_last"]) - score["box_first"]
        assert list(box[::-1]) == list(shape), (box, shape)


def test_box_is_in_voxels_of_the_truth():
    reconstruction, truth = random_pair((24, 60, 51), 6)
    truth[5, 5, 5] = 9  # outside the box: it must not become the peak
    files = save("a.mrc", reconstruction[:, 2:-2, :]), save("b.mrc", truth)
    score, _ = evaluate(*files, "--box", "10,12,6,40,50,20")
    part = (slice(6, 20), slice(12, 50), slice(10, 40))
    check_score(score, expected_score(reconstruction[part], truth[part]))
    assert score["box_first"] == [10, 12, 6] and score["box_last"] == [40, 50, 20]
    for box in ("0,0,0,51,60,24", "10,12,6,10,50,20", "-1,12,6,20,50,20", "10,12,6,52,50,20"):
        result = run(*files, "--box", box)
        assert result.returncode == 2 and "box" in result.stderr, (box, result)


def test_voxels_that_are_no_cubes_are_refused():
    _, truth = random_pair((10, 20, 30), 9)
    cubes, flat = save("cubes.mrc", truth), save("flat.mrc", truth)
    with mrcfile.open(flat, "r+") as file:
        file.voxel_size = (10, 10, 40)
    for words in ((cubes, flat), (flat, cubes), (cubes, "--fsc", flat)):
        result = run(*words)
        assert result.returncode == 2 and "10 × 10 × 40 Å" in result.stderr, result


def test_a_turned_box_has_no_place():
    """Its ORIGIN is 0, which is no place of it."""
    _, series = simulate("turned", 24)
    model = path("turned.mrc")
    harness.succeed("reconstruct", series[1], *series[2:], "--thickness", 24, "--no-margin", "--epochs", 1,
                    "--coarse-epochs", 2, "--tv", 5, "--prior", "tv", "-o", model)
    box = path("turned_box.mrc")
    harness.succeed("export", model[:-4] + ".h5", "-o", box, "--center", "30,30,12", "--size", "20,20,20",
                    "--rotate", "0,0,1")
    other = path("upright_box.mrc")
    harness.succeed("export", model[:-4] + ".h5", "-o", other, "--center", "30,30,12", "--size", "20,20,20")
    said = run(box, other)
    assert said.returncode == 0 and "turned before it was sampled" in said.stderr, said
    assert "placed by their ORIGINs" not in said.stderr
    # It is no projection of the views, and has no leaves where those of the model are.
    turned = path("turned_whole.mrc")
    harness.succeed("export", model[:-4] + ".h5", "-o", turned, "--level", "10,0")
    said = run(turned, *series, "--no-margin")
    assert said.returncode == 2 and "was turned before it was sampled" in said.stderr, said
    said = run(turned, "--model", model[:-4] + ".h5")
    assert said.returncode == 2 and "was turned, or is another part" in said.stderr, said


def test_values_that_their_mode_cannot_hold_are_warned_of():
    """The header states the values that another program meant to write."""
    for mode, largest in (("int8", 255), ("int16", 51000)):
        file = path("wrapped.mrc")
        values = np.random.default_rng(3).integers(-90, 90, (10, 20, 30)).astype(mode)
        with mrcfile.new(file, values, overwrite=True) as volume:
            volume.set_volume()
            volume.voxel_size = 10
            volume.header.dmin, volume.header.dmax = 0, largest
        if mode == "int8":  # IMOD's stamp, and its flag for bytes with a sign
            with open(file, "r+b") as bytes_of_file:
                bytes_of_file.seek(152)
                bytes_of_file.write(struct.pack("<ii", 1146047817, 1))
        for command in (["evaluate", file, file], ["info", file]):
            said = harness.succeed(*command)
            assert f"from 0 to {largest}" in said.stderr and "misread" in said.stderr, said


def test_membranes_need_voxels_that_can_be():
    """The filter would blur over twenty thousand voxels."""
    label = np.zeros((10, 20, 30), np.float32)
    label[5] = 1
    file = save("tiny_voxels.mrc", label, voxel_size=0.002)
    result = run(file, "--membranes", file)
    assert result.returncode == 2 and "voxels of 0.002 Å" in result.stderr, result


def test_equal_volumes_are_infinitely_alike():
    _, truth = random_pair((10, 20, 30), 7)
    file = save("a.mrc", truth)
    score, result = evaluate(file, file)
    assert score["psnr_raw_dB"] is None and score["ssim_raw"] == 1 and "inf" in result.stdout


def test_origins_say_where_a_part_lies():
    reconstruction, truth = random_pair((24, 60, 51), 8)
    whole = save("whole.mrc", truth, label="tomofield 1")
    expected = evaluate(save("all.mrc", reconstruction), whole, "--box", "7,5,3,20,15,13")[0]
    part = reconstruction[3:13, 5:15, 7:20]
    found, _ = evaluate(save("part.mrc", part, origin=(70, 50, 30)), whole)
    assert found["box_first"] == [7, 5, 3] and found["box_last"] == [20, 15, 13], found
    assert found["psnr_raw_dB"] == expected["psnr_raw_dB"]
    # The whole is compared with the part.
    found, _ = evaluate(whole, save("part.mrc", part, origin=(70, 50, 30)))
    assert found["box_first"] == [0, 0, 0] and found["box_last"] == [13, 10, 10], found
    # Volumes that tomofield wrote share a corner. Others share the centre, with a warning.
    corner = reconstruction[:, :40, :]
    found, _ = evaluate(save("corner.mrc", corner, label="tomofield 1"), whole)
    assert found["box_last"] == [51, 40, 24], found
    found, result = evaluate(save("corner.mrc", corner), whole)
    assert found["box_first"] == [0, 10, 0] and "centred" in result.stdout + result.stderr, found
    # Volumes of one size that tomofield wrote do not lie on each other elsewhere.
    left, right = (save(name, reconstruction, label="tomofield 1", origin=origin)
                   for name, origin in (("left.mrc", (0, 0, 0)), ("right.mrc", (510, 0, 0))))
    result = run(left, right)
    assert result.returncode == 2 and "51, 0, 0 voxels" in result.stderr, result
    between = save("between.mrc", reconstruction, label="tomofield 1", origin=(85, 0, 0))
    result = run(left, between)
    assert result.returncode == 2 and "8.5 voxels" in result.stderr, result
    mask = save("mask_elsewhere.mrc", np.ones_like(truth), label="tomofield 1", origin=(120, 0, 0))
    result = run(left, "--fsc", whole, "--fsc-mask", mask)
    assert result.returncode == 2 and "lies elsewhere" in result.stderr, result
    with open(path("particles.star"), "w", encoding="utf-8") as file:
        file.write("data_particles\nloop_\n_rlnCoordinateX\n_rlnCoordinateY\n_rlnCoordinateZ\n"
                   "_tomofieldParticleKind\n1 2 3 ball\n")
    save("particle_ball.mrc", np.ones((4, 4, 4)))
    result = run(right, "--particles", path("particles.star"))
    assert result.returncode == 2 and "a part of a volume" in result.stderr, result
    # ORIGINs of other programs do not place volumes of one size, which is said.
    _, result = evaluate(save("left.mrc", reconstruction), save("right.mrc", truth, origin=(80, 0, 0)))
    assert "begins 8, 0, 0 voxels after" in result.stderr, result
    # A nonsensical ORIGIN is ignored.
    found, _ = evaluate(save("corner.mrc", corner, origin=(3, 4, 1e30)), whole)
    assert found["box_first"] == [0, 10, 0], found
    # ORIGINs that make neither a part of the other are set aside, which is said.
    found, result = evaluate(save("corner.mrc", corner, origin=(-20, 30, 0)), whole)
    assert found["box_first"] == [0, 10, 0] and "their ORIGINs make none a part" in result.stderr, result


def test_particles_of_other_programs_are_no_positions_of_simulate():
    """What would move or select them is refused."""
    volume = save("plain.mrc", np.random.default_rng(1).random((24, 24, 24)))
    save("particle_ball.mrc", np.ones((4, 4, 4)))

    def refusal(column, values):
        with open(path("others.star"), "w", encoding="utf-8") as file:
            file.write("data_particles\nloop_\n_rlnCoordinateX\n_rlnCoordinateY\n_rlnCoordinateZ\n"
                       "_tomofieldParticleKind\n" + column + "\n"
                       + "".join(f"12 12 {12 + i} ball {value}\n" for i, value in enumerate(values)))
        result = run(volume, "--particles", path("others.star"))
        return result.stderr if result.returncode == 2 else result.returncode

    assert refusal("_rlnOriginXAngst", [0, 0]) == 0
    assert "_rlnOriginXAngst" in refusal("_rlnOriginXAngst", [0, 200])
    assert refusal("_rlnTomoName", ["TS_1", "TS_1"]) == 0
    elsewhere = save("elsewhere.mrc", np.random.default_rng(1).random((24, 24, 24)), origin=(80, 0, 0))
    assert "by another program" in run(elsewhere, "--particles", path("others.star")).stderr
    assert "several tomograms" in refusal("_rlnTomoName", ["TS_1", "TS_2"])


def test_hopeless_pairs_are_refused():
    reconstruction, truth = random_pair((24, 60, 51), 8)
    good = save("good.mrc", truth)
    broken = reconstruction.copy()
    broken[3, 4, 5] = np.nan
    for file, words in (
        (save("turned.mrc", reconstruction.transpose(1, 0, 2)), "--axes"),
        (save("binned.mrc", reconstruction, voxel_size=20), "20 Å"),
        (save("small.mrc", reconstruction[:, ::3, ::3]), "half"),
        (save("broken.mrc", broken), "1 of the reconstruction"),
        (path("absent.mrc"), "absent.mrc"),
    ):
        result = run(file, good, "--json", path("none.json"))
        assert result.returncode == 2 and words in result.stderr, (words, result)
        assert not os.path.exists(path("none.json"))
    result = run(good, save("small.mrc", reconstruction[:, ::3, ::3]))
    assert result.returncode == 2 and "half" in result.stderr, result
    flat = save("flat.mrc", np.zeros((24, 60, 51)))
    assert run(good, flat).returncode == 2
    thin = save("thin.mrc", truth[:5])
    result = run(thin, thin)
    assert result.returncode == 2 and "7 voxels" in result.stderr


def test_existing_metrics_are_kept_unless_asked():
    _, truth = random_pair((10, 20, 30), 9)
    file = save("a.mrc", truth)
    with open(path("kept.json"), "w") as kept:
        kept.write("mine")
    result = run(file, file, "--json", path("kept.json"))
    assert result.returncode == 2 and "--overwrite" in result.stderr
    assert open(path("kept.json")).read() == "mine"


def simulate(name, thickness, *options, tilts="-60:60:6"):
    """Returns a cell's truth and the options that hand its tilt series to evaluate."""
    directory = path(name)
    harness.succeed("simulate", directory, "--size", 48, "--thickness", thickness, "--noise", 0.05,
                    "--tilts=" + tilts, *options)
    series = [os.path.join(directory, "tilt_series.mrc"), "--contrast", "bright", "--tlt",
              os.path.join(directory, "tilt_series.tlt")]
    return os.path.join(directory, "truth.mrc"), ["--series", *series]


def frequencies(shape):
    """Returns kz, ky, kx of each Fourier voxel in cycles a voxel."""
    return np.meshgrid(*[np.fft.fftfreq(n, 1 / n).round() / n for n in shape], indexing="ij")


def wedge(shape, low, high):
    """Returns the Fourier voxels that views from low to high degrees measure (x = X cos + Z
    sin)."""
    kz, _, kx = frequencies(shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.degrees(np.arctan(kz / kx))
    return ((angle >= low) & (angle <= high)) | ((kx == 0) & (kz == 0))


def soft_edges(shape):
    window = np.ones(shape)
    for axis, n in enumerate(shape):
        depth = np.minimum(np.arange(n), np.arange(n)[::-1]) + 0.5
        factor = np.sin(np.pi / 2 * np.minimum(1, depth / (n / 8))) ** 2
        window *= factor.reshape([-1 if a == axis else 1 for a in range(3)])
    return window


def expected_fsc(first, second, weights, chosen):
    """Returns correlation and number of chosen Fourier voxels of shells 1 to half the longest
    axis."""
    spectra = []
    for volume in (first.astype(np.float64), second.astype(np.float64)):
        spectra.append(np.fft.fftn(weights * (volume - np.average(volume, weights=weights))))
    longest = max(first.shape)
    radius = np.sqrt(sum(k**2 for k in reversed(frequencies(first.shape))))
    shell = np.floor(radius * longest + 0.5).astype(int)
    curve, count = [], []
    for s in range(1, longest // 2 + 1):
        a, b = (spectrum[(shell == s) & chosen] for spectrum in spectra)
        count.append(a.size)
        power = np.sum(abs(a) ** 2) * np.sum(abs(b) ** 2)
        curve.append(np.sum(a * b.conj()).real / np.sqrt(power) if a.size else np.nan)
    return np.array(curve), count


def as_floats(values):
    return np.array([np.nan if v is None else v for v in values], dtype=float)


def check_curve(found, expected):
    curve, count = expected
    assert found["voxels"] == count
    np.testing.assert_allclose(as_floats(found["correlation"]), curve, atol=2e-5)


def expected_crossing(curve, frequency, threshold):
    known = ~np.isnan(curve)
    curve, frequency = curve[known], frequency[known]
    below = np.flatnonzero(curve < threshold)
    if below.size == 0 or below[0] == 0:
        return None
    i = below[0]
    # np.interp needs ascending values, and the curve falls between the two shells.
    return 1 / np.interp(threshold, curve[[i, i - 1]], frequency[[i, i - 1]])


def half_volumes(shape, seed, tilts):
    """Returns two halves that share a structure below a resolution and within the tilts, with
    noise."""
    random = np.random.default_rng(seed)
    kz, ky, kx = frequencies(shape)
    fall = np.exp(-60 * (kz**2 + ky**2 + kx**2)) * np.where(wedge(shape, *tilts), 1, 0.05)
    signal = np.fft.ifftn(np.fft.fftn(random.normal(size=shape)) * fall).real
    noise = 0.5 * signal.std()
    return [(signal + noise * random.normal(size=shape)).astype(np.float32) for _ in range(2)]


def test_fsc_against_numpy():
    tilts = (-60, 35)  # not alike, so that the sign of the tilts shows
    for seed, shape in enumerate([(20, 48, 30), (33, 27, 45), (40, 16, 40)]):
        first, second = half_volumes(shape, seed, tilts)
        files = [save("a.mrc", first, 7.5), "--fsc", save("b.mrc", second, 7.5)]
        score, result = evaluate(*files, "--tilt-range=%g,%g" % tilts)
        fsc, inside = score["fsc"], wedge(shape, *tilts)
        frequency = np.array(fsc["frequency_per_A"])
        np.testing.assert_allclose(frequency, np.arange(1, max(shape) // 2 + 1) / max(shape) / 7.5)
        for name, chosen in (("all", inside | True), ("measured", inside), ("missing", ~inside)):
            expected = expected_fsc(first, second, soft_edges(shape), chosen)
            check_curve(fsc[name], expected)
            for threshold in (0.5, 0.143):
                crossing = expected_crossing(expected[0], frequency, threshold)
                found = fsc[name][f"resolution_at_{threshold}_A"]
                assert (found is None) == (crossing is None), (name, threshold, found, crossing)
                if crossing:
                    assert abs(found - crossing) < 1e-2, (name, threshold, found, crossing)
                    assert "%.4g Å" % found in result.stdout
        assert fsc["measured"]["resolution_at_0.5_A"] is not None
        assert np.nanmean(as_floats(fsc["missing"]["correlation"])) < np.nanmean(
            as_floats(fsc["measured"]["correlation"]))
        # Mirrored tilts put other Fourier voxels in the wedge.
        mirrored, _ = evaluate(*files, "--tilt-range=%g,%g" % (-tilts[1], -tilts[0]))
        assert mirrored["fsc"]["measured"]["correlation"] != fsc["measured"]["correlation"]
        np.testing.assert_allclose(mirrored["fsc"]["all"]["correlation"], fsc["all"]["correlation"])


def test_the_wedge_is_where_no_view_looked():
    # A reconstruction from tilts of mostly one sign knows what these views measured.
    truth, series = simulate("lopsided", 24, tilts="-60:10:5")
    volume = path("sirt.mrc")
    harness.succeed("baseline", "sirt", *series[1:], "--thickness", 24, "--no-margin",
                    "--iterations", 15, "-o", volume)

    def mean_correlation(tilts):
        fsc = evaluate(volume, "--fsc", truth, "--tilt-range=" + tilts)[0]["fsc"]
        return [np.mean(fsc[name]["correlation"][4:16]) for name in ("measured", "missing")]

    measured, missing = mean_correlation("-60,10")
    mirrored_measured, mirrored_missing = mean_correlation("-10,60")
    assert measured > mirrored_measured + 0.1 and missing < mirrored_missing - 0.1, (
        measured, missing, mirrored_measured, mirrored_missing)


def test_a_correlation_that_begins_low_falls_at_once():
    """One shell above a threshold does not make it fall later, or never."""
    rng = np.random.default_rng(2)
    pair = [save(name, rng.normal(size=(32, 32, 32))) for name in ("noise_a.mrc", "noise_b.mrc")]
    said = run(pair[0], "--fsc", pair[1]).stdout
    line = next(line for line in said.splitlines() if line.startswith("everywhere"))
    assert line.split() == ["everywhere", "at", "once", "at", "once"], said


def test_fsc_under_a_mask_and_in_a_box():
    shape = (24, 30, 36)
    first, second = half_volumes(shape, 5, (-90, 90))
    z, y, x = np.indices(shape)
    mask = np.clip(12 - np.hypot(np.hypot(z - 11, y - 16), x - 15), 0, 1).astype(np.float32)
    files = [save("a.mrc", first), "--fsc", save("b.mrc", second)]
    masked, _ = evaluate(*files, "--fsc-mask", save("mask.mrc", mask))
    everything = np.full(shape, True)
    check_curve(masked["fsc"]["all"], expected_fsc(first, second, mask, everything))
    part = (slice(2, 22), slice(3, 27), slice(5, 33))
    boxed, _ = evaluate(*files, "--fsc-mask", path("mask.mrc"), "--box", "5,3,2,33,27,22")
    check_curve(boxed["fsc"]["all"],
                expected_fsc(first[part], second[part], mask[part], everything[part]))
    assert "psnr_raw_dB" not in boxed and boxed["fsc"]["box_first"] == [5, 3, 2]
    for mask_file, words in ((save("m.mrc", 2 * mask), "from 0 to 1"),
                             (save("m2.mrc", mask[1:]), "36 × 30 × 23"),
                             (save("m4.mrc", mask, voxel_size=20), "20 Å"),
                             (save("m5.mrc", np.where(mask > 0.9, np.nan, mask)), "NaN"),
                             (save("m3.mrc", 0 * mask), "not all be 0")):
        result = run(*files, "--fsc-mask", mask_file)
        assert result.returncode == 2 and words in result.stderr, result
    _, said = evaluate(*files, "--fsc-mask", save("m6.mrc", mask, voxel_size=10.3))
    assert "the voxel sizes differ, the mask" in said.stderr and "10.3 Å" in said.stderr, said.stderr


def test_fsc_table_and_picture():
    first, second = half_volumes((20, 32, 32), 6, (-50, 50))
    files = [save("a.mrc", first), "--fsc", save("b.mrc", second), "--tilt-range=-50,50"]
    score, _ = evaluate(*files, "--fsc-csv", path("fsc.csv"), "--fsc-picture", path("fsc.png"))
    table = np.genfromtxt(path("fsc.csv"), delimiter=",", names=True)
    fsc = score["fsc"]
    np.testing.assert_allclose(table["frequency_per_A"], fsc["frequency_per_A"], rtol=1e-6)
    np.testing.assert_allclose(table["resolution_A"], 1 / table["frequency_per_A"], rtol=1e-4)
    for column, name in (("fsc", "all"), ("fsc_measured", "measured"), ("fsc_missing", "missing")):
        np.testing.assert_allclose(table[column], as_floats(fsc[name]["correlation"]), atol=1e-6)
    picture = skimage.io.imread(path("fsc.png"))
    assert picture.shape == (360, 900, 3)
    # The second line follows the curve in the units of the axes.
    drawn = np.argwhere((picture == (0xd5, 0x5e, 0)).all(axis=2))
    curve, frequency = table["fsc_measured"], table["frequency_per_A"]
    columns = 70 + (660 - 70) * frequency / frequency[-1]
    for s in (3, 8, 12):
        rows = drawn[abs(drawn[:, 1] - columns[s]) <= 1, 0]
        expected = 305 - (305 - 30) * (curve[s] + 0.2) / 1.25
        assert rows.min() - 2 <= expected <= rows.max() + 2, (s, rows, expected)


def test_contrast_against_numpy():
    reconstruction, _ = random_pair((24, 60, 51), 11)
    file = save("a.mrc", 40 * reconstruction - 7)
    volume = (reconstruction - reconstruction.min()) / np.ptp(reconstruction)
    front = np.concatenate([volume[2:8, 10:20, 30:45].ravel(), volume[12:15, 1:4, 2:9].ravel()])
    back = volume[15:22, 40:55, 5:25]
    score, result = evaluate(file, "--foreground", "30,10,2,45,20,8", "--foreground",
                             "2,1,12,9,4,15", "--background=5,40,15,25,55,22")
    found = score["contrast"]
    cnr = abs(front.mean() - back.mean()) / np.sqrt((front.var() + back.var()) / 2)
    assert abs(found["cnr"] / cnr - 1) < 1e-4, (found, cnr)
    assert abs(found["enl"] / (back.mean() ** 2 / back.var()) - 1) < 1e-4, found
    assert found["foreground"] == ["30,10,2,45,20,8", "2,1,12,9,4,15"]
    assert not found["regions_chosen"] and "30,10,2,45,20,8" in result.stdout


def chosen_cubes(volume, side):
    """Returns corners z, y, x of foreground and background by the documented rule."""
    starts = [n % side // 2 + side * np.arange(n // side) for n in volume.shape]
    corners = [(z, y, x) for z in starts[0] for y in starts[1] for x in starts[2]]
    cubes = [volume[tuple(slice(c, c + side) for c in corner)] for corner in corners]
    mean, variance = np.array([c.mean() for c in cubes]), np.array([c.var() for c in cubes])
    nearest = np.argsort(abs(mean - np.median(mean)), kind="stable")[: (len(cubes) + 1) // 2]
    background = min(nearest, key=lambda i: variance[i])
    cnr = abs(mean - mean[background]) / np.sqrt((variance + variance[background]) / 2)
    return corners[np.argmax(cnr)], corners[background]


def test_regions_are_chosen_by_the_rule_and_can_be_handed_on():
    volume, other = random_pair((40, 61, 83), 12)
    score, result = evaluate(save("a.mrc", volume))
    found = score["contrast"]
    assert found["regions_chosen"] and "psnr_raw_dB" not in score
    expected = chosen_cubes(volume.astype(np.float64), 5)
    for name, (z, y, x) in zip(("foreground", "background"), expected):
        assert found[name] == [f"{x},{y},{z},{x + 5},{y + 5},{z + 5}"], (name, found)
    options = result.stdout.split("regions chosen:")[1].split()
    again, _ = evaluate(path("a.mrc"), *options)
    assert again["contrast"]["cnr"] == found["cnr"] and again["contrast"]["enl"] == found["enl"]
    handed, _ = evaluate(save("b.mrc", other), path("a.mrc"), "--cnr", *options)
    assert handed["contrast"]["foreground"] == found["foreground"] and "psnr_raw_dB" in handed


def test_speckle_against_scipy():
    random = np.random.default_rng(12)
    for shape in [(9, 30, 301), (20, 17, 40)]:
        volume = random.gamma(0.5, size=shape).astype(np.float32) - 3
        distance = np.abs(volume - scipy.ndimage.median_filter(volume, 3))[1:-1, 1:-1, 1:-1]
        expected = np.mean(distance > volume.std(dtype=np.float64))
        score, result = evaluate(save("a.mrc", volume))
        assert 0.01 < expected and abs(score["speckle"] - expected) < 1e-4 * expected, score
        assert f"speckle {100 * expected:.3f}" in result.stdout and score["face_jump"] is None
    line = "--profile", "0,0,0,9,9,2", "--profile-csv", path("profile.csv")
    thin, _ = evaluate(save("a.mrc", volume[:2]), *line)
    assert thin["speckle"] is None


def test_face_jump_is_that_of_the_bench_and_of_the_run():
    series = harness.Series("faces")
    fit = series.reconstruct("run", "--roi", "5,2,45,33", "--field", "grid", "--epochs", 3)
    expected = json.loads(subprocess.run(["/usr/bin/python3", SEAM, fit.volume_path], check=True,
                                         capture_output=True, text=True).stdout)
    found, result = evaluate(fit.volume_path)
    assert abs(found["face_jump"]["both"] - expected["ratio"]) < 1e-4, found
    assert abs(found["face_jump"]["x"] - expected["ratio_x"]) < 1e-4, found
    assert abs(found["face_jump"]["y"] - expected["ratio_y"]) < 1e-4, found
    assert "face jump %.4f" % found["face_jump"]["both"] in result.stdout
    with open(fit.json_path, encoding="utf-8") as file:
        metrics = json.load(file)["metrics"]
    assert abs(metrics["face_jump"]["both"] - found["face_jump"]["both"]) < 1e-5
    assert abs(metrics["speckle"] - found["speckle"]) < 1e-4
    # The leaves are those of --model, wherever it lies; a model of other voxels is refused.
    with mrcfile.open(fit.volume_path) as file:
        volume = file.data.copy()
    alone = save("alone.mrc", volume)
    assert evaluate(alone)[0]["face_jump"] is None
    given, _ = evaluate(alone, "--model", fit.model_path)
    assert given["face_jump"] == found["face_jump"]
    refused = run(save("cut.mrc", volume[:, :, 1:]), "--model", fit.model_path)
    assert refused.returncode == 2 and "39 × 31 × 24 voxels" in refused.stderr, refused.stderr


def test_profile_against_scipy():
    reconstruction, truth = random_pair((24, 60, 51), 13)
    files = save("a.mrc", reconstruction[1:-1], 12.5), save("b.mrc", truth, 12.5)
    ends = np.array([[3.5, 4.25, 5.0], [48.0, 50.0, 20.5]])
    line = ",".join("%g" % v for v in ends.ravel())
    evaluate(*files, "--profile", line, "--profile-csv", path("profile.csv"))
    table = np.genfromtxt(path("profile.csv"), delimiter=",", names=True)
    length = np.linalg.norm(ends[1] - ends[0])
    steps = np.arange(int(length) + 1)
    np.testing.assert_allclose(table["distance_A"], 12.5 * steps, rtol=1e-5)
    points = ends[0] + steps[:, None] / length * (ends[1] - ends[0])
    for column, volume in (("volume", reconstruction), ("truth", truth)):
        expected = scipy.ndimage.map_coordinates(
            volume.astype(np.float64), points.T[::-1] - 0.5, order=1)
        np.testing.assert_allclose(table[column], expected, atol=1e-6)
    evaluate(files[1], "--profile", line, "--profile-csv", path("alone.csv"))
    alone = np.genfromtxt(path("alone.csv"), delimiter=",", names=True)
    np.testing.assert_array_equal(alone["volume"], table["truth"])
    result = run(files[1], "--profile", "1,1,1,52,3,3", "--profile-csv", path("none.csv"))
    assert result.returncode == 2 and "0,0,0,51,60,24" in result.stderr, result


def test_reprojection_error():
    truth, series = simulate("cell", 24)
    score, result = evaluate(truth, *series, "--no-margin")
    found = score["reprojection"]
    # The truth explains everything but the noise and the edges of its voxels.
    assert 0.9 < found["error"] < 1.5, found["error"]
    assert len(found["views"]) == 21 and "reprojection error %.4f" % found["error"] in result.stdout
    flat = found["views"][10]
    assert flat["tilt_deg"] == 0
    volume, view = mrcfile.read(truth).astype(np.float64), mrcfile.read(series[1])[10]
    scale, offset = np.polyfit(volume.sum(axis=0).ravel(), view.ravel(), 1)
    residual = np.mean((scale * volume.sum(axis=0) + offset - view) ** 2)
    np.testing.assert_allclose(flat["scale"], scale, rtol=1e-4)
    np.testing.assert_allclose(flat["offset"], offset, atol=1e-3)
    np.testing.assert_allclose(flat["error"] * flat["noise_sigma"] ** 2, residual, rtol=1e-3)
    wide = save("wide.mrc", volume, voxel_size=2 * float(mrcfile.open(truth, header_only=True).voxel_size.x))
    refused = run(wide, *series, "--no-margin")
    assert refused.returncode == 2 and "bring them to one voxel size" in refused.stderr, refused
    near = save("near.mrc", volume, voxel_size=10.3)
    _, said = evaluate(near, *series, "--no-margin")
    assert "has 10.3 Å and the series" in said.stderr, said.stderr
    elsewhere = save("elsewhere.mrc", volume, float(mrcfile.open(truth, header_only=True).voxel_size.x),
                     label="tomofield 1", origin=(80, 0, 0))
    refused = run(elsewhere, *series, "--no-margin")
    assert refused.returncode == 2 and "--roi that it was made with" in refused.stderr, refused
    above = save("above.mrc", volume, float(mrcfile.open(truth, header_only=True).voxel_size.x),
                 label="tomofield 1", origin=(0, 0, 80))
    refused = run(above, *series, "--no-margin")
    assert refused.returncode == 2 and "whole thickness" in refused.stderr, refused
    # Units and contrast do not matter. The hand does, and so does a volume that lacks something.
    other, _ = evaluate(save("units.mrc", -30 * volume), *series, "--no-margin")
    np.testing.assert_allclose(other["reprojection"]["error"], found["error"], rtol=1e-3)
    mirrored, _ = evaluate(truth, *series, "--no-margin", "--hand", "-1")
    assert mirrored["reprojection"]["error"] > 1.5 * found["error"], mirrored
    blurred, _ = evaluate(save("soft.mrc", scipy.ndimage.gaussian_filter(volume, 2)), *series,
                          "--no-margin", "--hold-out", "5")
    assert blurred["reprojection"]["error"] > 1.2 * found["error"], blurred
    assert [v["view"] for v in blurred["reprojection"]["views"]] == [2, 7, 12, 17]


def test_reprojection_of_a_specimen_that_goes_on_outside():
    truth, series = simulate("slab", 16, "--extended")
    inside, _ = evaluate(truth, *series)
    everywhere, _ = evaluate(truth, *series, "--no-margin")
    assert inside["reprojection"]["error"] < 1.5 < everywhere["reprojection"]["error"] / 2
    volume = mrcfile.read(truth)
    part, _ = evaluate(save("part.mrc", volume[:, 3:40, 4:44]), *series, "--roi", "4,3,44,40")
    assert part["reprojection"]["error"] < 1.5
    for file, options, words in (
        (path("part.mrc"), series, "--roi"),
        (truth, [*series[:4], "--tlt", path("absent.tlt")], "absent.tlt"),
        (truth, [*series, "--json", series[1], "--overwrite"], "replace the input"),
        (truth, [*series, "--json", series[5], "--overwrite"], "replace the input"),
        (truth, ["--hold-out", "5"], "--series"),
    ):
        result = run(file, *options)
        assert result.returncode == 2 and words in result.stderr, (options, result)


def test_options_that_do_not_fit_are_refused():
    volume, _ = random_pair((24, 60, 51), 14)
    file, other = save("a.mrc", volume), save("b.mrc", volume)
    kept = save("kept.csv", volume)
    for options, words in (
        (["--tilt-range=-60,60"], "--fsc"),
        (["--fsc", other, "--tilt-range=60,-60"], "lower"),
        (["--fsc", other, "--tilt-range=-60,100"], "90"),
        (["--fsc", other, "--fsc-csv", kept], "--overwrite"),
        (["--fsc", other, "--fsc-csv", other, "--overwrite"], "would replace the input"),
        (["--fsc", other, "--fsc-csv", path("x"), "--json", path("x")], "two results"),
        (["--fsc", other, "--fsc-csv", path("absent/x.csv")], "absent"),
        (["--foreground", "1,2,3,4,5,6"], "--background"),
        (["--foreground", "1,2,3,4,5", "--background", "1,2,3,4,5,6"], "six whole numbers"),
        (["--foreground", "1,2,3,4,5,6", "--background", "1,2,3,60,5,6"], "0,0,0,51,60,24"),
        (["--profile", "1,2,3,4,5,6"], "--profile-csv"),
        (["--box", "1,2,3,40,50,20"], "--fsc"),
        (["--fsc", save("flat.mrc", 0 * volume)], "constant"),
        (["--fsc", save("turned.mrc", volume.transpose(1, 0, 2))], "--axes"),
    ):
        result = run(file, *options)
        assert result.returncode == 2 and words in result.stderr, (options, result)
    assert mrcfile.read(kept).shape == volume.shape
    tiny = run(save("tiny.mrc", volume[:2, :4, :9]))
    assert tiny.returncode == 2 and "--foreground" in tiny.stderr, tiny


def test_a_stopped_comparison_leaves_nothing(tmp_path):
    rng = np.random.default_rng(3)
    volume = save("large.mrc", rng.normal(size=(96, 160, 160)))
    results = tmp_path / "results"
    results.mkdir()
    files = [results / name for name in ("f.csv", "f.png", "j.json")]
    for delay in (0.05, 0.2, 0.5):
        running = harness.start("evaluate", volume, volume, "--fsc", volume, "--fsc-csv", files[0],
                                "--fsc-picture", files[1], "--json", files[2], "--overwrite")
        try:
            _, said = running.communicate(timeout=delay)
        except subprocess.TimeoutExpired:
            running.send_signal(signal.SIGTERM)
            _, said = running.communicate(timeout=60)
        # Before it has begun, the signal itself ends it.
        assert running.returncode in (0, 128 + signal.SIGTERM, -signal.SIGTERM), said
        if running.returncode > 0:
            assert "stopped; nothing was written" in said, said
        left = set(os.listdir(results))
        assert left in (set(), {file.name for file in files}), left


def test_volumes_beyond_the_memory_are_refused_before_they_are_read():
    """The file is sparse: only its header takes room."""
    large = save("sparse.mrc", np.zeros((1, 2, 2)))
    side, sections = 32768, 1024  # 4 TiB
    sizes = [side, side, sections]
    with open(large, "r+b") as file:
        for place in (0, 28):
            file.seek(place)
            file.write(struct.pack("<3i", *sizes))
        file.seek(40)
        file.write(struct.pack("<3f", *(10.0 * size for size in sizes)))
        file.truncate(1024 + 4 * side * side * sections)
    for options in (["--cnr"], [large], ["--membranes", large]):
        refused = run(large, *options)
        assert refused.returncode == 2, refused.stderr
        for part in ("sparse.mrc", "GiB of memory", "bin it"):
            assert part in refused.stderr, refused.stderr
    os.remove(large)
