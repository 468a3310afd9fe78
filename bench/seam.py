#!/usr/bin/python3
"""Measures how visible the faces of leaves are in a tomogram.

The ratio is the mean jump of the density between voxels on either side of a leaf's face, over the
mean jump between neighbouring voxels of one leaf within eight voxels of such a face, along X and Y.
1 means that no face is visible; the target is at most 1.1.

usage: seam.py TOMOGRAM.mrc [--model MODEL.h5] [--truth TRUTH.mrc]

By default the model lies beside the tomogram. Prints JSON: jump_across and jump_near in data
units, ratio, and the ratio along each axis. There are few faces and the content is not even, so the
truth of a phantom has a ratio other than 1 at the same places. With --truth the script prints that
ratio too, and the quotient of both."""

import argparse
import json
import os
import sys

import h5py
import mrcfile
import numpy as np


NEAR = 8  # pairs of voxels on each side of a face


def mark(begin, end, size, across, near):
    """Marks the pairs [pair, …] of a leaf from voxel `begin` to `end` of `size` along one axis."""
    pairs = slice(max(begin, 0), min(end, size) - 1)
    if 0 < begin < size:
        across[begin - 1] = True
        near[begin:min(begin + NEAR, pairs.stop)] = True
    if 0 < end < size:
        near[max(end - 1 - NEAR, pairs.start):pairs.stop] = True


def face_masks(model_path, shape):
    """Returns two masks each for pairs of voxels along X and along Y, [y, x]: true where a leaf's
    face lies between the two, and true near such a face."""
    num_y, num_x = shape
    across = [np.zeros((num_y, num_x - 1), bool), np.zeros((num_y - 1, num_x), bool)]
    near = [np.zeros_like(mask) for mask in across]
    with h5py.File(model_path, "r") as model:
        roi_x, roi_y = model["geometry/roi"][:2]
        tree = model["field/tree"]
        for node in model["field/leaves/node"][:]:
            size = int(tree["node_size"][node])
            x0, y0 = int(tree["node_x0"][node] - roi_x), int(tree["node_y0"][node] - roi_y)
            rows = slice(max(y0, 0), max(y0 + size, 0))
            columns = slice(max(x0, 0), max(x0 + size, 0))
            mark(x0, x0 + size, num_x, across[0][rows].T, near[0][rows].T)
            mark(y0, y0 + size, num_y, across[1][:, columns], near[1][:, columns])
    return across, near


def ratio(jumps, across, near):
    return mean_jump(jumps, across) / mean_jump(jumps, near)


def mean_jump(jumps, selected):
    return float(np.concatenate([j[s] for j, s in zip(jumps, selected)]).mean(dtype="f8"))


def read_jumps(path):
    """Returns the means over Z of the jumps along X and along Y, each [y, x]."""
    with mrcfile.open(path, permissive=True) as file:
        volume = file.data.astype("f4")
    return [np.abs(np.diff(volume, axis=axis)).mean(axis=0) for axis in (2, 1)]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("tomogram")
    parser.add_argument("--model")
    parser.add_argument("--truth")
    arguments = parser.parse_args()
    jumps = read_jumps(arguments.tomogram)
    shape = (jumps[0].shape[0], jumps[1].shape[1])
    across, near = face_masks(arguments.model or os.path.splitext(arguments.tomogram)[0] + ".h5", shape)
    if not all(mask.any() for mask in across):
        sys.exit("seam.py: the tomogram lies in a single leaf along X or Y")
    figures = {"jump_across": mean_jump(jumps, across),
               "jump_near": mean_jump(jumps, near),
               "ratio": round(ratio(jumps, across, near), 4),
               "ratio_x": round(ratio(jumps[:1], across[:1], near[:1]), 4),
               "ratio_y": round(ratio(jumps[1:], across[1:], near[1:]), 4)}
    if arguments.truth:
        truth = ratio(read_jumps(arguments.truth), across, near)
        figures |= {"truth_ratio": round(truth, 4),
                    "over_truth": round(figures["ratio"] / truth, 4)}
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
