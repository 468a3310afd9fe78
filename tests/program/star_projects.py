"""Makes projects in the form of RELION 5 and of Warp from a simulated series."""

import os

import gemmi
import mrcfile
import numpy as np

import harness
from harness import HEIGHT, PIXEL_SIZE, THICKNESS, TILTS, WIDTH

SHIFTS_PX = np.stack([2 * np.sin(TILTS), 1 + 0 * TILTS], axis=1).round()
# RELION and Warp count from the pixel N / 2, in the volume too: half a pixel beyond the middle. Their
# shifts of a specimen that was simulated about the middle make up for that.
HALF_PX = 0.5 * (1 - np.cos(np.radians(TILTS)) - np.sin(np.radians(TILTS)))
LISTED_A = (SHIFTS_PX - np.stack([HALF_PX, 0 * TILTS], axis=1)) * PIXEL_SIZE

TILT_COLUMNS = ["rlnMicrographName", "rlnTomoXTilt", "rlnTomoYTilt", "rlnTomoZRot",
                "rlnTomoXShiftAngst", "rlnTomoYShiftAngst", "rlnMicrographPreExposure",
                "rlnDefocusU", "rlnDefocusV", "rlnDefocusAngle"]


def write_star(path, name, columns, rows):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w", encoding="utf-8") as file:
        file.write(f"\n# version 50001\n\ndata_{name}\n\nloop_ \n")
        for i, column in enumerate(columns):
            file.write(f"_{column} #{i + 1} \n")
        for row in rows:
            file.write(" ".join(map(str, row)) + " \n")
        file.write(" \n")


def read_rows(path):
    """Returns the rows of a STAR file with one table, read by gemmi."""
    (block,) = gemmi.cif.read(path)
    (item,) = block
    names = [tag[1:] for tag in item.loop.tags]
    cells = [gemmi.cif.as_string(value) for value in item.loop.values]
    return [dict(zip(names, cells[i:i + len(names)])) for i in range(0, len(cells), len(names))]


def recorded(views):
    """Returns views whose specimen was moved by SHIFTS_PX while they were recorded."""
    moved = [np.roll(view, tuple(shift.astype(int)[::-1]), axis=(0, 1))
             for view, shift in zip(views, SHIFTS_PX)]
    return np.array(moved, dtype=np.float32)


def write_image(path, image):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with mrcfile.new(path, overwrite=True) as file:
        file.set_data(image)
        file.voxel_size = PIXEL_SIZE


def write_relion_views(folder, series, names, wrong_A=0):
    """Writes the table of one tilt series, whose images have these names. `wrong_A` is added to the
    shifts."""
    rows = [[name, 0, tilt, 0, *shift, 3 * i, 30000, 29000, 45]
            for i, (name, tilt, shift) in enumerate(zip(names, TILTS, LISTED_A + wrong_A))]
    write_star(os.path.join(folder, f"Tomograms/job009/tilt_series/{series}.star"), series,
               TILT_COLUMNS, rows)


def write_relion(folder, series):
    """Makes a project folder of RELION 5 with two tomograms and returns its tomograms.star. The
    views of TS_01 are files, those of TS_02 sections of a stack."""
    images = recorded(series.views)
    names = []
    for i, image in enumerate(images):
        names.append(f"MotionCorr/job002/frames/TS_01_{i:03d}.mrc")
        write_image(os.path.join(folder, names[-1]), image)
    os.makedirs(os.path.join(folder, "stacks"))
    harness.write_stack(os.path.join(folder, "stacks/TS_02.mrcs"), images, PIXEL_SIZE)
    write_relion_views(folder, "TS_01", names)
    write_relion_views(folder, "TS_02",
                       [f"{i + 1:06d}@stacks/TS_02.mrcs" for i in range(len(images))])
    star = os.path.join(folder, "Tomograms/job009/tomograms.star")
    write_star(star, "global",
               ["rlnTomoName", "rlnTomoTiltSeriesStarFile", "rlnVoltage", "rlnTomoHand",
                "rlnAmplitudeContrast", "rlnOpticsGroupName", "rlnTomoTiltSeriesPixelSize", "rlnTomoSizeX",
                "rlnTomoSizeY", "rlnTomoSizeZ"],
               [[name, f"Tomograms/job009/tilt_series/{name}.star", "200.000000", "1.00000",
                 0.1, "'the optics'", PIXEL_SIZE, WIDTH, HEIGHT, THICKNESS]
                for name in ("TS_01", "TS_02")])
    return star


def write_warp(folder, series):
    """Makes the folders of Warp for one series and returns its .tomostar and its XML file."""
    for i, image in enumerate(recorded(series.views)):
        write_image(os.path.join(folder, f"warp_frameseries/average/TS_01_{i:03d}.mrc"), image)
    movies = [f"../warp_frameseries/TS_01_{i:03d}.eer" for i in range(len(TILTS))]
    tomostar = os.path.join(folder, "tomostar/TS_01.tomostar")
    # ts_import turns the sign of the angles.
    write_star(tomostar, "", ["wrpMovieName", "wrpAngleTilt", "wrpAxisAngle", "wrpDose",
                              "wrpAxisOffsetX", "wrpAxisOffsetY"],
               [[movie, -tilt, 0, 3 * i, *shift]
                for i, (movie, tilt, shift) in enumerate(zip(movies, TILTS, LISTED_A))])
    lines = {"Angles": -TILTS, "AxisAngle": 0 * TILTS, "AxisOffsetX": LISTED_A[:, 0],
             "AxisOffsetY": LISTED_A[:, 1], "Dose": 3 * np.abs(TILTS),
             "UseTilt": ["True"] * len(TILTS), "MoviePath": movies}
    text = "".join(f"<{name}>" + "\n".join(map(str, values)) + f"</{name}>"
                   for name, values in lines.items())
    size = ", ".join(str(n * PIXEL_SIZE) for n in (WIDTH, HEIGHT, THICKNESS))
    xml = os.path.join(folder, "warp_tiltseries/TS_01.xml")
    os.makedirs(os.path.dirname(xml))
    with open(xml, "w", encoding="utf-16") as file:
        file.write('<?xml version="1.0" encoding="utf-16"?>\n'
                   f'<TiltSeries VolumeDimensionsAngstrom="{size}">{text}</TiltSeries>')
    return tomostar, xml
