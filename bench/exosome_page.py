"""Writes what docs/results/real-data.md says about the picture of the README. bench/readme fills
the lines between two marks of the page from its record."""

import os

import readme_page

PAGE = os.path.join(readme_page.PROJECT, "docs/results/real-data.md")
BEGIN = "<!-- bench/readme writes the lines below. -->\n"
END = "<!-- bench/readme wrote the lines above. -->"

# What the record keeps of each trial.
TRIAL = ("tv_penalty", "tv", "spike_rank", "view_scale", "held_out_error", "above_chosen",
         "standard_error", "speckle")


def text(record):
    """Returns the lines: where and how the picture was made, and the trials that chose the
    settings."""
    values, run = record["values"], record["run"]
    rows = (
        ("commit, machine", f"{record['commit']}; {record['machine']}"),
        ("time, memory", f"{run['core_seconds']:.0f} core-seconds, {run['peak_GiB']:.2f} GiB"),
        ("chosen", choice(record["settings"])),
        ("residual", f"{values['residual']:.2f} of the noise's variance"),
        ("error of the views held out of the trials (median)", f"{values['held_out_error']:.2f}"),
        ("speckle, face jump", f"{values['speckle_percent']:.3f} %, {values['face_jump']:.2f}"),
        (f"`export --compact` with `--budget {record['budget']}`", compact(record)),
    )
    lines = ["", "| | |", "|-|-|", *(f"| {name} | {value} |" for name, value in rows), "",
             "| trial | mean held-out error | from the chosen settings | speckle, % |",
             "|-|-|-|-|", *map(trial_row, record["trials"]), ""]
    return "\n".join(lines) + "\n"


def choice(settings):
    """Returns the chosen settings in words."""
    return describe({key.partition(".")[2]: value for key, value in settings.items()
                     if key.startswith("chosen.")})


def describe(chosen):
    scales = "" if chosen["view_scale"] else "no "
    return (f"{chosen['tv_penalty']} {chosen['tv']:.3g}, spikes of rank {chosen['spike_rank']}, "
            f"{scales}scales of views")


def trial_row(trial):
    above, error = 100 * trial["above_chosen"], 100 * trial["standard_error"]
    return (f"| {describe(trial)} | {trial['held_out_error']:.3f} | {above:+.2f} % ± {error:.2f} | "
            f"{100 * trial['speckle']:.3f} |")


def compact(record):
    """Returns the size of the compact model in words."""
    ratio = record["half_float_bytes"] / record["compact_bytes"]
    return (f"{record['compact_bytes'] / 1e6:.2f} MB, 1/{ratio:.0f} of the tomogram of half "
            "floats")


def parts(page):
    """Returns the page before, between and behind the marks."""
    before, begin, rest = page.partition(BEGIN)
    inside, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{PAGE} lacks the marks '{BEGIN.strip()}' and '{END}'")
    return before + begin, inside, end + after


def write(record):
    before, _, after = parts(readme_page.read(PAGE))
    with open(PAGE, "w", encoding="utf-8") as file:
        file.write(before + text(record) + after)


def faults(record):
    """Returns a sentence if the page has other lines than the record gives."""
    if parts(readme_page.read(PAGE))[1] == text(record):
        return []
    return ["the lines of bench/readme in docs/results/real-data.md are not those of its record"]
