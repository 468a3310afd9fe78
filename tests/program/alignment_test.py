"""Tests --align and the command align, from misaligned views to the files of the alignment."""

import glob
import json
import os
import sys

import h5py
import mrcfile
import numpy as np
import pytest

import harness

sys.path.insert(0, os.path.abspath(os.path.join(os.path.dirname(__file__), "../../bench")))

import alignment_score  # pylint: disable=wrong-import-position

SIZE = 64
# A short fit, with nothing left to trials.
FIT = ["--epochs", 2, "--coarse-epochs", 4, "--tv-penalty", "smooth", "--view-scale", "off",
       "--black-level", 0, "--bead-diameter", 0]


def simulate(name, *options, size=SIZE, noise=0.05):
    """Returns the folder of a series of a cell that ends in the field of view."""
    folder = os.path.join(harness.fresh_directory(name), "cell")
    harness.succeed("simulate", folder, "--size", size, "--yardstick", "a", "--noise", noise,
                    "--seed", 21, "--no-truth", *options)
    return folder


def series_of(folder, size=SIZE, bead_diameter_nm=0):
    """Returns the arguments that name a raw series."""
    return [os.path.join(folder, "tilt_series.mrc"), "--tlt", os.path.join(folder, "tilt_series.tlt"),
            "--thickness", size * 75 // 128, "--contrast", "bright", "--bead-diameter", bead_diameter_nm,
            "--no-margin"]


def errors(folder, prefix, size=SIZE):
    """Returns the errors of the alignment in PREFIX.xf, PREFIX.tlt and PREFIX.json."""
    truth, _ = alignment_score.read_truth(folder)
    estimate = alignment_score.Alignment(np.loadtxt(prefix + ".xf"), np.loadtxt(prefix + ".tlt"),
                                         alignment_score.read_local(prefix + ".json"))
    return alignment_score.score(truth, estimate, size)


def record(prefix):
    with open(prefix + ".json", encoding="utf-8") as file:
        return json.load(file)


@pytest.fixture(scope="module", name="shifted")
def make_shifted():
    return simulate("alignment_shifted", "--misalign", 1.5)


def test_align_finds_shifts_and_writes_them_for_other_programs(shifted):
    prefix = os.path.join(shifted, "found_align")
    harness.succeed("align", *series_of(shifted), "-o", os.path.join(shifted, "found.mrc"))
    found = errors(shifted, prefix)
    assert found["x_px"] < 0.15 and found["y_px"] < 0.1, found
    made = record(prefix)
    assert made["accepted"] and made["held_out_error"]["after"] < made["held_out_error"]["before"]
    for extension in (".aln", ".png"):
        assert os.path.getsize(prefix + extension) > 0


def test_full_finds_large_shifts_and_the_axis():
    size = 128
    folder = simulate("alignment_raw", "--misalign", 10, "--misalign-axis", 2, size=size)
    harness.succeed("align", *series_of(folder, size), "--align", "full", "-o",
                    os.path.join(folder, "found.mrc"))
    found = errors(folder, os.path.join(folder, "found_align"), size)
    assert found["x_px"] < 0.3 and found["y_px"] < 0.3, found
    assert abs(found["axis_error_deg"]) < 0.5, found


def test_gold_beads_make_the_direction_of_the_axis_finer():
    size = 96
    folder = simulate("alignment_beads", "--misalign", 1, "--misalign-axis", 0.7, "--gold", 8,
                      "--gold-diameter", 50, size=size, noise=0.02)

    def align(name, bead_diameter_nm):
        harness.succeed("align", *series_of(folder, size, bead_diameter_nm), "-o",
                        os.path.join(folder, f"{name}.mrc"))
        prefix = os.path.join(folder, f"{name}_align")
        return errors(folder, prefix, size), record(prefix)

    without, made_without = align("without", 0)
    found, made = align("with", 4.2)
    assert "beads" not in made_without
    beads = made["beads"]
    assert beads["accepted"] and beads["beads"] >= 3, beads
    assert beads["distance_px"]["after"] < beads["distance_px"]["before"] < 0.7, beads
    assert beads["distance_px"]["before"] < beads["distance_px"]["files"], beads
    assert abs(found["axis_error_deg"]) < 0.1 < abs(without["axis_error_deg"]), (found, without)
    assert found["x_px"] < 0.05 and found["y_px"] < 0.05, found


def test_beads_that_are_too_few_to_follow_are_named():
    folder = simulate("alignment_few_beads", "--misalign", 1, "--gold", 2, "--gold-diameter", 50,
                      noise=0.02)
    log = harness.succeed("align", *series_of(folder, SIZE, 4.2), "-o",
                          os.path.join(folder, "found.mrc")).stderr
    assert "2 beads were found, and the alignment uses none of them" in log, log
    assert "beads" not in record(os.path.join(folder, "found_align"))


def test_views_of_something_else_are_named_and_left_out():
    folder = simulate("alignment_strange", "--misalign", 3)
    with mrcfile.open(os.path.join(folder, "tilt_series.mrc"), mode="r+") as file:
        for view in (30, 52):  # they show another part of the specimen
            file.data[view] = np.roll(file.data[view][::-1, ::-1], 20, axis=0)
    log = harness.succeed("align", *series_of(folder), "--align", "full", "-o",
                          os.path.join(folder, "found.mrc")).stderr
    assert "2 views do not resemble the specimen: the others are aligned again" in log
    assert "sections 31, 53" in log
    prefix = os.path.join(folder, "found_align")
    made = record(prefix)
    assert [view["section"] for view in made["views"]] == list(range(1, len(made["views"]) + 1))
    kept = [number for number, view in enumerate(made["views"]) if not view["left_out"]]
    assert len(kept) == len(made["views"]) - 2
    truth, _ = alignment_score.read_truth(folder)
    estimate = alignment_score.Alignment(np.loadtxt(prefix + ".xf"), np.loadtxt(prefix + ".tlt"))
    found = alignment_score.score(truth.of_views(kept), estimate.of_views(kept), SIZE)
    assert found["x_px"] < 0.3 and found["y_px"] < 0.2, found


def test_a_good_alignment_is_hardly_changed():
    folder = simulate("alignment_good")
    harness.succeed("align", *series_of(folder), "-o", os.path.join(folder, "found.mrc"))
    made = record(os.path.join(folder, "found_align"))
    assert np.sqrt(np.mean(np.square([view["shift_px"] for view in made["views"]]))) < 0.1
    assert "local" not in made and not any("local_px" in view for view in made["views"])


def test_local_motion_is_undone():
    size = 96
    folder = simulate("alignment_motion", "--misalign-local", 1.5, size=size)
    volume, prefix = (os.path.join(folder, name) for name in ("found.mrc", "found_align"))
    command = ["reconstruct", *series_of(folder, size), *FIT[:-2], "--align", "refine", "-o", volume]
    log = harness.succeed(*command).stderr
    assert "undone: local motion of 1." in log
    made = record(prefix)
    assert made["local"]["accepted"] and made["local"]["size_px"] == [size, size]
    assert made["local"]["held_out_error"]["after"] < 0.5 * made["local"]["held_out_error"]["before"]
    truth, _ = alignment_score.read_truth(folder)
    still = alignment_score.Alignment(alignment_score.unaligned(len(truth.tilts_deg)), truth.tilts_deg)
    before = alignment_score.score(truth, still, size)["local_less_specimen_warp_px"]
    assert errors(folder, prefix, size)["local_less_specimen_warp_px"] < 0.6 * before
    # A resumed run takes it from the record.
    first = harness.read_bytes(volume)
    os.remove(os.path.join(folder, "found.h5"))
    harness.succeed(*command, "--resume")
    assert harness.read_bytes(volume) == first


def test_reconstruct_takes_the_alignment_and_resumes_from_it(shifted):
    volume = os.path.join(shifted, "made.mrc")
    command = ["reconstruct", *series_of(shifted), *FIT[:-2], "--align", "refine", "-o", volume]
    printed = harness.succeed(*command).stdout
    listed = [word for word in printed.split() if word.startswith(shifted)]
    assert sorted(listed) == sorted(glob.glob(os.path.join(shifted, "made*"))), printed
    first = harness.read_bytes(volume)
    with open(os.path.join(shifted, "made.json"), encoding="utf-8") as file:
        metrics = json.load(file)["metrics"]
    assert metrics["alignment"] == record(os.path.join(shifted, "made_align"))
    assert metrics["verdict"]["seconds"] > metrics["alignment"]["seconds"] + metrics["seconds"]
    with open(os.path.join(shifted, "made_report.html"), encoding="utf-8") as file:
        assert "alignment before the fit" in file.read()
    # The written .xf gives the same tomogram to the rounding of its digits.
    again = os.path.join(shifted, "again.mrc")
    harness.succeed("reconstruct", *series_of(shifted), *FIT[:-2], "--xf",
                    os.path.join(shifted, "made_align.xf"), "-o", again)
    assert harness.psnr(harness.read_volume(again), harness.read_volume(volume)) > 35
    os.remove(os.path.join(shifted, "made.h5"))
    resumed = harness.succeed(*command, "--resume")
    assert "last step" not in resumed.stderr
    assert harness.read_bytes(volume) == first


def test_wrong_tilt_angles_are_found_and_reach_the_files_of_other_programs():
    size = 96
    folder = simulate("alignment_tilts", "--misalign", 1.5, "--misalign-tilt", 0.6, size=size,
                      noise=0.03)
    raw = [argument.replace(".tlt", ".rawtlt") if isinstance(argument, str) else argument
           for argument in series_of(folder, size)]
    prefix, volume = (os.path.join(folder, name) for name in ("found_align", "found.mrc"))
    harness.succeed("reconstruct", *raw, *FIT[:-2], "--align", "refine", "--alignment-json", "-o",
                    volume)
    given = np.loadtxt(os.path.join(folder, "tilt_series.rawtlt"))
    start = np.std(given - np.loadtxt(os.path.join(folder, "tilt_series.tlt")))
    found = errors(folder, prefix, size)
    assert start > 0.5 and found["tilt_deg"] < 0.5 * start, found
    made = record(prefix)
    changes = [view["tilt_change_deg"] for view in made["views"]]
    assert made["tilt"] and abs(np.mean(changes)) < 1e-6
    assert np.allclose(np.loadtxt(prefix + ".tlt"), given + changes, atol=0.006)
    # The CryoET Data Portal has maps to the recorded views.
    with open(volume[:-4] + "_alignment.json", encoding="utf-8") as file:
        sections = json.load(file)["per_section_alignment_parameters"]
    assert np.allclose([section["tilt_angle"] for section in sections], given + changes, atol=1e-6)
    lines = np.loadtxt(prefix + ".xf")
    for section, line in zip(sections, lines):
        inverse = np.linalg.inv(line[:4].reshape(2, 2))
        assert np.allclose(section["in_plane_rotation"], inverse, atol=1e-5)
        assert np.allclose([section["x_offset"], section["y_offset"]], -inverse @ line[4:],
                           atol=0.01)


def test_there_is_no_alignment_without_one(shifted):
    output = os.path.join(shifted, "none.mrc")
    refused = harness.tomofield("align", *series_of(shifted), "--align", "off", "-o", output)
    assert refused.returncode == 2 and "nothing to do with --align off" in refused.stderr
    assert glob.glob(output[:-4] + "*") == []
    text = " ".join(harness.succeed("align", "--help").stdout.split())
    assert "default: refine" in text and "model, metrics" not in text, text


def test_too_few_views_are_refused(shifted):
    refused = harness.tomofield("align", *series_of(shifted), "--exclude", "1-84", "-o",
                                os.path.join(shifted, "few.mrc"))
    assert refused.returncode == 2 and "at least 12 views" in refused.stderr
    assert not os.path.exists(os.path.join(shifted, "few_align.json"))


def test_too_few_views_are_refused_in_the_plan(shifted):
    command = ["reconstruct", *series_of(shifted), *FIT[:-2], "--exclude", "1-84", "--align", "refine",
               "-o", os.path.join(shifted, "few.mrc")]
    for options in (["--dry-run"], ["--plan", os.path.join(shifted, "few_plan.json")]):
        refused = harness.tomofield(*command, *options)
        assert refused.returncode == 2 and "at least 12 views" in refused.stderr, refused


def test_align_asks_for_its_own_results_alone(shifted):
    stack, prefix = os.path.join(shifted, "tilt_series.mrc"), os.path.join(shifted, "tilt_series_align")
    before = harness.read_bytes(stack)
    align = ["align", *series_of(shifted), "-o", stack]  # as its own help says
    harness.succeed(*align)
    assert harness.read_bytes(stack) == before
    made = {extension: harness.read_bytes(prefix + extension)
            for extension in (".json", ".xf", ".tlt", ".aln", ".png")}
    refused = harness.tomofield(*align)
    assert refused.returncode == 2 and "--overwrite" in refused.stderr, refused
    assert prefix in refused.stderr and "--resume" not in refused.stderr, refused
    # A failure at the end leaves all old files: a folder takes the name of one of them meanwhile.
    run = harness.start(*align, "--overwrite", "--seed", 3)
    for line in run.stderr:
        if line.startswith("align "):
            break
    os.remove(prefix + ".png")
    os.mkdir(prefix + ".png")
    _, errors = run.communicate()
    assert run.returncode == 2 and ".png" in errors, errors
    os.rmdir(prefix + ".png")
    made.pop(".png")
    assert {extension: harness.read_bytes(prefix + extension) for extension in made} == made


def test_a_record_of_another_series_or_run_is_refused(shifted):
    volume = os.path.join(shifted, "resumed.mrc")
    stack = os.path.join(shifted, "tilt_series.mrc")
    command = ["reconstruct", *series_of(shifted), *FIT[:-2], "--align", "refine", "-o", volume,
               "--resume"]
    path = os.path.join(shifted, "resumed_align.json")
    harness.succeed(*command[:-1])
    os.remove(os.path.join(shifted, "resumed.h5"))
    good = harness.read_bytes(path)

    def refuse(*changed, words=()):
        refused = harness.tomofield(*changed)
        assert refused.returncode == 2, refused
        for word in (path, "--overwrite", *words):
            assert word in refused.stderr, (word, refused.stderr)

    refuse(*[word for word in command if word != "--no-margin"], words=["other options"])
    refuse(*["full" if word == "refine" else word for word in command], words=["other options"])
    refuse(*command, "--vertex-spacing", 2, words=["other options"])
    for damage in (b"", b"{}", good[:1000], good.replace(b'"section": 1,', b'"section": 0,')):
        with open(path, "wb") as file:
            file.write(damage)
        refuse(*command)
    with open(path, "wb") as file:
        file.write(good)
    with mrcfile.open(stack, mode="r+") as file:
        first = file.data[0].copy()
        file.data[0] += 1
    refuse(*command, words=["another series"])
    with mrcfile.open(stack, mode="r+") as file:
        file.data[0] = first
    harness.succeed(*command)
    check_levelling(volume, path)


def check_levelling(volume, path):
    """A model is levelled by the record of its own alignment alone."""
    with open(path, encoding="utf-8") as file:
        own = json.load(file)
    model = volume.replace(".mrc", ".h5")
    with h5py.File(model) as file:
        stated = json.loads(file["geometry"].attrs["alignment_json"])
    assert stated == {name: own[name] for name in ("series", "made_with")}

    def level(record_of_run):
        with open(path, "w", encoding="utf-8") as file:
            json.dump(record_of_run, file)
        return harness.tomofield("export", model, "-o", volume.replace(".mrc", "_level.mrc"),
                                 "--level", "found", "--overwrite")

    assert "another" not in level(own).stderr
    for section, changes, word in (("series", {"pixels": "0"}, "another series"),
                                   ("series", {"sections": 99}, "99 sections"),
                                   ("made_with", {"seed": 7}, "other options")):
        refused = level({**own, section: {**own[section], **changes}})
        assert refused.returncode == 2, refused
        for part in (path, word, "--level PITCH,X_TILT"):
            assert part in refused.stderr, refused.stderr


def test_a_dry_run_counts_the_alignment(shifted):
    def samples_and_memory(align):
        plan = os.path.join(shifted, f"plan_{align}.json")
        harness.succeed("reconstruct", *series_of(shifted), *FIT[:-2], "--align", align, "-o",
                        os.path.join(shifted, "planned.mrc"), "--plan", plan)
        with open(plan, encoding="utf-8") as file:
            made = json.load(file)
        return made["sample_steps"], made["memory_bytes"]

    without, refine, full = (samples_and_memory(align) for align in ("off", "refine", "full"))
    assert without[0] < refine[0] < full[0] and without[1] < refine[1]
    assert not os.path.exists(os.path.join(shifted, "planned_align.json"))
