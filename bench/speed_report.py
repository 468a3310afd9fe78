"""Prints Markdown tables and plots of a run.json (run_file.py). Figures are medians over repeats, ±
the median absolute deviation where it is not zero."""

import math
import os
import re
import statistics

import measured_on
import run_file


def number(value):
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def cell(values, text=number):
    if not values:
        return "–"
    middle, spread = text(statistics.median(values)), run_file.median_deviation(values)
    return f"{middle} ± {text(spread)}" if spread > 0 else middle


def figure(row, name):
    return row["figures"].get(name, [])


def ratios(row, reference, name):
    """Returns the ratios of a figure to another row's, repeat by repeat."""
    return [ours / other for ours, other in zip(figure(row, name), figure(reference, name))
            if other > 0]


def table(head, rows):
    print("\n| " + " | ".join(head) + " |\n" + "|-" * len(head) + "|")
    for row in rows:
        print("| " + " | ".join(row) + " |")


def of_group(run, group):
    return [row for row in run["rows"] if row["group"] == group]


def print_tables(run):
    measured_on.print_origins(run)
    print("Medians over repeats ± median absolute deviation.")
    for group, print_group in (("kernels", print_kernels),
                               ("reconstructions", print_reconstructions),
                               ("wide", print_wide), ("sizes", print_sizes)):
        rows = of_group(run, group)
        if rows:
            print_group(rows)


def print_kernels(rows):
    totals = [row for row in rows if ": " not in row["name"]]
    print("\n## Kernels, one core\n\nTargets by Highway's names: AVX3 is AVX-512.")
    names = list(totals[0]["figures"])
    table(["", *(row["name"].removeprefix("kernels ") for row in totals)],
          [[name, *(cell(figure(row, name)) for row in totals)] for name in names])
    cases = {}
    for row in rows:
        target, _, case = row["name"].removeprefix("kernels ").partition(": ")
        if case:
            cases.setdefault(case, {})[target] = cell(
                [1e3 * s for s in figure(row, "seconds_a_call")])
    targets = [row["name"].removeprefix("kernels ") for row in totals]
    table(["ms a call", *targets],
          [[case, *(at.get(target, "–") for target in targets)] for case, at in cases.items()])


def estimate_over_peak(row):
    estimated, peak = figure(row, "estimated_MiB"), figure(row, "peak_MiB")
    return [f"{100 * (e / p - 1):+.0f} %" for e, p in zip(estimated, peak)][:1] or ["–"]


def print_reconstructions(rows):
    """Prints whole reconstructions, with ratios to the default method of the same size."""
    print("\n## Whole reconstructions, yardstick A, noise 0.05")
    lines, references = [], {}
    for row in rows:
        size, _, method = row["name"].removeprefix("A ").partition(" ")
        reference = references.setdefault(size, row) if method == "default" else references.get(size)
        shares = [cell(ratios(row, reference, name)) if reference else "–"
                  for name in ("core_seconds", "wall_seconds")]
        lines.append([size, f"{method}: `{row['arguments']}`",
                      cell(figure(row, "psnr_dB"), "{:.2f}".format),
                      cell(figure(row, "psnr_affine_dB"), "{:.2f}".format),
                      cell(figure(row, "core_seconds")), cell(figure(row, "wall_seconds")), *shares,
                      cell(figure(row, "peak_MiB")), *estimate_over_peak(row)])
    table(["pixels / thickness", "method", "PSNR, dB", "PSNR at best scale", "core-s", "wall s",
           "core-s / default's", "wall s / default's", "peak MiB", "--dry-run over peak"], lines)


def print_wide(rows):
    print("\n## A wide series, from a band of its rows")
    for row in rows:
        print(f"\n{row['name']}, `{row['arguments']}`\n\n| | |\n|-|-|")
        for name, values in row["figures"].items():
            print(f"| {name.replace('_', ' ')} | {cell(values)} |")


AXES = ("views", "pixels", "thickness", "rank")


def along(rows, axis):
    """Returns the longest list of rows that differ along one axis only, sorted along that axis."""
    series = {}
    for row in rows:
        others = tuple(statistics.median(figure(row, name)) for name in AXES if name != axis)
        series.setdefault(others, []).append(row)
    longest = max(series.values(), key=len)
    return sorted(longest, key=lambda row: figure(row, axis)[0])


def exponent(rows, axis):
    """Returns the slope of log(core-seconds) over log(size), by least squares."""
    x = [math.log(figure(row, axis)[0]) for row in rows]
    y = [math.log(statistics.median(figure(row, "core_seconds"))) for row in rows]
    return statistics.linear_regression(x, y).slope


def print_sizes(rows):
    print("\n## Cost against size")
    lines = []
    for axis in AXES:
        found = along(rows, axis)
        slope = f"{exponent(found, axis):.2f}" if len(found) > 1 else "–"
        for row in found if len(found) > 1 else []:
            lines.append([axis, re.sub("^size ", "", row["name"]), cell(figure(row, "core_seconds")),
                          cell(figure(row, "peak_MiB")), slope])
    table(["varied", "size", "core-s", "peak MiB", "core-s as its power"], lines)
    print(f"\n`{rows[0]['arguments']}` with the rank of each row.")


def plot(run, folder):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot

    for group, draw in (("kernels", draw_roofline), ("reconstructions", draw_reconstructions),
                        ("sizes", draw_sizes)):
        rows = of_group(run, group)
        if rows:
            drawing = draw(pyplot, rows)
            drawing.savefig(os.path.join(folder, f"speed_{group}.png"), dpi=110)
            pyplot.close(drawing)


def draw_roofline(pyplot, rows):
    """Draws GFLOP/s over FLOPs a byte for the first (widest) target, under its load bounds."""
    target = next(row["name"] for row in rows if ": " not in row["name"])
    drawing, panel = pyplot.subplots(figsize=(8, 5), constrained_layout=True)
    cases = [row for row in rows if row["name"].startswith(target + ": ")]
    intensities = [figure(row, "flops")[0] / figure(row, "bytes")[0] for row in cases]
    for position, (row, intensity) in enumerate(zip(cases, intensities)):
        seconds = statistics.median(figure(row, "seconds_a_call"))
        name, speed = row["name"].removeprefix(target + ": "), figure(row, "flops")[0] / seconds / 1e9
        if name.startswith("two loads"):
            ends = [min(intensities), max(intensities)]
            panel.plot(ends, [speed * end / intensity for end in ends], "--", color="0.5")
            panel.annotate(name, (ends[0], speed * ends[0] / intensity), fontsize=8)
        else:
            panel.plot(intensity, speed, "o", label=name,
                       color=pyplot.get_cmap("tab20")(position % 20))
    panel.set(xscale="log", yscale="log", xlabel="FLOPs a byte", ylabel="GFLOP/s", title=target)
    panel.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.01, 1))
    return drawing


def draw_reconstructions(pyplot, rows):
    """Draws PSNR at the best scale over core-seconds, one line for each method through its
    sizes."""
    drawing, panel = pyplot.subplots(figsize=(7, 4.5), constrained_layout=True)
    points = {}
    for row in rows:
        size, _, method = row["name"].removeprefix("A ").partition(" ")
        at = [statistics.median(figure(row, name)) for name in ("core_seconds", "psnr_affine_dB")]
        points.setdefault(method, []).append((size, at))
    for method, found in points.items():
        panel.plot(*zip(*(at for _, at in found)), marker="o", label=method)
        for size, at in found:
            panel.annotate(size, at, fontsize=7)
    panel.set(xscale="log", xlabel="core-seconds", ylabel="PSNR at best scale, dB")
    panel.grid(alpha=0.3)
    panel.legend(fontsize=8)
    panel.margins(x=0.1)  # leaves room for the names of the last points
    return drawing


def draw_sizes(pyplot, rows):
    drawing, panels = pyplot.subplots(1, len(AXES), figsize=(13, 3.6), sharey=True,
                                      constrained_layout=True)
    for panel, axis in zip(panels, AXES):
        found = along(rows, axis)
        panel.errorbar([figure(row, axis)[0] for row in found],
                       [statistics.median(figure(row, "core_seconds")) for row in found],
                       [run_file.median_deviation(figure(row, "core_seconds")) for row in found],
                       marker="o")
        panel.set(xscale="log", yscale="log", xlabel=axis)
        panel.grid(alpha=0.3, which="both")
    panels[0].set_ylabel("core-seconds")
    return drawing
