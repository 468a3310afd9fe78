"""Series of RELION and Warp: what they mean, what is refused, and what is written back."""

import json
import os
import pathlib
import shutil

import harness
import mrcfile
import numpy as np
import pytest
import star_projects
from harness import HEIGHT, PIXEL_SIZE, THICKNESS, TILTS, WIDTH
from star_projects import SHIFTS_PX


class RelionProject:
    """A project folder of RELION 5, and runs on it."""

    def __init__(self, series):
        self.folder = harness.fresh_directory("relion")
        self.star = star_projects.write_relion(self.folder, series)

    def path(self, name):
        return os.path.join(self.folder, name)

    def run(self, *options, run=harness.succeed, cwd=None):
        output = self.path("out.mrc")
        result = run("reconstruct", self.star, "-o", output, "--overwrite",
                     *harness.merge(QUICK, options), cwd=cwd or self.folder)
        return result, output


# The views are plain projections, whatever defocus their table has.
QUICK = [*(word for word in harness.QUICK if word not in ("--thickness", THICKNESS)), "--ctf", "none"]


def agreement(volume, truth):
    return np.corrcoef(volume.ravel(), truth.ravel())[0, 1]


@pytest.fixture(scope="module")
def series():
    return harness.Series("series")


@pytest.fixture(scope="module")
def plain(series):
    return series.reconstruct("plain")


@pytest.fixture(scope="module")
def relion(series):
    return RelionProject(series)


@pytest.fixture(scope="module")
def finished(relion):
    return relion.run("--series", "TS_01")


def test_a_project_of_relion_is_reconstructed(series, plain, finished):
    result, output = finished
    for setting in ("rlnTomoTiltSeriesStarFile", "--pixel-size 13.37", "rlnTomoSizeZ"):
        assert setting in result.stdout, result.stdout
    assert "rlnDefocusU (not used: --ctf none is given)" in result.stdout, result.stdout
    volume = harness.read_volume(output)
    assert volume.shape == (THICKNESS, HEIGHT, WIDTH)
    # The fill at the edges of shifted views and their interpolation cost a little.
    assert agreement(volume, series.truth) > agreement(plain.volume, series.truth) - 0.02
    assert agreement(volume, plain.volume) > 0.97


def test_the_defocus_of_a_project_is_used(relion, finished):
    output = relion.path("filtered.mrc")
    options = [word for word in QUICK if word not in ("--ctf", "none")]
    command = ["reconstruct", relion.star, "--series", "TS_01", "--overwrite", "-o", output, *options]
    result = harness.succeed(*command, cwd=relion.folder)
    assert "ctf: the defocus of each view from" in result.stderr, result.stderr
    assert "dose: from" in result.stderr, result.stderr
    for setting in ("--voltage 200", "--amplitude-contrast 0.1", "--defocus-hand -1"):
        assert setting in result.stdout, result.stdout
    assert not np.array_equal(harness.read_volume(output), harness.read_volume(finished[1]))
    # One defocus in place of those of the table.
    result = harness.succeed(*command, "--defocus", 3, cwd=relion.folder)
    assert "(not used: --defocus 3 is given)" in result.stdout, result.stdout


def test_a_view_without_defocus_may_be_excluded(series):
    folder = harness.fresh_directory("relion_gap")
    star = star_projects.write_relion(folder, series)
    table = pathlib.Path(folder, "Tomograms/job009/tilt_series/TS_01.star")
    lines = table.read_text(encoding="utf-8").splitlines()
    rows = [i for i, line in enumerate(lines) if "TS_01_" in line]
    lines[rows[3]] = lines[rows[3]].replace("30000", "None")
    table.write_text("\n".join(lines) + "\n", encoding="utf-8")

    def dry(*options):
        said = harness.succeed("reconstruct", star, "--series", "TS_01", "--dry-run", "-o", "out.mrc",
                               *options, cwd=folder)
        return said.stdout + said.stderr

    assert "row 4, so its contrast transfer is not applied" in dry()
    excluded = dry("--exclude", 4)
    assert "not applied" not in excluded and "--ctf Tomograms/job009/tilt_series/TS_01.star" in excluded
    assert "not applied" not in dry("--exclude", 4, "--ctf", table)


def test_the_detector_of_a_project_may_be_left_out(series):
    folder = harness.fresh_directory("relion_mtf")
    star = pathlib.Path(star_projects.write_relion(folder, series))
    text = star.read_text(encoding="utf-8").replace("_rlnTomoSizeZ #10", "_rlnTomoSizeZ #10 \n_rlnMtfFileName #11")
    star.write_text(text.replace(f" {THICKNESS} \n", f" {THICKNESS} absent_mtf.star \n"), encoding="utf-8")
    command = ["reconstruct", star, "--series", "TS_01", "--dry-run", "-o", "out.mrc"]
    refused = harness.tomofield(*command, cwd=folder)
    assert refused.returncode == 2 and "--ignore rlnMtfFileName" in refused.stderr, refused.stderr
    harness.succeed(*command, "--ctf", "none", cwd=folder)


def test_the_result_goes_back_to_relion(relion, finished):
    _, output = finished
    (row,) = star_projects.read_rows(output[:-4] + ".star")
    before = star_projects.read_rows(relion.star)[0]
    sizes = {"rlnTomoSizeX": WIDTH, "rlnTomoSizeY": HEIGHT, "rlnTomoSizeZ": THICKNESS}
    assert {name: value for name, value in row.items() if name in before} == {
        **before, **{name: str(size) for name, size in sizes.items()}}
    assert float(row["rlnTomoTomogramBinning"]) == 1
    for name in ("rlnTomoReconstructedTomogram", "rlnTomoDenoisedTomogram",
                 "rlnTomoReconstructedTomogramDenoised"):
        assert row[name] == output
    assert "rlnTomoReconstructedTomogramHalf1" not in row


def test_relion_gets_linear_halves_or_none(relion):
    """Programs train with the halves of a row, whose errors must be independent."""
    columns = [f"rlnTomoReconstructedTomogramHalf{half}" for half in (1, 2)]
    foreign = relion.path("with_halves.star")
    rows = star_projects.read_rows(relion.star)
    for row in rows:
        row.update(dict.fromkeys(columns, "tomograms/of_another_program.mrc"))
    cells = [[f'"{value}"' for value in row.values()] for row in rows]
    star_projects.write_star(foreign, "global", list(rows[0]), cells)
    for options in ([], ["--denoising-halves"]):
        output = relion.path("halves.mrc")
        command = ["reconstruct", foreign, "--series", "TS_01", "--split-tilts", "--overwrite",
                   "-o", output, *QUICK, *options]
        harness.succeed(*command, cwd=relion.folder)
        (row,) = star_projects.read_rows(output[:-4] + ".star")
        assert row["rlnTomoReconstructedTomogram"] == output
        linear = [f"{output[:-4]}_wbp_{half}_Vol.mrc" for half in ("EVN", "ODD")]
        if options:
            assert [row[column] for column in columns] == linear
            assert harness.read_volume(linear[0]).shape == harness.read_volume(output).shape
        else:
            assert not set(columns) & set(row)


def test_sizes_for_relion_are_unbinned(relion, finished):
    result, output = relion.run("--series", "TS_01", "--bin", 2, "--alignment-json")
    (row,) = star_projects.read_rows(output[:-4] + ".star")
    assert float(row["rlnTomoTomogramBinning"]) == 2
    assert [row["rlnTomoSize" + axis] for axis in "XYZ"] == [
        str(size) for size in (WIDTH, HEIGHT, THICKNESS)]
    with open(output[:-4] + "_alignment.json", encoding="utf-8") as file:
        alignment = json.load(file)
    check_portal_alignment(alignment)
    # A part of the specimen has no row in RELION's terms.
    result, output = relion.run("--series", "TS_01", "--roi", "5,3,40,30")
    assert "no STAR file" in result.stderr, result.stderr


@pytest.mark.parametrize("options", [["--tilt-offset", 5], ["--x-axis-tilt", 5], ["--tlt", "other.tlt"],
                                     ["--pixel-size", 1.1 * PIXEL_SIZE]])
def test_a_tomogram_that_the_projects_table_does_not_describe_has_no_row(relion, options):
    np.savetxt(relion.path("other.tlt"), TILTS + 2)
    result, output = relion.run("--series", "TS_01", *options)
    assert "no STAR file is written for RELION" in result.stderr, result.stderr
    assert not os.path.exists(output[:-4] + ".star")


def test_shifts_count_in_the_pixels_of_the_project(relion):
    """A pixel size that was calibrated again leaves the alignment as it is."""
    def offsets(*options):
        _, output = relion.run("--series", "TS_01", "--alignment-json", *options)
        with open(output[:-4] + "_alignment.json", encoding="utf-8") as file:
            sections = json.load(file)["per_section_alignment_parameters"]
        return [(section["x_offset"], section["y_offset"]) for section in sections]

    np.testing.assert_allclose(offsets("--pixel-size", 1.1 * PIXEL_SIZE), offsets(), atol=1e-6)
    _, output = relion.run("--series", "TS_01", "--pixel-size", PIXEL_SIZE)
    assert os.path.exists(output[:-4] + ".star"), "the pixels are those of the project"


def test_shifts_of_warp_count_in_the_pixels_of_its_averages(series):
    folder = harness.fresh_directory("warp_pixels")
    for table in star_projects.write_warp(folder, series):
        volumes = []
        for options in ([], ["--pixel-size", 1.25 * PIXEL_SIZE]):
            output = os.path.join(folder, "out.mrc")
            harness.succeed("baseline", "wbp", table, "-o", output, "--overwrite", "--contrast", "bright",
                            "--ctf", "none", "--thickness", THICKNESS, *options)
            volumes.append(harness.read_volume(output))
        assert agreement(*volumes) > 0.9999, table


def test_names_in_a_row_begin_in_the_projects_folder(relion):
    """A run may start elsewhere, and write there."""
    outside = harness.fresh_directory("relion_outside")
    for output, name in ((relion.path("inside.mrc"), "inside.mrc"),
                         (os.path.join(outside, "far.mrc"), os.path.join(outside, "far.mrc"))):
        harness.succeed("reconstruct", relion.star, "--series", "TS_01", "-o",
                        os.path.relpath(output, outside), "--thickness", THICKNESS, *QUICK, cwd=outside)
        (row,) = star_projects.read_rows(output[:-4] + ".star")
        assert row["rlnTomoReconstructedTomogram"] == row["rlnTomoDenoisedTomogram"] == name, row
        assert os.path.exists(relion.path(row["rlnTomoTiltSeriesStarFile"]))


def test_halves_of_a_table_may_be_named_from_any_folder(relion):
    folder = os.path.join(relion.folder, "deep/er")
    os.makedirs(folder, exist_ok=True)
    table = "../../Tomograms/job009/tilt_series/TS_01.star"
    said = harness.tomofield("reconstruct", relion.star, "--series", "TS_01", "--dry-run", "--even",
                             f"even@{table}", "--odd", f"odd@{table}", "-o", "x.mrc", cwd=folder).stderr
    assert "one file" not in said and "names no image of the even frames" in said, said


def test_a_tilt_axis_beside_a_table_that_aligns_the_views_is_refused(relion):
    result, _ = relion.run("--series", "TS_01", "--tilt-axis", 30, run=harness.tomofield)
    assert result.returncode == 2 and "leave --tilt-axis out" in result.stderr, result.stderr


@pytest.mark.parametrize("options", [["--bin", 2], ["--bin", 4], ["--bin", 2, "--axes", "xzy"],
                                     ["--bin", 2, "--shift-z", 4], ["--angpix", 1.7 * PIXEL_SIZE]])
def test_the_axis_is_in_the_middle_of_the_volume_at_any_bin(relion, options):
    _, output = relion.run("--series", "TS_01", "--thickness", 33, "--alignment-json", *options)
    with open(output[:-4] + "_alignment.json", encoding="utf-8") as file:
        offset = json.load(file)["volume_offset"]
    assert abs(offset["z"] - (-4 * PIXEL_SIZE if "--shift-z" in options else 0)) < 1e-3, offset


def test_a_new_alignment_goes_back_to_relion(relion):
    wrong_px = np.random.default_rng(5).normal(0, 1, SHIFTS_PX.shape)
    names = [f"{i + 1:06d}@stacks/TS_02.mrcs" for i in range(len(TILTS))]
    star_projects.write_relion_views(relion.folder, "TS_02", names, wrong_px * PIXEL_SIZE)
    _, output = relion.run("--series", "TS_02", "--align", "refine", "--exclude", 3,
                           "--alignment-json")
    aligned = output[:-4] + "_align.star"
    rows = star_projects.read_rows(aligned)
    kept = np.delete(np.arange(len(TILTS)), 2)
    assert [row["rlnMicrographName"] for row in rows] == [names[i] for i in kept]
    assert {row["rlnDefocusV"] for row in rows} == {"29000"}
    angles = np.array([[float(row[f"rlnTomo{name}"]) for name in ("XTilt", "YTilt", "ZRot")]
                       for row in rows])
    np.testing.assert_allclose(angles[:, :2], np.stack([0 * kept, TILTS[kept]], axis=1), atol=1e-6)
    assert np.abs(angles[:, 2]).max() < 2
    shifts_px = np.array([[float(row["rlnTomoXShiftAngst"]), float(row["rlnTomoYShiftAngst"])]
                          for row in rows]) / PIXEL_SIZE
    left = rms_error(shifts_px - star_projects.LISTED_A[kept] / PIXEL_SIZE, TILTS[kept])
    assert left < 0.4 * rms_error(wrong_px[kept], TILTS[kept]), left
    with open(output[:-4] + "_alignment.json", encoding="utf-8") as file:
        sections = json.load(file)["per_section_alignment_parameters"]
    turned = [np.array(section["in_plane_rotation"]) @ (section["x_offset"], section["y_offset"])
              for section in sections]
    np.testing.assert_allclose(turned, shifts_px + star_projects.HALF_PX[kept, None] * [1, 0],
                               atol=0.05)
    # The row of the tomogram names the new alignment, which gives the same tomogram.
    (row,) = star_projects.read_rows(output[:-4] + ".star")
    assert row["rlnTomoTiltSeriesStarFile"] == aligned
    again = relion.path("again.mrc")
    harness.succeed("reconstruct", aligned, "-o", again, "--thickness", THICKNESS, "--pixel-size",
                    PIXEL_SIZE, *QUICK, cwd=relion.folder)
    assert agreement(harness.read_volume(again), harness.read_volume(output)) > 0.99
    star_projects.write_relion_views(relion.folder, "TS_02", names)


def rms_error(shifts_px, tilts_deg):
    """Returns what is left of shifts when a shift of the specimen is removed."""
    tilts = np.radians(tilts_deg)
    specimen = np.stack([np.cos(tilts), np.sin(tilts)], axis=1)
    x = shifts_px[:, 0] - specimen @ np.linalg.lstsq(specimen, shifts_px[:, 0], rcond=None)[0]
    return np.sqrt(np.mean(x**2 + (shifts_px[:, 1] - shifts_px[:, 1].mean())**2))


def check_portal_alignment(alignment):
    """Checks the JSON against the definition of the portal: offsets in unbinned pixels, after the
    rotation, about the middle of the views."""
    sections = alignment["per_section_alignment_parameters"]
    assert [section["z_index"] for section in sections] == list(range(len(TILTS)))
    np.testing.assert_allclose([section["tilt_angle"] for section in sections], TILTS)
    offsets = [(section["x_offset"], section["y_offset"]) for section in sections]
    np.testing.assert_allclose(offsets, SHIFTS_PX, atol=1e-9)
    for section in sections:
        np.testing.assert_allclose(section["in_plane_rotation"], np.eye(2), atol=1e-12)
        assert section["volume_x_rotation"] == 0
    size = np.array([WIDTH, HEIGHT, THICKNESS]) * PIXEL_SIZE
    np.testing.assert_allclose([alignment["volume_dimension"][a] for a in "xyz"], size, rtol=1e-6)
    np.testing.assert_allclose([alignment["volume_offset"][a] for a in "xyz"], 0, atol=1e-3)


def test_a_star_file_that_would_be_replaced_is_refused(relion):
    output = relion.star[:-5] + ".mrc"
    result = harness.tomofield("reconstruct", relion.star, "--series", "TS_01", "-o", output,
                               "--overwrite", *QUICK, cwd=relion.folder)
    assert result.returncode == 2 and "would replace the input" in result.stderr, result.stderr
    assert not os.path.exists(output)


def test_names_are_looked_for_from_the_project(relion, finished):
    _, output = relion.run("--series", "TS_02", cwd=harness.SCRATCH)
    np.testing.assert_array_equal(harness.read_volume(output).shape,
                                  (THICKNESS, HEIGHT, WIDTH))


def test_one_of_several_tomograms_is_asked_for(relion):
    for options, words in (([], ["TS_01, TS_02", "--series"]), (["--series", "TS_3"], ["TS_3"])):
        result, _ = relion.run(*options, run=harness.tomofield)
        assert result.returncode == 2 and all(word in result.stderr for word in words), result.stderr


def test_the_row_of_the_series_is_taken_though_others_name_the_same_file(relion):
    twice = relion.path("Tomograms/job009/twice.star")
    with open(relion.star, encoding="utf-8") as file:
        text = file.read().replace("tilt_series/TS_02.star", "tilt_series/TS_01.star")
    with open(twice, "w", encoding="utf-8") as file:
        file.write(text)
    output = relion.path("second.mrc")
    harness.succeed("reconstruct", twice, "--series", "TS_02", "-o", output, *QUICK, cwd=relion.folder)
    (row,) = star_projects.read_rows(output[:-4] + ".star")
    assert row["rlnTomoName"] == "TS_02"


def write_changed(relion, name, old, new):
    """Writes the project's STAR file with another text in it beside it, and returns its path."""
    path = pathlib.Path(relion.path("Tomograms/job009"), name)
    text = pathlib.Path(relion.star).read_text(encoding="utf-8")
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


def test_a_name_that_two_rows_have_is_refused(relion):
    path = write_changed(relion, "same_names.star", "TS_02 ", "TS_01 ")
    result = harness.tomofield("reconstruct", path, "--series", "TS_01", "-o", relion.path("same.mrc"),
                               *QUICK, cwd=relion.folder)
    assert result.returncode == 2 and "several rows" in result.stderr, result.stderr


@pytest.mark.parametrize("hand", ("0.5", "0", "-2"))
def test_a_hand_that_is_none_is_refused(relion, hand):
    path = write_changed(relion, "hand.star", "1.00000", hand)
    result = harness.tomofield("reconstruct", path, "--series", "TS_01", "--dry-run", cwd=relion.folder)
    assert result.returncode == 2, result
    for word in ("hand.star", "TS_01", "rlnTomoHand", hand):
        assert word in result.stderr, (word, result.stderr)


def test_a_number_beyond_its_range_is_refused_with_its_file(relion):
    path = write_changed(relion, "voltage.star", "200.000000", "-1.000000")
    result = harness.tomofield("reconstruct", path, "--series", "TS_01", "--dry-run", cwd=relion.folder)
    assert result.returncode == 2, result
    for word in ("voltage.star", "rlnVoltage", "--voltage must be"):
        assert word in result.stderr, (word, result.stderr)


def test_one_series_has_no_name_to_choose(relion):
    views = relion.path("Tomograms/job009/tilt_series/TS_01.star")
    result = harness.tomofield("reconstruct", views, "--series", "TS_02", "-o", relion.path("no.mrc"),
                               *QUICK, cwd=relion.folder)
    assert result.returncode == 2 and "is one series" in result.stderr, result.stderr


def test_a_missing_image_is_named(relion):
    star_projects.write_relion_views(relion.folder, "TS_02", ["gone/a.mrc"] * len(TILTS))
    result, _ = relion.run("--series", "TS_02", run=harness.tomofield)
    assert result.returncode == 2 and "gone/a.mrc" in result.stderr, result.stderr
    info = harness.tomofield("info", relion.path("Tomograms/job009/tilt_series/TS_01.star"))
    assert info.returncode == 0 and "48 × 36" in info.stdout + info.stderr, info


def test_series_of_warp(series, plain):
    folder = harness.fresh_directory("warp")
    tomostar, xml = star_projects.write_warp(folder, series)
    volumes = []
    for source, options in ((tomostar, ["--thickness", THICKNESS]), (xml, [])):
        output = os.path.join(folder, "out.mrc")
        harness.succeed("reconstruct", source, "-o", output, "--overwrite", *QUICK, *options,
                        cwd=folder)
        volumes.append(harness.read_volume(output))
    np.testing.assert_array_equal(*volumes)
    assert agreement(volumes[0], plain.volume) > 0.97


def test_no_result_replaces_an_image_that_a_table_lists(series, plain):
    folder = harness.fresh_directory("listed_images")
    star = star_projects.write_relion(folder, series)
    table = os.path.join(folder, "Tomograms/job009/tilt_series/TS_02.star")
    images = os.path.join(folder, "stacks/TS_02.mrcs")
    other = os.path.join(os.path.dirname(table), "TS_01.mrc")
    volume = os.path.join(folder, "volume.mrc")
    shutil.copy(plain.volume_path, volume)
    for words in (["evaluate", volume, "--series", table, "--contrast", "bright",
                   "--no-margin", "--json", images],
                  ["reconstruct", star, "--series", "TS_02", *QUICK, "-o", other]):
        said = harness.tomofield(*words, "--overwrite", cwd=folder)
        assert said.returncode == 2 and "would replace the input" in said.stderr, said.stderr


def edit_xml(path, old, new):
    """Replaces a part of Warp's XML, which it must have."""
    with open(path, encoding="utf-16") as file:
        text = file.read()
    assert old in text, (old, text)
    with open(path, "w", encoding="utf-16") as file:
        file.write(text.replace(old, new))


def test_the_pixel_size_of_warp_counts_where_its_averages_have_none(series):
    folder = harness.fresh_directory("warp_pixels")
    _, xml = star_projects.write_warp(folder, series)
    edit_xml(xml, "</TiltSeries>", '<CTF><Param Name="PixelSize" Value="5" /></CTF></TiltSeries>')
    assert "--pixel-size" not in harness.succeed("info", xml, cwd=folder).stdout
    averages = os.path.join(folder, "warp_frameseries/average")
    for name in os.listdir(averages):
        with mrcfile.open(os.path.join(averages, name), "r+") as file:
            file.voxel_size = 0
    printed = harness.succeed("info", xml, cwd=folder).stdout
    assert "--pixel-size 5 from" in printed, printed


def test_the_microscope_of_a_project_counts_beside_a_given_defocus(series):
    """RELION's row, and Warp's XML, also without a defocus of their own."""
    folder = harness.fresh_directory("microscope")
    star = star_projects.write_relion(folder, series)
    _, xml = star_projects.write_warp(folder, series)
    edit_xml(xml, "</TiltSeries>", '<CTF><Param Name="Voltage" Value="200" /><Param Name="Cs" '
             'Value="1.4" /><Param Name="Amplitude" Value="0.1" /></CTF></TiltSeries>')
    wanted = {xml: ("--voltage 200", "--cs 1.4", "--amplitude-contrast 0.1")}
    with open(star, encoding="utf-8") as file:
        text = file.read()
    if "_rlnVoltage" in text:
        wanted[star] = ("--voltage", "--defocus-hand")
    for project, options in wanted.items():
        more = ["--series", "TS_01"] if project == star else []
        for given in (["--defocus", 3], ["--dose-per-tilt", 3]):
            said = harness.succeed("reconstruct", project, *more, *given, "--thickness", THICKNESS, "--dry-run", cwd=folder)
            for option in options if "--defocus" in given else options[:1]:
                assert f"{option} " in said.stdout + said.stderr, (option, said)


def test_an_alignment_beside_a_table_of_views(series):
    """The views that the table leaves out stay so, and a contradiction is said."""
    folder = harness.fresh_directory("replaced")
    _, xml = star_projects.write_warp(folder, series)
    edit_xml(xml, "<UseTilt>True\nTrue", "<UseTilt>True\nFalse")
    transforms = os.path.join(folder, "a.xf")
    with open(transforms, "w", encoding="utf-8") as file:
        file.write("0 -1 1 0 0 0\n" * len(TILTS))
    said = harness.succeed("reconstruct", xml, "--xf", transforms, "--thickness", THICKNESS, "--contrast", "bright",
                           "--dry-run").stderr
    assert f"{len(TILTS) - 1} of {len(TILTS)} sections" in said, said
    assert "turns the views by a tilt axis" in said and "TS_01.xml' states 0.0°" in said, said


def test_oblong_images_beside_a_pixel_size_of_relion_are_named(series):
    folder = harness.fresh_directory("oblong")
    star = star_projects.write_relion(folder, series)
    with mrcfile.open(os.path.join(folder, "stacks/TS_02.mrcs"), "r+") as file:
        file.voxel_size = (PIXEL_SIZE, 2 * PIXEL_SIZE, 1)
    shown = harness.succeed("reconstruct", star, "--series", "TS_02", "--dry-run", cwd=folder)
    assert "square ones of" in shown.stderr, shown.stderr
