#!/usr/bin/python3
"""Aligns a raw tilt series by published methods, to compare with: shifts alone, the axis is not moved.

usage: published_alignment.py FOLDER THICKNESS xcorr|matching OUTPUT.xf

FOLDER is what `tomofield simulate` wrote. These are our own short implementations of what the programs
publish, not the programs, which cannot be built here:

  xcorr     cosine-stretched cross-correlation of neighbours, as IMOD's tiltxcorr: from the smallest
            tilt outwards, the view of the smaller tilt is stretched in x to the larger one; filter
            as in eTomo (sigma1 0.03, radius2 0.25, sigma2 0.05); shifts add up.
  matching  projection matching as AreTomo's: from the smallest tilt outwards, each view is correlated
            with the reprojection of a back-projection of at most 10 aligned views within 20.5 degrees,
            weighted by the cosine of the angle between them; the correlation is divided by the root
            of both amplitudes and falls with a B-factor. Then all views are matched three times more,
            each without itself."""

import argparse
import os

import mrcfile
import numpy as np

NEIGHBOURS, WITHIN_DEG, PASSES = 10, 20.5, 3
LAYERS = 48  # of the back-projection along Z
B_FACTOR = 500  # square pixels; the correlation falls by exp(-B f^2 / 4)


def frequencies(size):
    return np.hypot(*np.meshgrid(np.fft.fftfreq(size), np.fft.rfftfreq(size), indexing="ij"))


def window(size):
    """Returns a taper [y, x] over the outer eighth of an image."""
    inside = np.minimum(np.arange(size), np.arange(size)[::-1]) + 0.5
    line = 0.5 - 0.5 * np.cos(np.pi * np.minimum(1, inside / (size / 8)))
    return np.outer(line, line)


def transform(image):
    size = len(image)
    taper = window(size)
    return np.fft.rfft2((image - (image * taper).sum() / taper.sum()) * taper)


def peak(correlation):
    """Returns the place (x, y) of the highest value, to a part of a pixel, with wrapped signs."""
    size = len(correlation)
    y, x = np.unravel_index(np.argmax(correlation), correlation.shape)
    place = []
    for left, middle, right, at in (
            (correlation[y, x - 1], correlation[y, x], correlation[y, (x + 1) % size], x),
            (correlation[y - 1, x], correlation[y, x], correlation[(y + 1) % size, x], y)):
        bend = left - 2 * middle + right
        part = 0.5 * (left - right) / bend if bend < 0 else 0
        place.append((at + part + size / 2) % size - size / 2)
    return np.array(place)


def filtered_peak(reference, image):
    """Returns by how much the image is shifted against the reference, with eTomo's filter."""
    f = frequencies(len(image))
    passed = (1 - np.exp(-0.5 * (f / 0.03)**2)) * np.exp(
        -0.5 * (np.maximum(0, f - 0.25) / 0.05)**2)
    return peak(np.fft.irfft2(passed * transform(image) * np.conj(transform(reference)),
                              image.shape))


def normalised_peak(reference, image):
    """Does the same with amplitudes that are divided by their roots, and a B-factor."""
    a, b = transform(reference), transform(image)
    product = b * np.conj(a)
    weight = np.exp(-B_FACTOR * frequencies(len(image))**2 / 4)
    return peak(np.fft.irfft2(weight * product / np.sqrt(np.abs(product) + 1e-12), image.shape))


def interpolation(places, size):
    """Returns a matrix [place, pixel] that interpolates a row at places, in pixels from its middle."""
    at = np.clip(places + (size - 1) / 2, 0, size - 1.001)
    first = at.astype(int)
    matrix = np.zeros((len(places), size))
    matrix[np.arange(len(places)), first] = 1 - (at - first)
    matrix[np.arange(len(places)), first + 1] += at - first
    return matrix


def shifted(image, shift):
    """Returns an image of which the pixel at q shows what the given one has at q + shift."""
    size = len(image)
    pixels = np.arange(size) - (size - 1) / 2
    return interpolation(pixels + shift[1], size) @ image @ interpolation(pixels + shift[0], size).T


def reprojection(images, tilts, others, tilt, thickness):
    """Returns what a back-projection of aligned views shows at a tilt (angles in radians)."""
    size = len(images[0])
    x = np.arange(size) - (size - 1) / 2
    total = 0
    for other in others:
        rows = np.zeros((size, size))
        for z in (np.arange(LAYERS) + 0.5) / LAYERS * thickness - thickness / 2:
            specimen_x = (x - z * np.sin(tilt)) / np.cos(tilt)
            rows += interpolation(specimen_x * np.cos(tilts[other]) + z * np.sin(tilts[other]), size)
        total = total + np.cos(tilt - tilts[other]) * images[other] @ rows.T
    return total


def outwards(tilts):
    return np.argsort(np.abs(tilts), kind="stable")


def nearest(tilts, view, among):
    """Returns the views that predict a view."""
    others = sorted((other for other in among if other != view),
                    key=lambda other: abs(tilts[other] - tilts[view]))[:NEIGHBOURS]
    return [other for other in others
            if abs(tilts[other] - tilts[view]) <= np.radians(WITHIN_DEG)] or others[:1]


def by_correlation(views, tilts):
    """Returns the shift of each view: the aligned pixel q is found at q + shift."""
    order, shifts = outwards(tilts), np.zeros((len(views), 2))
    size = len(views[0])
    x = np.arange(size) - (size - 1) / 2
    for number, view in enumerate(order[1:], 1):
        other = min(order[:number], key=lambda done: abs(tilts[done] - tilts[view]))
        stretch = np.cos(tilts[view]) / np.cos(tilts[other])
        reference = shifted(views[other], shifts[other]) @ interpolation(x / stretch, size).T
        shifts[view] = shifts[other] * [stretch, 1]
        shifts[view] += filtered_peak(reference, shifted(views[view], shifts[view]))
    return shifts


def by_matching(views, tilts, thickness):
    """Does the same by projection matching."""
    order, shifts = outwards(tilts), np.zeros((len(views), 2))
    images = list(views)

    def match(view, among):
        reference = reprojection(images, tilts, nearest(tilts, view, among), tilts[view], thickness)
        shifts[view] += normalised_peak(reference, images[view])
        images[view] = shifted(views[view], shifts[view])

    for number, view in enumerate(order[1:], 1):
        match(view, order[:number])
    for _ in range(PASSES):
        for view in order[1:]:
            match(view, order)
    return shifts


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("thickness", type=float)
    parser.add_argument("method", choices=("xcorr", "matching"))
    parser.add_argument("xf")
    arguments = parser.parse_args()
    views = mrcfile.read(os.path.join(arguments.folder, "tilt_series.mrc")).astype(float)
    tilts = np.radians(np.loadtxt(os.path.join(arguments.folder, "tilt_series.tlt")))
    shifts = (by_correlation(views, tilts) if arguments.method == "xcorr" else
              by_matching(views, tilts, arguments.thickness))
    np.savetxt(arguments.xf, [[1, 0, 0, 1, -x, -y] for x, y in shifts], fmt="%.6f")


if __name__ == "__main__":
    main()
