#!/usr/bin/python3
"""Measures how much the Fourier axes of a tomogram's sections stand out.

The ratio is the mean amplitude on the two axes over the mean of the rings of the same frequencies.
It is taken over Hann-windowed central XY sections. 1 means that there are no streaks along X and Y.

usage: axis_streaks.py TOMOGRAM.mrc [more.mrc ...]

Prints one line of JSON for each file: the ratio, and the ratios on the axis of X (v = 0) and on the
axis of Y (u = 0)."""

import json
import sys

import mrcfile
import numpy as np

LOWEST = 2  # cycles over the section; at lower frequencies the window spreads the mean


def mean_ratios(section):
    """Returns axis amplitude over ring mean, averaged over frequencies, for the u and v axes."""
    num_y, num_x = section.shape
    window = np.outer(np.hanning(num_y + 2)[1:-1], np.hanning(num_x + 2)[1:-1])
    section = section - (section * window).sum() / window.sum()
    amplitude = np.abs(np.fft.fft2(section * window))
    v, u = np.meshgrid(np.fft.fftfreq(num_y), np.fft.fftfreq(num_x), indexing="ij")
    ring = np.round(np.hypot(u, v) * max(num_x, num_y)).astype(int)
    off_axes = (np.abs(u * num_x) > 1.5) & (np.abs(v * num_y) > 1.5)
    ratios = []
    for on_axis in (v == 0) & (np.abs(u * num_x) > LOWEST - 0.5), \
                   (u == 0) & (np.abs(v * num_y) > LOWEST - 0.5):
        found = []
        for k in range(LOWEST + 1, max(num_x, num_y) // 2 + 1):
            axis, reference = amplitude[on_axis & (ring == k)], amplitude[off_axes & (ring == k)]
            if axis.size and reference.size:
                found.append(axis.mean() / reference.mean())
        ratios.append(np.mean(found))
    return ratios


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    for path in sys.argv[1:]:
        with mrcfile.open(path, permissive=True) as file:
            depth = file.data.shape[0]
            sections = file.data[depth // 4:max(depth // 4 + 1, depth - depth // 4)].astype("f8")
        along_x, along_y = np.mean([mean_ratios(section) for section in sections], axis=0)
        print(json.dumps({"file": path, "ratio": round((along_x + along_y) / 2, 4),
                          "ratio_x": round(along_x, 4), "ratio_y": round(along_y, 4)}))


if __name__ == "__main__":
    main()
