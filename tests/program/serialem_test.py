"""A raw series as SerialEM writes it goes to a levelled tomogram by three commands: sections in the
dose-symmetric order of recording, a tilt axis at 85°, contrast transfer, gold, shifts, and a specimen
that lies aslant. The tomogram is compared with that of the true alignment."""

import os

import mrcfile
import numpy as np
import pytest
import scipy.ndimage
import scipy.optimize

import harness

SIZE, THICKNESS, PITCH, AXIS = 96, 48, 6.0, 85.0
FIT = ["--tv-penalty", "smooth", "--tv", 4.7]


def entries(path, name):
    with open(path, encoding="utf-8") as file:
        return np.array([float(line.split("=")[1]) for line in file if line.startswith(name)])


def write_raw_series(folder):
    """Writes TS_01.mrc and TS_01.mdoc, whose angles are those of the stage: the specimen has a pitch
    against it. true.xf and true.tlt have the true alignment."""
    made = os.path.join(folder, "made")
    harness.succeed("simulate", made, "--yardstick", "d", "--size", SIZE, "--thickness", THICKNESS,
                    "--seed", 5, "--misalign", 4, "--misalign-rotation", 0.2, "--misalign-axis", AXIS)
    path = os.path.join(made, "tilt_series")
    doses, before = (entries(path + ".mdoc", name) for name in ("ExposureDose", "PriorRecordDose"))
    tilts, transforms = np.loadtxt(path + ".tlt"), np.loadtxt(path + ".xf")
    order = np.argsort(before)
    assert not (np.diff(tilts[order]) > 0).all()  # not sorted by tilt
    with mrcfile.open(path + ".mrc") as file:
        harness.write_stack(os.path.join(folder, "TS_01.mrc"), file.data[order], 10.0)
    np.savetxt(os.path.join(folder, "true.xf"), transforms[order], fmt="%.7f")
    np.savetxt(os.path.join(folder, "true.tlt"), tilts[order], fmt="%.2f")
    text = ("PixelSpacing = 10\nVoltage = 300\nImageFile = TS_01.mrc\n\n"
            f"[T =     Tilt axis angle = {AXIS}, binning = 1  spot = 8  camera = 2]\n")
    for section, view in enumerate(order):
        text += (f"\n[ZValue = {section}]\nTiltAngle = {tilts[view] - PITCH:.2f}\n"
                 f"ExposureDose = {doses[view]}\nPriorRecordDose = {before[view]}\n")
    with open(os.path.join(folder, "TS_01.mdoc"), "w", encoding="utf-8") as file:
        file.write(text)
    with open(path + "_ctf.txt", encoding="utf-8") as file:
        lines = file.readlines()
    rows = [line.split() for line in lines if not line.startswith("#")]
    with open(os.path.join(folder, "TS_01_ctf.txt"), "w", encoding="utf-8") as file:
        file.writelines(line for line in lines if line.startswith("#"))
        for section, view in enumerate(order):
            file.write(" ".join([str(section + 1), *rows[view][1:]]) + "\n")


def psnr(volume, truth):
    """Returns the PSNR of a dark volume where it fits the truth best, by a shift and by its scale
    and offset, since the views tell neither."""
    grow = [(max(0, t - v) // 2, max(0, t - v + 1) // 2) for t, v in zip(truth.shape, volume.shape)]
    volume = np.pad(-volume, grow)
    cut = [(v - t) // 2 for t, v in zip(truth.shape, volume.shape)]
    middle = tuple(slice(n // 8, n - n // 8) for n in truth.shape)
    wanted = truth[middle].ravel()

    def error(shift):
        moved = scipy.ndimage.shift(volume, shift, order=1)
        moved = moved[tuple(slice(c, c + n) for c, n in zip(cut, truth.shape))][middle].ravel()
        columns = np.stack([moved, np.ones_like(moved)], axis=1)
        rest = wanted - columns @ np.linalg.lstsq(columns, wanted, rcond=None)[0]
        return (rest ** 2).mean()

    found = scipy.optimize.minimize(error, coarse_shift(volume, truth, cut), method="Powell",
                                    options={"xtol": 0.05, "maxiter": 3})
    return 10 * np.log10(np.ptp(wanted) ** 2 / found.fun)


def coarse_shift(volume, truth, cut):
    """Returns the shift by whole voxels that makes both most alike."""
    part = volume[tuple(slice(c, c + n) for c, n in zip(cut, truth.shape))]
    smooth = [scipy.ndimage.gaussian_filter(v - v.mean(), 2) for v in (truth, part)]
    product = np.fft.rfftn(smooth[0]) * np.conj(np.fft.rfftn(smooth[1]))
    peak = np.unravel_index(np.fft.irfftn(product, truth.shape).argmax(), truth.shape)
    return [(p + n // 2) % n - n // 2 for p, n in zip(peak, truth.shape)]


@pytest.fixture(scope="module")
def folder():
    folder = harness.fresh_directory("serialem")
    write_raw_series(folder)
    return folder


def test_three_commands_end_in_a_levelled_tomogram(folder):
    common = ["--thickness", THICKNESS * 5 // 4]
    fit = [*common, "--ctf", "TS_01_ctf.txt", *FIT]
    harness.succeed("align", "TS_01.mdoc", "--align", "full", *common, "-o", "TS_01_rec.mrc", cwd=folder)
    harness.succeed("reconstruct", "TS_01.mdoc", "--xf", "TS_01_rec_align.xf", "--tlt",
                    "TS_01_rec_align.tlt", "-o", "TS_01_rec.mrc", *fit, cwd=folder)
    harness.succeed("export", "TS_01_rec.h5", "--level", "found", "-o", "level.mrc", cwd=folder)
    harness.succeed("reconstruct", "TS_01.mdoc", "--xf", "true.xf", "--tlt", "true.tlt", "-o",
                    "true.mrc", *fit, cwd=folder)
    truth = harness.read_volume(os.path.join(folder, "made/truth.mrc"))
    aslant, level, best = (psnr(harness.read_volume(os.path.join(folder, name)), truth)
                           for name in ("TS_01_rec.mrc", "level.mrc", "true.mrc"))
    assert level > best - 0.5, (aslant, level, best)
    assert level > aslant + 0.2, (aslant, level, best)
