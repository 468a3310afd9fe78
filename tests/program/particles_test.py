"""Tests `tomofield export --particles` and `--level`. Beads lie at known places by the formulas of
RELION 5 and of IMOD, and must lie in their subvolumes and in the levelled volume where these say."""

import json
import os
import shutil

import gemmi
import mrcfile
import numpy as np
import pytest

import harness
import star_projects

WIDTH, HEIGHT, THICKNESS = 72, 56, 24
PIXEL_A = 10.0
TILTS = np.arange(-48, 49, 6.0)
AXIS, SHIFT = -5.0, np.array([1.3, -0.6])
# Zero-based indices in RELION's tomogram, whose centre is half of its size.
PLACES = np.array([(24.0, 20.0, 14.0), (47.0, 36.25, 8.5), (36.0, 28.0, 12.0), (20.0, 41.0, 10.0)])
SIZE = np.array([WIDTH, HEIGHT, THICKNESS])
FIT = ["--contrast", "bright", "--bead-diameter", 0, "--epochs", 8, "--tv-penalty", "smooth", "--tv",
       0.3, "--view-scale", "off", "--no-margin", "--overwrite"]


def about(axis, degrees):
    """Returns the right-handed rotation about an axis: 0 is x."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def beads_at(positions):
    """Returns a view with beads at zero-based positions (x, y)."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return sum(np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * 1.5 ** 2)) for u, v in positions)


def relion_views(x_tilt=0.0, pitch=0.0):
    """Returns the views that RELION's matrix projects: p = c + Rz Ry Rx (P - C) + shift, with the
    pixels int(N / 2) as centres (Tomogram::setProjectionMatrix)."""
    views = []
    for tilt in TILTS:
        matrix = about(2, AXIS) @ about(1, tilt + pitch) @ about(0, x_tilt)
        projected = (PLACES - SIZE // 2) @ matrix.T
        views.append(beads_at(projected[:, :2] + np.array([WIDTH, HEIGHT]) // 2 + SHIFT))
    return np.array(views, np.float32)


def reconstruct(folder, **misaligned):
    harness.write_stack(os.path.join(folder, "TS_01.mrcs"), relion_views(**misaligned), PIXEL_A)
    rows = [[f"{i + 1:06d}@TS_01.mrcs", 0, tilt, AXIS, *(SHIFT * PIXEL_A), 3 * i]
            for i, tilt in enumerate(TILTS)]
    star_projects.write_star(os.path.join(folder, "tilt_series/TS_01.star"), "TS_01",
                             star_projects.TILT_COLUMNS[:7], rows)
    star_projects.write_star(
        os.path.join(folder, "tomograms.star"), "global",
        ["rlnTomoName", "rlnTomoTiltSeriesStarFile", "rlnTomoTiltSeriesPixelSize", "rlnTomoSizeX",
         "rlnTomoSizeY", "rlnTomoSizeZ"],
        [["TS_01", "tilt_series/TS_01.star", PIXEL_A, *SIZE]])
    harness.succeed("reconstruct", "tomograms.star", "-o", "TS_01.mrc", *FIT, cwd=folder)


@pytest.fixture(scope="module")
def folder():
    folder = harness.fresh_directory("particles")
    reconstruct(folder)
    return folder


def write_particles(folder, places=PLACES, names=None, optics=True):
    """Writes a list of particles as RELION 5 does: distances from the centre in Å."""
    angst = (places - SIZE / 2) * PIXEL_A
    names = names or ["TS_01"] * len(places)
    text = ""
    if optics:
        text += ("data_optics\n\nloop_\n_rlnOpticsGroup #1\n_rlnOpticsGroupName #2\n"
                 f"_rlnTomoTiltSeriesPixelSize #3\n1 one {PIXEL_A}\n\n")
    text += "data_particles\n\nloop_\n_rlnTomoName #1\n"
    for i, axis in enumerate("XYZ"):
        text += f"_rlnCenteredCoordinate{axis}Angst #{i + 2}\n"
    text += "_rlnAngleRot #5\n_rlnAngleTilt #6\n_rlnAnglePsi #7\n_rlnOpticsGroup #8\n"
    for name, place in zip(names, angst):
        text += " ".join([name, *(f"{x:.5f}" for x in place), "10 20 30 1"]) + "\n"
    path = os.path.join(folder, "particles.star")
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    return path


def cut_out(folder, *arguments, run=harness.succeed):
    return run("export", "TS_01.h5", "-o", "cut.mrc", "--overwrite", *arguments, cwd=folder)


def read_cut(folder):
    """Returns the subvolumes [particle, z, y, x], the voxel size, and the rows of the list."""
    with mrcfile.open(os.path.join(folder, "cut.mrc")) as file:
        assert file.is_volume_stack()
        values, voxel_A = np.array(file.data), float(file.voxel_size.z)
    blocks = gemmi.cif.read(os.path.join(folder, "cut.star"))
    tables = {block.name: next(item.loop for item in block if item.loop) for block in blocks}
    rows = {name: [dict(zip([tag[1:] for tag in loop.tags], loop.values[i:i + loop.width()]))
                   for i in range(0, len(loop.values), loop.width())]
            for name, loop in tables.items()}
    return values, voxel_A, rows


def bead_places(subvolumes):
    """Returns the centre of mass of the bright spot of each, as zero-based index (x, y, z)."""
    places = []
    for values in subvolumes.astype(float):
        weights = np.clip(values - values.max() / 2, 0, None)
        places.append([(weights * index).sum() / weights.sum()
                       for index in np.indices(values.shape)[::-1]])
    return np.array(places)


@pytest.mark.parametrize("box, angpix", ((11, 10.0), (12, 10.0), (16, 7.0), (8, 20.0)))
def test_particles_of_relion_lie_on_the_middle_voxel(folder, box, angpix):
    particles = write_particles(folder)
    cut_out(folder, "--particles", particles, "--box", box, "--angpix", angpix)
    values, voxel_A, rows = read_cut(folder)
    assert values.shape == (len(PLACES), box, box, box)
    assert voxel_A == pytest.approx(angpix, rel=1e-6)
    np.testing.assert_allclose(bead_places(values) * angpix, box // 2 * angpix, atol=0.35 * PIXEL_A)
    (optics,) = rows["optics"]
    assert float(optics["rlnImagePixelSize"]) == pytest.approx(angpix)
    assert optics["rlnImageSize"] == str(box) and optics["rlnImageDimensionality"] == "3"
    for i, row in enumerate(rows["particles"]):
        assert row["rlnImageName"] == f"{i + 1:06d}@cut.mrc"
        assert [row[f"rlnAngle{name}"] for name in ("Rot", "Tilt", "Psi")] == ["10", "20", "30"]
        found = [float(row[f"rlnCenteredCoordinate{axis}Angst"]) for axis in "XYZ"]
        np.testing.assert_allclose(found, (PLACES[i] - SIZE / 2) * PIXEL_A, atol=1e-4)


def test_the_optics_describe_the_subvolumes(folder):
    particles = write_particles(folder)
    with open(particles, encoding="utf-8") as file:
        text = file.read()
    with open(particles, "w", encoding="utf-8") as file:
        file.write(text.replace(f"_rlnTomoTiltSeriesPixelSize #3\n1 one {PIXEL_A}\n",
                                "_rlnTomoTiltSeriesPixelSize #3\n_rlnTomoSubtomogramBinning #4\n"
                                f"_rlnCtfDataAreCtfPremultiplied #5\n1 one {PIXEL_A} 4.0 1\n"))
    cut_out(folder, "--particles", particles, "--box", 8, "--angpix", PIXEL_A / 2)
    (optics,) = read_cut(folder)[2]["optics"]
    assert float(optics["rlnTomoSubtomogramBinning"]) == 0.5, optics
    assert optics["rlnCtfDataAreCtfPremultiplied"] == "0", optics


def test_angles_of_subtomograms_that_are_not_stated_are_0(folder):
    """RELION takes them so."""
    def cut_with(columns):
        path = write_particles(folder)
        with open(path, encoding="utf-8") as file:
            text = file.read()
        for i, name in enumerate(columns):
            text = text.replace(f" #{8 + i}\nTS_01", f" #{8 + i}\n_rlnTomoSubtomogram{name} #{9 + i}\nTS_01")
        text = text.replace("10 20 30 1\n", "10 20 30 1 " + " ".join(columns.values()) + "\n")
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        cut_out(folder, "--particles", path, "--box", 12, "--angpix", 10.0)
        return read_cut(folder)[0]
    turned = cut_with({"Psi": "50"})
    np.testing.assert_array_equal(turned, cut_with({"Rot": "0", "Tilt": "0", "Psi": "50"}))
    assert np.abs(turned - cut_with({})).max() > 0.01 * turned.std()


def test_particles_in_two_tables_are_refused(folder):
    path = write_particles(folder)
    with open(path, encoding="utf-8") as file:
        text = file.read()
    with open(path, "a", encoding="utf-8") as file:
        file.write(text[text.index("data_particles"):].replace("data_particles", "data_more"))
    ended = cut_out(folder, "--particles", path, "--box", 12, run=harness.tomofield)
    assert ended.returncode == 2 and "several tables" in ended.stderr, ended


def test_points_of_imod_are_voxels_of_the_volume(folder):
    # The middle of the first voxel is at (0.5, 0.5, 0) in a model of IMOD.
    points = os.path.join(folder, "points.txt")
    np.savetxt(points, PLACES + [0.5, 0.5, 0.0], fmt="%.3f")
    cut_out(folder, "--particles", points, "--box", 11)
    values, _, rows = read_cut(folder)
    np.testing.assert_allclose(bead_places(values), 5, atol=0.35)
    found = [[float(row[f"rlnCenteredCoordinate{axis}Angst"]) for axis in "XYZ"]
             for row in rows["particles"]]
    np.testing.assert_allclose(found, (PLACES - SIZE / 2) * PIXEL_A, atol=0.01)


def test_points_count_along_the_axes_of_the_tomogram(folder):
    """Sections go along y with --axes xzy, and rows count down from the upper face."""
    harness.succeed("reconstruct", "tomograms.star", "-o", "sections_y.mrc", *FIT, "--axes", "xzy", cwd=folder)
    x, y, z = PLACES.T
    points = os.path.join(folder, "sections_y.txt")
    np.savetxt(points, np.column_stack([x + 0.5, THICKNESS - z - 0.5, y]), fmt="%.3f")
    said = harness.succeed("export", "sections_y.h5", "-o", "cut.mrc", "--overwrite", "--particles", points, "--box", 11,
                           cwd=folder)
    assert "along x, z, y" in said.stderr, said.stderr
    np.testing.assert_allclose(bead_places(read_cut(folder)[0]), 5, atol=0.35)


def test_a_model_of_a_given_pixel_size_knows_that_of_its_series(folder):
    harness.succeed("reconstruct", "tomograms.star", "-o", "coarse.mrc", *FIT, "--angpix", 2 * PIXEL_A, cwd=folder)
    said = harness.succeed("export", "coarse.h5", "-o", "cut.mrc", "--overwrite", "--particles",
                           write_particles(folder), "--box", 8, "--tomogram", "TS_01", cwd=folder)
    assert "states pixels" not in said.stderr, said.stderr


def test_particles_at_the_border_are_cut_and_counted(folder):
    places = np.array([PLACES[2], (1.0, 28.0, 12.0), (36.0, 28.0, 23.0)])
    particles = write_particles(folder, places, optics=False)
    said = cut_out(folder, "--particles", particles, "--box", 8).stdout
    assert "2 of the 3 boxes reach outside" in said, said
    values = read_cut(folder)[0]
    volume = harness.read_volume(os.path.join(folder, "TS_01.mrc"))
    inside = values[1][:, :, 3:]  # index 4 lies on x = 1
    np.testing.assert_allclose(inside, volume[8:16, 24:32, 0:5], atol=1e-5 * np.ptp(volume))
    assert (values[1][:, :, :3] == 0).all() and (values[2][5:] == 0).all()
    # A particle that is whole has no sentence.
    particles = write_particles(folder, PLACES[2:3])
    assert "reach outside" not in cut_out(folder, "--particles", particles, "--box", 8).stdout


def test_only_the_particles_of_the_tomogram_are_taken(folder):
    particles = write_particles(folder, names=["TS_02", "TS_01", "TS_03", "TS_01"])
    ended = cut_out(folder, "--particles", particles, "--box", 11)
    assert "2 of the 4 particles of" in ended.stderr and "'TS_01'; the others" in ended.stderr, ended
    values, _, rows = read_cut(folder)
    assert len(values) == 2 and {row["rlnTomoName"] for row in rows["particles"]} == {"TS_01"}
    ended = cut_out(folder, "--particles", particles, "--box", 11, "--tomogram", "TS_03")
    assert len(read_cut(folder)[0]) == 1 and ": 1 particle in boxes" in ended.stdout, ended
    refused = cut_out(folder, "--particles", particles, "--box", 11, "--tomogram", "TS_04",
                      run=harness.tomofield)
    assert refused.returncode == 2
    for part in ("3 tomograms", "'TS_01' to 'TS_03'", "'TS_04'", "--tomogram"):
        assert part in refused.stderr, refused.stderr


def test_particles_of_one_other_name_are_taken_with_a_warning(folder):
    ended = cut_out(folder, "--particles", write_particles(folder, names=["TS_07"] * len(PLACES)),
                    "--box", 11)
    assert "'TS_07', and the model is called 'TS_01'" in ended.stderr, ended
    assert len(read_cut(folder)[0]) == len(PLACES)
    ended = cut_out(folder, "--particles", write_particles(folder), "--box", 11)
    assert "warning" not in ended.stderr and "left out" not in ended.stderr, ended


def test_lists_that_make_no_sense_are_refused(folder):
    particles = write_particles(folder)
    old = os.path.join(folder, "old.star")
    star_projects.write_star(old, "particles", ["rlnTomoName", "rlnCoordinateX"], [["TS_01", 3]])
    far, wrong = os.path.join(folder, "far.txt"), os.path.join(folder, "wrong.txt")
    np.savetxt(far, [[900, 900, 900]])
    np.savetxt(wrong, [[9, 9]])
    for arguments, parts in (
            (["--particles", particles], ["--box N"]),
            (["--particles", particles, "--box", "8.5"], ["--box N"]),
            (["--particles", particles, "--box", "1,2,3,4,5,6"], ["'1,2,3,4,5,6'", "--box N"]),
            (["--box", "8"], ["'8'", "--particles"]),
            (["--particles", old, "--box", "8"], ["old.star", "RELION 4", "RELION 5"]),
            (["--particles", far, "--box", "8"], ["none of the 1 particles", "900"]),
            (["--particles", wrong, "--box", "8"], ["wrong.txt", "line 1", "text of particles"]),
            (["--particles", particles, "--box", "8", "--rotate", "1,2,3"], ["--rotate"]),
            (["--tomogram", "TS_01"], ["--particles"])):
        os.path.exists(os.path.join(folder, "cut.mrc")) and os.remove(os.path.join(folder, "cut.mrc"))
        refused = cut_out(folder, *arguments, run=harness.tomofield)
        assert refused.returncode == 2, (arguments, refused.stdout)
        for part in parts:
            assert part in refused.stderr, (arguments, refused.stderr)
        assert "fiducial" not in refused.stderr, refused.stderr
        assert not os.path.exists(os.path.join(folder, "cut.mrc"))


def test_pixels_of_another_series_are_warned_of(folder):
    """Coordinates count from the middle of its pixels."""
    particles = write_particles(folder)
    assert "pixels of" not in cut_out(folder, "--particles", particles, "--box", 8).stderr
    with open(particles, encoding="utf-8") as file:
        text = file.read().replace(f"1 one {PIXEL_A}", f"1 one {8 * PIXEL_A}")
    with open(particles, "w", encoding="utf-8") as file:
        file.write(text)
    said = cut_out(folder, "--particles", particles, "--box", 8).stderr
    assert f"pixels of {8 * PIXEL_A:g} Å" in said and f"{PIXEL_A:g} Å" in said, said


def test_angles_and_contours_that_make_no_sense_are_refused(folder):
    particles = write_particles(folder)
    with open(particles, encoding="utf-8") as file:
        text = file.read().replace("_rlnAngleRot #5", "_rlnTomoSubtomogramRot #5")
    with open(particles, "w", encoding="utf-8") as file:
        file.write(text.replace("10 20 30 1\n", "<NA> 20 30 1\n", 1))
    said = cut_out(folder, "--particles", particles, "--box", 8, run=harness.tomofield)
    assert said.returncode == 2 and "rlnTomoSubtomogramRot is empty" in said.stderr, said
    points = os.path.join(folder, "scored.txt")
    with open(points, "w", encoding="utf-8") as file:
        file.write("12.5 20.5 12.5 8.7\n")  # a score behind x, y and z
    said = cut_out(folder, "--particles", points, "--box", 4, run=harness.tomofield)
    assert said.returncode == 2 and "'12.5', which numbers no" in said.stderr, said


def test_a_stack_of_integers_keeps_its_values(folder):
    particles = write_particles(folder)
    cut_out(folder, "--particles", particles, "--box", 8)
    exact = read_cut(folder)[0]
    cut_out(folder, "--particles", particles, "--box", 8, "--mode", 1)
    stored = read_cut(folder)[0]
    assert stored.dtype == np.int16
    factor = (stored * exact).sum() / (exact ** 2).sum()
    np.testing.assert_allclose(stored, factor * exact, atol=1)


# ---------------------------------------------------------------------------------------- levelling

PITCH, X_TILT = 7.0, 4.0


@pytest.fixture(scope="module")
def tilted():
    """Returns a folder with a model whose views are of a specimen with a pitch and an x-axis tilt
    that its files do not state."""
    folder = harness.fresh_directory("tilted")
    reconstruct(folder, x_tilt=X_TILT, pitch=PITCH)
    return folder


def spots(volume):
    """Returns the beads of a volume as zero-based indices, each near one of PLACES."""
    boxes = [volume[z - 4:z + 5, y - 4:y + 5, x - 4:x + 5]
             for x, y, z in PLACES.round().astype(int)]
    return bead_places(np.array(boxes)) + PLACES.round() - 4


def levelled(folder, *arguments):
    harness.succeed("export", "TS_01.h5", "-o", "level.mrc", "--overwrite", *arguments, cwd=folder)
    return harness.read_volume(os.path.join(folder, "level.mrc"))


def test_a_levelled_volume_has_the_specimen_where_it_is(tilted):
    assert np.abs(spots(levelled(tilted)) - PLACES).max() > 1
    volume = levelled(tilted, "--level", f"{PITCH},{-X_TILT}")
    assert volume.shape == tuple(SIZE[::-1])
    np.testing.assert_allclose(spots(volume), PLACES, atol=0.4)


def alignment_record(pose, tilts=TILTS):
    """Returns the record of an alignment of views at these angles that found this pose."""
    views = [{"section": i + 1, "tilt_deg": tilt, "shift_px": [0, 0], "rotation_deg": 0,
              "log_magnification": 0, "tilt_change_deg": 0, "correlation": 0.9,
              "shift_error_px": [0.1, 0.1], "left_out": False} for i, tilt in enumerate(tilts)]
    series = {"sections": len(views), "size_px": [WIDTH, HEIGHT], "files": {}, "header_tilts": "0",
              "pixels": "0"}
    return {"made_with": {}, "series": series, "accepted": True, "rotation": True,
            "magnification": True, "tilt": True, "steps_px": [0.1], "seconds": 1, "views": views,
            "held_out_error": {"before": 0.5, "after": 0.4},
            "gain": {"mean": 0.1, "standard_error": 0.01}, "pose": pose}


def test_what_the_alignment_found_levels_the_volume(tilted, scratch):
    shutil.copy(os.path.join(tilted, "TS_01.h5"), scratch)
    refused = harness.tomofield("export", "TS_01.h5", "-o", "level.mrc", "--level", "found",
                                cwd=scratch)
    assert refused.returncode == 2
    assert "TS_01_align.json" in refused.stderr and "--level PITCH,X_TILT" in refused.stderr
    for errors, level in (((1, 0.5), f"{PITCH},{-X_TILT}"), ((1, 1.2), f"{PITCH},0"), ((2, 1.2), None)):
        pose = {"pitch_deg": PITCH, "pitch_error_deg": errors[0], "x_tilt_deg": -X_TILT,
                "x_tilt_error_deg": errors[1], "thickness_px": 20, "thickness_error_px": 2}
        with open(os.path.join(scratch, "TS_01_align.json"), "w", encoding="utf-8") as file:
            json.dump(alignment_record(pose), file)
        if level is None:  # the views are sure of neither angle
            refused = harness.tomofield("export", "TS_01.h5", "-o", "unsure.mrc", "--level", "found",
                                        cwd=scratch)
            assert refused.returncode == 2 and "standard errors" in refused.stderr, refused.stderr
        else:
            np.testing.assert_array_equal(levelled(scratch, "--level", "found"),
                                          levelled(scratch, "--level", level))
    pose.update(pitch_error_deg=1)
    with open(os.path.join(scratch, "TS_01_align.json"), "w", encoding="utf-8") as file:
        json.dump(alignment_record(pose, TILTS[::2]), file)
    refused = harness.tomofield("export", "TS_01.h5", "-o", "other.mrc", "--level", "found",
                                cwd=scratch)
    assert refused.returncode == 2, refused
    for part in ("TS_01_align.json", "another series", f"{TILTS[1]:.2f}°"):
        assert part in refused.stderr, refused.stderr


def test_boxes_and_particles_lie_in_the_levelled_volume(tilted):
    level = ["--level", f"{PITCH},{-X_TILT}"]
    whole = levelled(tilted, *level)
    part = levelled(tilted, *level, "--box", "20,16,6,40,30,18")
    np.testing.assert_allclose(part, whole[6:18, 16:30, 20:40], atol=1e-5 * np.ptp(whole))
    particles = write_particles(tilted)
    cut_out(tilted, "--particles", particles, "--box", 11, *level)
    np.testing.assert_allclose(bead_places(read_cut(tilted)[0]), 5, atol=0.4)


@pytest.mark.parametrize("level", ("3", "3,x", "95,0", "1,2,3", "nan,0"))
def test_angles_that_make_no_sense_are_refused(tilted, level):
    refused = harness.tomofield("export", "TS_01.h5", "-o", "level.mrc", "--overwrite",
                                f"--level={level}", cwd=tilted)
    assert refused.returncode == 2 and "--level" in refused.stderr and level in refused.stderr
