"""Tests the help and the options of reconstruct against docs/options.md."""

import json
import os
import pathlib
import re
import shutil

import pytest

import harness

PAGE = pathlib.Path(__file__).resolve().parents[2] / "docs/options.md"
ROW = re.compile(r"^\| `([^`]+)` \|.*\| `([^`]+)` \|$", re.MULTILINE)
COMMON = {"stack", "--tlt", "--xf", "--aln", "--bin", "--contrast", "--thickness", "--roi", "--tune",
          "--align", "--output", "--overwrite", "--resume", "--dry-run", "--threads", "--config",
          "--help", "--help-all", "--denoise", "--ctf", "--defocus", "--mdoc", "--exclude", "--angpix",
          "--invert", "--even", "--odd", "--zarr"}


def flags_of_keys():
    """Returns the flag of every key in docs/options.md."""
    rows = {key: flags.split(",")[-1] for flags, key in ROW.findall(PAGE.read_text("utf-8"))}
    assert len(rows) == 89, len(rows)
    return rows


def options_in(text):
    """Returns the names of the options that a help text describes, each on the left of a line."""
    return {name.split(",")[-1] for name in re.findall(r"^  (-[-\w,]+|stack)\b", text, re.MULTILINE)}


def options_of(results):
    with open(results.json_path, encoding="utf-8") as file:
        return json.load(file)["options"]


def test_help_fits_on_a_screen():
    text = harness.succeed("reconstruct", "--help").stdout
    lines = text.rstrip().splitlines()
    assert len(lines) <= 40 and max(map(len, lines)) <= 100, text
    assert options_in(text) == COMMON, options_in(text) ^ COMMON
    assert "Example: tomofield reconstruct " in text


def test_help_all_has_every_option_of_the_page():
    text = harness.succeed("reconstruct", "--help-all").stdout
    page = set(flags_of_keys().values())
    assert options_in(text) == page | COMMON | {"--trace", "--series", "--plan", "--choice",
                                               "--batch-choice", "--grid"}, options_in(text) ^ page
    assert max(map(len, text.splitlines())) <= 100


COMMANDS = (["reconstruct"], ["align"], ["baseline", "tv"], ["baseline", "tensorf"], ["export"],
            ["view"], ["evaluate"], ["compare"], ["batch"], ["simulate"], ["info"])


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_help_of_every_command_has_its_example_and_whole_phrases(words):
    for flag in ("--help", "--help-all"):
        text = harness.succeed(*words, flag).stdout
        assert f"Example: tomofield {' '.join(words)} " in text, text
        assert text.count("Example: ") == 1, text
        options = text.split("\n\n", 1)[1]
        assert flag == "--help-all" or options.count("(") == options.count(")"), text
        assert not re.search(r"\b(INT|UINT|FLOAT)\b|[:|]\{", text), text


def test_short_help_says_more_than_one_word():
    text = " ".join(harness.succeed("simulate", "--help").stdout.split())
    for part in ("--thickness N Thickness in voxels (default: 150; with --yardstick 75/128 of --size, "
                 "with --yardstick d 1120 Å)", "(with --yardstick d)",
                 "--contrast dark|bright Contrast of the views (default: bright)"):
        assert part in text, text
    assert "--also NAME=COMMAND A method of your own" in " ".join(
        harness.succeed("compare", "--help").stdout.split())
    assert "Smoothness: light, medium" in harness.succeed("reconstruct", "--help").stdout


def test_a_misspelt_command_is_answered_with_the_nearest():
    for words, like in ((["recon"], "reconstruct"), (["evalute"], "evaluate"),
                        (["baseline", "sirtt"], "sirt"), (["zzz"], None)):
        said = harness.tomofield(*words, "x.mrc")
        assert said.returncode == 2, said
        assert ("did you mean" in said.stderr) == (like is not None), said.stderr
        assert like is None or f"(did you mean {like}?)" in said.stderr, said.stderr


def test_help_of_the_program_names_help_all():
    for words in ([], ["--help"], ["--help-all"]):
        text = harness.succeed(*words).stdout
        assert "--help-all" in text and re.search(r"^  reconstruct ", text, re.MULTILINE), text
        assert len(text.rstrip().splitlines()) <= 40, text


def test_an_option_with_its_default_value_is_given():
    series = harness.Series("given")
    results = series.reconstruct("with_bin", *harness.QUICK, "--bin", 1)
    with open(results.volume_path.replace(".mrc", "_report.html"), encoding="utf-8") as file:
        report = file.read()
    row = r"<td[^>]*>{}</td><td[^>]*>{}</td><td[^>]*>{}</td>"
    assert re.search(row.format("--bin", "1", "given"), report)
    assert re.search(row.format("--seed", "1", "default"), report)


def test_help_of_baselines_has_their_own_options():
    text = harness.succeed("baseline", "tv", "--help").stdout
    assert "--weight" in text and "--xtilt" not in text
    assert "--xtilt" in harness.succeed("baseline", "tv", "--help-all").stdout


def test_a_file_says_what_the_command_line_says():
    series = harness.Series("series")
    written = series.reconstruct("written", "--rank", 5, "--roi", "2,3,40,30", "--ifp", 0.5,
                                 "--center=23.5,11", "--tv-penalty", "smooth", "--view-scale", "on")
    file = os.path.join(series.directory, "options.toml")
    with open(file, "w", encoding="utf-8") as config:
        config.write('roi = [2, 3, 40, 30]\nifp = 0.5\ncenter = [23.5, 11]\ntv-penalty = "smooth"\n'
                     'view-scale = "on"\nrank = 7\n')
    quick = harness.merge(harness.QUICK, ["--tv-penalty", "smooth", "--view-scale", "on"])[:-4]
    output = os.path.join(harness.fresh_directory("configured"), "out.mrc")
    harness.succeed("reconstruct", *series.input, "-o", output, *harness.merge(quick, ["--rank", 5]),
                    "--config", file)
    configured = harness.Results(output)
    assert options_of(configured) == options_of(written)
    assert options_of(configured)["specimen"]["axis_z"] == 11
    assert harness.read_bytes(configured.volume_path) == harness.read_bytes(written.volume_path)


def test_an_option_of_a_file_needs_a_value(tmp_path):
    """The command line would take the next word for it."""
    series = harness.Series("unvalued")
    for line in ('trace = ""', "trace = []", 'exclude = ""', 'roi = ""', 'center = ["", "3"]'):
        (tmp_path / "a.toml").write_text(f"{line}\ntv = 5\n", encoding="utf-8")
        ended = harness.tomofield("reconstruct", *series.input, "--config", tmp_path / "a.toml",
                                  "-o", tmp_path / "o.mrc", cwd=tmp_path)
        assert ended.returncode == 2, ended
        for fact in ("a.toml", "line 1", line.split()[0], "has no value"):
            assert fact in ended.stderr, (fact, ended.stderr)
        assert not [name for name in os.listdir(tmp_path) if name.startswith(("-", "o."))]


def test_what_follows_two_dashes_is_a_file():
    series = harness.Series("dashed")
    folder = harness.fresh_directory("dashes")
    pathlib.Path(folder, "bright.toml").write_text("thickness = 24\ncontrast = 'bright'\n", encoding="utf-8")
    shutil.copy(series.tlt, os.path.join(folder, "x.tlt"))
    for name in ("-x.mrc", "--config=x.mrc", "--overwrite"):
        shutil.copy(series.stack, os.path.join(folder, name))
        harness.succeed("baseline", "wbp", "--config", "bright.toml", "--tlt", "x.tlt", "-o", f"of{name}.mrc",
                        "--", name, cwd=folder)


def test_recorded_options_repeat_the_run():
    """Gives every option that a run recorded, and none is left to be chosen automatically."""
    series = harness.Series("series")
    automatic = series.reconstruct("automatic", "--contrast", "dark")
    recorded = options_of(automatic)
    words = []
    for key, flag in flags_of_keys().items():
        group, _, name = key.rpartition(".")
        if not flag.startswith("--") or group == "running" or key.startswith("specimen.axis"):
            continue
        value = recorded[group][name] if group else recorded[name]
        if isinstance(value, bool) and flag != "--view-scale":
            words += [flag] if value != flag.startswith("--no-") else []
        elif value not in (None, ""):
            words.append(f"{flag}={ {True: 'on', False: 'off'}.get(value, value) }"
                         if isinstance(value, bool) else f"{flag}={value}")
    output = os.path.join(harness.fresh_directory("explicit"), "out.mrc")
    harness.succeed("reconstruct", series.stack, "-o", output, *words)
    explicit = harness.Results(output)
    assert options_of(explicit) == recorded
    assert harness.read_bytes(explicit.volume_path) == harness.read_bytes(automatic.volume_path)
