"""evaluate against the yardstick's score and scikit-image.

usage: evaluate_test.py TOMOFIELD SCRATCH_DIR"""

import json
import os
import re
import shutil
import subprocess
import sys

import mrcfile
import numpy as np
import scipy.ndimage
from skimage.metrics import structural_similarity

PROGRAM, SCRATCH = sys.argv[1], sys.argv[2]
SCRIPT = os.path.join(os.environ.get("TOMOFIELD_SHARED", "/nonexistent"), "tools", "measure.py")


def path(name):
    return os.path.join(SCRATCH, name)


def save(name, volume, voxel_size=10.0):
    with mrcfile.new(path(name), overwrite=True) as file:
        file.set_data(volume.astype(np.float32))
        file.set_volume()
        file.voxel_size = voxel_size
    return path(name)


def run(*arguments):
    return subprocess.run([PROGRAM, "evaluate", *map(str, arguments)], capture_output=True, text=True)


def evaluate(*arguments):
    """The figures of one comparison, and what was printed."""
    result = run(*arguments, "--json", path("score.json"), "--overwrite")
    assert result.returncode == 0, result.stderr
    return json.load(open(path("score.json"))), result


def expected_score(reconstruction, truth):
    """PSNR and SSIM as measure.py and scikit-image define them."""
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


def test_random_volumes_against_scikit_image():
    for seed, shape in enumerate([(20, 64, 50), (7, 41, 33), (31, 7, 90)]):
        reconstruction, truth = random_pair(shape, seed)
        score, _ = evaluate(save("a.mrc", reconstruction), save("b.mrc", truth))
        check_score(score, expected_score(reconstruction, truth))


def test_phantom_against_scikit_image():
    directory = path("phantom")
    options = ["--size", "64", "--thickness", "40", "--tilts", "0:0:1"]
    subprocess.run([PROGRAM, "simulate", directory, *options], check=True, capture_output=True)
    truth = mrcfile.read(os.path.join(directory, "truth.mrc"))
    blurred = scipy.ndimage.gaussian_filter(truth, (3, 1, 1)) * 0.8 + 0.05
    score, result = evaluate(save("a.mrc", blurred), os.path.join(directory, "truth.mrc"))
    check_score(score, expected_score(blurred, truth))
    assert "64 × 64 × 40" in result.stdout and "PSNR" in result.stdout
    assert "%.3f" % score["psnr_affine_dB"] in result.stdout


def test_against_the_yardstick_script():
    # Other sizes on every axis, odd differences both ways.
    reconstruction, truth = random_pair((24, 60, 51), 5)
    for a, b in (
        (reconstruction, truth),
        (reconstruction[:, 3:, :], truth[1:-2]),
        (reconstruction[2:-1], truth[:, 1:-4, 1:]),
    ):
        files = save("a.mrc", a), save("b.mrc", b)
        score, _ = evaluate(*files)
        output = subprocess.check_output(["/usr/bin/python3", SCRIPT, "psnr", *files], text=True)
        words = output.split(" shape")[0].split()
        figures = dict(zip(words[::2], map(float, words[1::2])))
        assert abs(score["psnr_raw_dB"] - figures["psnr_raw"]) < 0.0051, output
        assert abs(score["psnr_affine_dB"] - figures["psnr_affine"]) < 0.0051, output
        assert abs(score["scale"] - figures["scale"]) < 0.00051, output
        assert abs(score["offset"] / score["peak"] - figures["offset"]) < 0.000051, output
        assert abs(score["correlation"] - figures["corr"]) < 0.000051, output
        size = [int(n) for n in re.findall(r"\d+", output.split("shape")[1])]
        box = np.array(score["box_last"]) - score["box_first"]
        assert list(box[::-1]) == size, (box, size)


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


def test_equal_volumes_are_infinitely_alike():
    _, truth = random_pair((10, 20, 30), 7)
    file = save("a.mrc", truth)
    score, result = evaluate(file, file)
    assert score["psnr_raw_dB"] is None and score["ssim_raw"] == 1 and "inf" in result.stdout


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
    flat = save("flat.mrc", np.zeros((24, 60, 51)))
    assert run(good, flat).returncode == 2
    thin = save("thin.mrc", truth[:5])
    result = run(thin, thin)
    assert result.returncode == 2 and "7 voxels" in result.stderr


def test_existing_figures_are_kept_unless_asked():
    _, truth = random_pair((10, 20, 30), 9)
    file = save("a.mrc", truth)
    with open(path("kept.json"), "w") as kept:
        kept.write("mine")
    result = run(file, file, "--json", path("kept.json"))
    assert result.returncode == 2 and "--overwrite" in result.stderr
    assert open(path("kept.json")).read() == "mine"


def main():
    shutil.rmtree(SCRATCH, ignore_errors=True)  # of an earlier run that failed
    os.makedirs(SCRATCH)
    has_script = os.path.exists(SCRIPT)
    for name, test in list(globals().items()):
        if not name.startswith("test_"):
            continue
        if "script" in name and not has_script:
            print("SKIPPED", name, "(no", SCRIPT + ")")
            continue
        test()
        print("passed ", name)
    shutil.rmtree(SCRATCH)
    return 0 if has_script else 77


if __name__ == "__main__":
    sys.exit(main())
