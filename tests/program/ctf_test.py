"""Tests reconstructions of views that a microscope filtered: --ctf, --defocus and the doses."""

import json
import os

import harness
import numpy as np
import pytest

SIZE = 64
FIT = ["--epochs", 6, "--coarse-epochs", 60, "--tv-penalty", "smooth", "--tv", 5, "--view-scale", "off",
       "--black-level", 0, "--bead-diameter", 0]


class Filtered:
    """A series with a contrast transfer and radiation damage, and runs on it."""

    def __init__(self, name, *imaging):
        self.folder = os.path.join(harness.fresh_directory(name), "cell")
        harness.succeed("simulate", self.folder, "--size", SIZE, "--yardstick", "a", "--noise", 0.02,
                        "--seed", 31, *imaging)
        self.truth = harness.read_volume(self.path("truth.mrc"))
        self.transfer = ["--ctf", self.path("tilt_series_ctf.txt"), "--mdoc", self.path("tilt_series.mdoc")]

    def path(self, name):
        return os.path.join(self.folder, name)

    def arguments(self, output, *options):
        return ["reconstruct", self.path("tilt_series.mrc"), "--tlt", self.path("tilt_series.tlt"),
                "--thickness", len(self.truth), "--contrast", "bright", "--no-margin", "--overwrite",
                "-o", self.path(output), *harness.merge(FIT, options)]

    def run(self, output, *options):
        return harness.succeed(*self.arguments(output, *options))

    def volume(self, output):
        return harness.read_volume(self.path(output))

    def psnr(self, output):
        """Returns the PSNR against the truth at the best scale and offset, in dB."""
        found = self.volume(output).ravel().astype(float)
        truth = self.truth.ravel().astype(float)
        scale, offset = np.polyfit(found, truth, 1)
        error = np.mean((scale * found + offset - truth) ** 2)
        return 10 * np.log10(np.ptp(truth) ** 2 / error)


@pytest.fixture(scope="module", name="series")
def make_series():
    return Filtered("ctf", "--voxel-size", 8, "--defocus", "3:5", "--dose-per-tilt", 1)


@pytest.fixture(scope="module", name="modelled")
def make_modelled(series):
    """Reconstructs with the contrast transfer and the doses."""
    return series.run("modelled.mrc", *series.transfer)


def test_the_contrast_transfer_gains_decibels(series, modelled):
    assert "ctf: the defocus of each view from" in modelled.stderr
    assert "dose: from" in modelled.stderr
    series.run("ignored.mrc")
    # At this size the border, where a mirror image stands for what is not known, counts for much.
    assert series.psnr("modelled.mrc") > series.psnr("ignored.mrc") + 1


def test_a_wrong_defocus_predicts_held_out_views_worse(series):
    def held_out(output, *options):
        series.run(output, "--hold-out", 8, *options)
        with open(series.path(output)[:-4] + ".json", encoding="utf-8") as file:
            return json.load(file)["metrics"]["held_out"]["error"]
    right = held_out("right.mrc", *series.transfer)
    wrong = held_out("wrong.mrc", "--defocus", 8, "--mdoc", series.path("tilt_series.mdoc"))
    assert right < 0.9 * wrong


@pytest.mark.usefixtures("modelled")
def test_threads_change_no_bit(series):
    series.run("one.mrc", *series.transfer, "--threads", 1)
    np.testing.assert_array_equal(series.volume("one.mrc"), series.volume("modelled.mrc"))


@pytest.mark.usefixtures("modelled")
def test_stopping_and_resuming_change_no_bit(series):
    command = [word for word in series.arguments("resumed.mrc", *series.transfer)
               if word != "--overwrite"]
    harness.finish_with_stops([*command, "--resume"], lambda: None, most=3)
    np.testing.assert_array_equal(series.volume("resumed.mrc"), series.volume("modelled.mrc"))


def metrics(series, output):
    with open(series.path(output)[:-4] + ".json", encoding="utf-8") as file:
        return json.load(file)["metrics"]


@pytest.mark.usefixtures("modelled")
def test_the_verdict_tells_a_wrong_defocus(series):
    right = metrics(series, "modelled.mrc")["verdict"]["defocus"]
    scaled = series.path("scaled.txt")
    with open(series.path("tilt_series_ctf.txt"), encoding="utf-8") as file:
        lines = file.readlines()
    with open(scaled, "w", encoding="utf-8") as file:
        for line in lines:
            words = line.split()
            if not line.startswith("#"):
                words[1:3] = [str(1.15 * float(word)) for word in words[1:3]]
            file.write(" ".join(words) + "\n")
    series.run("scaled.mrc", "--ctf", scaled, "--mdoc", series.path("tilt_series.mdoc"))
    wrong = metrics(series, "scaled.mrc")["verdict"]["defocus"]
    assert wrong["error"] < right["error"] - 0.03, (right, wrong)
    assert wrong["rings"] > right["rings"], (right, wrong)


def test_the_verdict_tells_the_wrong_hand_of_the_defocus():
    # Its slope tells most with small pixels and little defocus, whose fringes stay in the view.
    series = Filtered("hand", "--voxel-size", 1.2, "--defocus", "0.2:0.4")
    transfer = ["--ctf", series.path("tilt_series_ctf.txt"), "--defocus-hand"]
    assert "warning: the defocus across" not in series.run("right.mrc", *transfer, 1).stderr
    assert abs(metrics(series, "right.mrc")["verdict"]["defocus"]["slope"]["error"]) < 0.5
    assert "give --defocus-hand with the other sign" in series.run("left.mrc", *transfer, -1).stderr
    assert metrics(series, "left.mrc")["verdict"]["defocus"]["slope"]["error"] < -0.5


def test_coloured_noise_gains_and_resumes_to_the_bit():
    folder = os.path.join(harness.fresh_directory("coloured"), "cell")
    harness.succeed("simulate", folder, "--size", SIZE, "--yardstick", "a", "--noise", 0.1,
                    "--noise-blur", 1, "--seed", 31)
    series = Filtered.__new__(Filtered)
    series.folder = folder
    series.truth = harness.read_volume(series.path("truth.mrc"))
    series.run("white.mrc")
    series.run("coloured.mrc", "--noise-model", "coloured")
    assert series.psnr("coloured.mrc") > series.psnr("white.mrc") + 0.2
    command = [word for word in series.arguments("resumed.mrc", "--noise-model", "coloured")
               if word != "--overwrite"]
    harness.finish_with_stops([*command, "--resume"], lambda: None, most=3)
    np.testing.assert_array_equal(series.volume("resumed.mrc"), series.volume("coloured.mrc"))


def test_baselines_correct_the_contrast_transfer(series):
    def psnr(output, *options):
        harness.succeed("baseline", "sirt", series.path("tilt_series.mrc"), "--tlt",
                        series.path("tilt_series.tlt"), "--thickness", len(series.truth), "--contrast",
                        "bright", "--no-margin", "--overwrite", "-o", series.path(output), *options)
        return series.psnr(output)
    ignored = psnr("sirt.mrc")
    flipped = psnr("flipped.mrc", *series.transfer)
    wiener = psnr("wiener.mrc", *series.transfer, "--ctf-correction", "wiener")
    assert abs(flipped - ignored) > 1e-3
    assert wiener > ignored, (ignored, flipped, wiener)


def test_views_are_aligned_with_filtered_projections(series):
    series.run("aligned.mrc", *series.transfer, "--align", "refine")
    with open(series.path("aligned_align.json"), encoding="utf-8") as file:
        views = json.load(file)["views"]
    shifts = np.array([view["shift_px"] for view in views])
    assert np.sqrt(np.mean(shifts ** 2)) < 0.5, shifts


def test_files_of_another_stack_are_refused(series):
    short = series.path("short.txt")
    with open(series.path("tilt_series_ctf.txt"), encoding="utf-8") as file:
        lines = file.readlines()
    with open(short, "w", encoding="utf-8") as file:
        file.writelines(lines[:-1])
    result = harness.tomofield(*series.arguments("short.mrc", "--ctf", short))
    assert result.returncode == 2 and "give the file of this stack" in result.stderr, result.stderr
    result = harness.tomofield(*series.arguments("both.mrc", *series.transfer, "--defocus", 3))
    assert result.returncode == 2 and "give one of them" in result.stderr, result.stderr
