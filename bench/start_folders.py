"""Makes the folders that docs/start.md names, as eTomo, AreTomo, RELION 5 and SerialEM write them, from
one simulated series of a raw stack whose tilt axis lies 85° from the vertical."""

import os
import shutil
import subprocess

import numpy as np

AXIS_DEG = 85.0
PIXEL_A = 10.0
TARGET_UM = 3.0  # of the defocus


class Series:
    """A simulated raw series: yardstick D, whose specimen has a contrast transfer, damage and gold."""

    def __init__(self, program, folder, size, seed=3):
        self.folder, self.size = folder, size
        subprocess.run([program, "simulate", folder, "--yardstick", "d", "--size", str(size),
                        "--misalign", "2", "--misalign-axis", f"{AXIS_DEG:g}", "--seed", str(seed),
                        "--overwrite"], check=True, stdout=subprocess.DEVNULL)
        self.tilts = np.loadtxt(self.path("tilt_series.tlt"))
        self.transforms = np.loadtxt(self.path("tilt_series.xf"))
        self.thickness = 112  # of the ice, in voxels

    def path(self, name):
        return os.path.join(self.folder, name)

    def shifts(self):
        """Returns where the middle of the aligned view lies from that of each recorded view, in
        pixels. An .xf file has q = R(-ROT) p + d, so that p = R(ROT) q - R(ROT) d."""
        cosine, sine = np.cos(np.radians(AXIS_DEG)), np.sin(np.radians(AXIS_DEG))
        x, y = self.transforms[:, 4], self.transforms[:, 5]
        return np.stack([sine * y - cosine * x, -sine * x - cosine * y], axis=1)


def write(folder, name, text):
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(folder, name), "w", encoding="utf-8") as file:
        file.write(text)


def copy(series, names, folder):
    """Copies files of a series: {name in the simulation: name in the folder}."""
    os.makedirs(folder, exist_ok=True)
    for name, copied in names.items():
        shutil.copy(series.path(name), os.path.join(folder, copied))


def write_etomo(series, folder):
    copy(series, {"tilt_series.mrc": "TS_01.st", "tilt_series.tlt": "TS_01.tlt",
                  "tilt_series.xf": "TS_01.xf", "tilt_series.defocus": "TS_01.defocus"}, folder)
    write(folder, "newst.com", "$newstack -StandardInput\nInputFile\tTS_01.st\n"
          "OutputFile\tTS_01_ali.mrc\nTransformFile\tTS_01.xf\nTaperAtFill\t1,1\n")
    write(folder, "tilt.com", "$tilt -StandardInput\nInputProjections TS_01_ali.mrc\n"
          "OutputFile TS_01_full_rec.mrc\nTILTFILE TS_01.tlt\nRADIAL 0.35 0.035\n"
          f"THICKNESS {series.thickness}\nPERPENDICULAR\nMODE 1\n")
    write(folder, "ctfcorrection.com", "$ctfphaseflip -StandardInput\nVoltage 300\n"
          "SphericalAberration 2.7\nAmplitudeContrast 0.07\n")


def write_aretomo(series, folder):
    copy(series, {"tilt_series.mrc": "TS_01.mrc", "tilt_series_ctf.txt": "TS_01_CTF.txt"}, folder)
    rows = "".join(f"{i:5d} {AXIS_DEG:8.4f}  1.00000 {x:9.3f} {y:9.3f}  1.00  1.00  1.00  0.00 "
                   f"{tilt:8.2f}\n"
                   for i, (tilt, (x, y)) in enumerate(zip(series.tilts, series.shifts()), 1))
    write(folder, "TS_01.aln", "# AreTomo Alignment / Priims bprmMn\n"
          f"# RawSize = {series.size} {series.size} {len(series.tilts)}\n# NumPatches = 0\n"
          f"# AlphaOffset =     0.00\n# BetaOffset =     0.00\n# Thickness = {series.thickness}\n"
          "# SEC     ROT         GMAG       TX          TY      SMEAN     SFIT    SCALE     BASE     "
          "TILT\n" + rows)


def star(name, columns, rows):
    """Returns a STAR file with one table."""
    head = "".join(f"_{column} #{i}\n" for i, column in enumerate(columns, 1))
    return (f"\n# version 50001\n\ndata_{name}\n\nloop_\n{head}"
            + "".join(" ".join(map(str, row)) + "\n" for row in rows) + "\n")


def write_relion(series, folder):
    copy(series, {"tilt_series.mrc": "TS_01.mrcs"}, os.path.join(folder, "stacks"))
    defocus = np.loadtxt(series.path("tilt_series_ctf.txt"))
    dose = [float(line.split("=")[1]) for line in open(series.path("tilt_series.mdoc"), encoding="utf-8")
            if line.startswith("PriorRecordDose")]
    # RELION counts from the pixel N / 2, half a pixel beyond the middle, in the view and the volume.
    angle, tilt = np.radians(AXIS_DEG), np.radians(series.tilts)
    u, v = 0.5 * (np.cos(tilt) + np.sin(tilt)), 0.5
    centre = np.stack([np.cos(angle) * u - np.sin(angle) * v,
                       np.sin(angle) * u + np.cos(angle) * v], axis=1)
    shifts = PIXEL_A * (series.shifts() - 0.5 + centre)
    rows = [[f"{i + 1:06d}@stacks/TS_01.mrcs", 0, series.tilts[i], AXIS_DEG, *shifts[i].round(4),
             dose[i], *defocus[i, 1:4]] for i in range(len(series.tilts))]
    job = os.path.join(folder, "Tomograms/job009")
    write(os.path.join(job, "tilt_series"), "TS_01.star", star("TS_01", [
        "rlnMicrographName", "rlnTomoXTilt", "rlnTomoYTilt", "rlnTomoZRot", "rlnTomoXShiftAngst",
        "rlnTomoYShiftAngst", "rlnMicrographPreExposure", "rlnDefocusU", "rlnDefocusV",
        "rlnDefocusAngle"], rows))
    write(job, "tomograms.star", star("global", [
        "rlnTomoName", "rlnTomoTiltSeriesStarFile", "rlnVoltage", "rlnSphericalAberration",
        "rlnAmplitudeContrast", "rlnTomoHand", "rlnTomoTiltSeriesPixelSize", "rlnTomoSizeX",
        "rlnTomoSizeY", "rlnTomoSizeZ"],
        [["TS_01", "Tomograms/job009/tilt_series/TS_01.star", 300.0, 2.7, 0.07, -1, PIXEL_A,
          series.size, series.size, series.thickness]]))


def write_serialem(series, folder):
    copy(series, {"tilt_series.mrc": "TS_01.mrc"}, folder)
    with open(series.path("tilt_series.mdoc"), encoding="utf-8") as file:
        text = file.read().replace("tilt_series.mrc", "TS_01.mrc")
    text = text.replace("TiltAngle", f"TargetDefocus = -{TARGET_UM:g}\nTiltAngle")
    title = f"[T = SerialEM:    Tilt axis angle = {AXIS_DEG:g}, binning = 1  spot = 8  camera = 2]"
    write(folder, "TS_01.mrc.mdoc", f"{title}\nVoltage = 300\n" + text)


def make_folders(program, folder, size):
    """Makes the four folders in `folder`, from views of `size` × `size` pixels."""
    series = Series(program, os.path.join(folder, "simulated"), size)
    for name, write_folder in (("etomo", write_etomo), ("aretomo", write_aretomo),
                               ("relion", write_relion), ("serialem", write_serialem)):
        write_folder(series, os.path.join(folder, name))
