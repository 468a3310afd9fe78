#!/usr/bin/python3
"""Measures how visible the faces of leaves are in a tomogram.

The ratio is the mean jump of the density between voxels on either side of a leaf's face, over the
mean jump between neighbouring voxels inside leaves, along X and Y. 1 means that no face is visible;
the target is at most 1.1.

usage: seam.py TOMOGRAM.mrc [--model MODEL.h5] [--truth TRUTH.mrc]

By default the model lies beside the tomogram. Prints JSON: jump_across and jump_inside in data
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


def face_masks(model_path, shape):
    """Returns, for pairs of voxels along X and along Y, [y, x], true where a leaf's face lies
    between the two."""
    num_y, num_x = shape
    across_x = np.zeros((num_y, num_x - 1), bool)
    across_y = np.zeros((num_y - 1, num_x), bool)
    with h5py.File(model_path, "r") as model:
        roi_x, roi_y = model["geometry/roi"][:2]
        tree = model["field/tree"]
        for node in model["field/leaves/node"][:]:
            size = int(tree["node_size"][node])
            x0, y0 = int(tree["node_x0"][node] - roi_x), int(tree["node_y0"][node] - roi_y)
            rows = slice(max(y0, 0), max(y0 + size, 0))
            columns = slice(max(x0, 0), max(x0 + size, 0))
            if 0 < x0 < num_x:
                across_x[rows, x0 - 1] = True
            if 0 < y0 < num_y:
                across_y[y0 - 1, columns] = True
    return across_x, across_y


def ratio(jumps, across):
    inside = [~a for a in across]
    return mean_jump(jumps, across) / mean_jump(jumps, inside)


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
    across = face_masks(arguments.model or os.path.splitext(arguments.tomogram)[0] + ".h5", shape)
    if not all(mask.any() for mask in across):
        sys.exit("seam.py: the tomogram lies in a single leaf along X or Y")
    figures = {"jump_across": mean_jump(jumps, across),
               "jump_inside": mean_jump(jumps, [~mask for mask in across]),
               "ratio": round(ratio(jumps, across), 4),
               "ratio_x": round(ratio(jumps[:1], across[:1]), 4),
               "ratio_y": round(ratio(jumps[1:], across[1:]), 4)}
    if arguments.truth:
        truth = ratio(read_jumps(arguments.truth), across)
        figures |= {"truth_ratio": round(truth, 4),
                    "over_truth": round(figures["ratio"] / truth, 4)}
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
