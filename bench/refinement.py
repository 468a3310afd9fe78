#!/usr/bin/python3
"""Shows why factors that were truncated from a fit lose PSNR when they are fitted to the views again
(docs/results/compact.md).

usage: bench/refinement.py OUT [--program PROGRAM] [--seed 5] [--size 64]

It projects a yardstick phantom A by a matrix, adds noise, fits voxels with total variation, truncates
blocks of 16 × 16 voxels to few components along z, and then fits the matrices of the components with
their vectors kept. Rows differ in what is fitted. It needs python3-mrcfile and python3-scipy."""

import argparse
import os

import mrcfile
import numpy as np
import scipy.sparse

import quality_rows

SIDE = 16
BUDGETS = (10e3, 20e3, 40e3, 80e3)  # parameters
STEPS = (10, 20, 60)
NOISE, VARIATION = 0.05, 10.0  # the weight of total variation that gave the best fit of 10 to 160
SMOOTHING = 0.02  # of total variation, in densities
FIT_STEPS = 150


def voxels_of(path):
    with mrcfile.open(path, permissive=True) as volume:
        return np.array(volume.data, np.float32)


class Views:
    """Projects voxels [z, y, x] to views [view, y, u], each voxel to the two nearest pixels."""

    def __init__(self, shape, tilt_deg):
        self.nz, self.ny, self.nx = shape
        x, z = np.arange(self.nx) + 0.5 - self.nx / 2, np.arange(self.nz) + 0.5 - self.nz / 2
        voxel = np.arange(self.nz * self.nx).reshape(self.nz, self.nx)
        rows, columns, weights = [], [], []
        for view, tilt in enumerate(np.deg2rad(tilt_deg)):
            u = x * np.cos(tilt) + z[:, None] * np.sin(tilt) + self.nx / 2 - 0.5
            low = np.floor(u).astype(int)
            for pixel, weight in ((low, low + 1 - u), (low + 1, u - low)):
                seen = (pixel >= 0) & (pixel < self.nx)
                rows.append(view * self.nx + pixel[seen])
                columns.append(voxel[seen])
                weights.append(weight[seen])
        self.views = len(tilt_deg)
        self.matrix = scipy.sparse.csr_matrix(
            (np.concatenate(weights).astype(np.float32), (np.concatenate(rows), np.concatenate(columns))),
            shape=(self.views * self.nx, self.nz * self.nx))
        self.transposed = self.matrix.T.tocsr()

    def project(self, volume):
        flat = self.matrix @ volume.transpose(0, 2, 1).reshape(-1, self.ny)
        return flat.reshape(self.views, self.nx, self.ny).transpose(0, 2, 1)

    def project_back(self, views):
        flat = self.transposed @ views.transpose(0, 2, 1).reshape(-1, self.ny)
        return flat.reshape(self.nz, self.nx, self.ny).transpose(0, 2, 1)

    def largest_curvature(self):
        volume = np.random.default_rng(0).standard_normal((self.nz, self.ny, self.nx)).astype(np.float32)
        for _ in range(20):
            volume = self.project_back(self.project(volume))
            length = np.linalg.norm(volume)
            volume /= length
        return length


def variation_gradient(volume):
    gradient = np.zeros_like(volume)
    differences = [np.diff(volume, axis=a, append=np.take(volume, [-1], axis=a)) for a in range(3)]
    length = np.sqrt(sum(d * d for d in differences) + SMOOTHING**2)
    for axis, difference in enumerate(differences):
        part = difference / length
        gradient -= part
        gradient += np.roll(part, 1, axis)  # the last one is 0, so nothing wraps around
    return gradient


class Blocks:
    """Components along z of blocks of voxels: the largest ones of all blocks."""

    def __init__(self, volume, parameters):
        self.shape = volume.shape
        depth, height, width = volume.shape
        self.starts = [(y, x) for y in range(0, height, SIDE) for x in range(0, width, SIDE)]
        found = [np.linalg.svd(self.block(volume, start), full_matrices=False) for start in self.starts]
        energies = np.sort(np.concatenate([values**2 for _, values, _ in found]))[::-1]
        least = energies[int(parameters / (depth + SIDE * SIDE))]
        ranks = [int((values**2 > least).sum()) for _, values, _ in found]
        self.vectors = [left[:, :rank] for (left, _, _), rank in zip(found, ranks)]

    def block(self, volume, start):
        y, x = start
        return volume[:, y:y + SIDE, x:x + SIDE].reshape(self.shape[0], -1)

    def closest(self, volume):
        """Returns the volume of these vectors that is nearest: a linear projection."""
        made = np.empty_like(volume)
        for (y, x), vectors in zip(self.starts, self.vectors):
            part = vectors @ (vectors.T @ self.block(volume, (y, x)))
            made[:, y:y + SIDE, x:x + SIDE] = part.reshape(self.shape[0], SIDE, SIDE)
        return made


def descend(start, gradient, curvature, steps, onto):
    """Takes accelerated gradient steps (Nesterov 1983) and yields the volume after each. `onto` puts a
    volume back where it may be."""
    now = ahead = start
    momentum = 1.0
    for _ in range(steps):
        moved = onto(ahead - gradient(ahead) / curvature)
        following = (1 + np.sqrt(1 + 4 * momentum**2)) / 2
        ahead = moved + (momentum - 1) / following * (moved - now)
        now, momentum = moved, following
        yield now


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    parser.add_argument("--program", default=os.path.join(quality_rows.PROJECT, "build/release/tomofield"))
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--size", type=int, default=64)
    options = parser.parse_args()
    folder = quality_rows.phantom(options, "A", options.size, NOISE, options.seed)
    truth = voxels_of(os.path.join(folder, "truth.mrc"))
    noise = voxels_of(os.path.join(folder, "tilt_series.mrc")) - voxels_of(os.path.join(folder, "clean.mrc"))
    views = Views(truth.shape, np.loadtxt(os.path.join(folder, "tilt_series.tlt")))
    clean = views.project(truth)
    random = np.random.default_rng(options.seed)
    noisy = clean + noise.std() * random.standard_normal(clean.shape).astype(np.float32)
    weight = 1 / noise.var()
    psnr = lambda volume: -10 * np.log10(((volume - truth)**2).mean())

    def data_gradient(measured):
        return lambda volume: weight * views.project_back(views.project(volume) - measured)

    def with_variation(volume):
        return data_gradient(noisy)(volume) + VARIATION * variation_gradient(volume)

    of_data = weight * views.largest_curvature()
    of_all = of_data + 1.8 * VARIATION / SMOOTHING
    mean = np.full_like(truth, truth.mean())
    *_, fit = descend(mean, with_variation, of_all, FIT_STEPS, lambda volume: np.maximum(volume, 0))
    print(f"fit {psnr(fit):.2f} dB")
    kept = 0.1 * of_data
    rows = {"the views": (data_gradient(noisy), of_data),
            "views without noise": (data_gradient(clean), of_data),
            "the fit's own views": (data_gradient(views.project(fit)), of_data),
            "the views, total variation": (with_variation, of_all),
            "and a proximal term": (lambda v: with_variation(v) + kept * (v - fit), of_all + kept)}
    for parameters in BUDGETS:
        blocks = Blocks(fit, parameters)
        start = blocks.closest(fit)
        print(f"{parameters / 1e3:.0f} k parameters: truncated {psnr(start):.2f} dB")
        for name, (gradient, curvature) in rows.items():
            volumes = descend(start, gradient, curvature, max(STEPS), blocks.closest)
            scores = [psnr(volume) for step, volume in enumerate(volumes, 1) if step in STEPS]
            print(f"  {name:<28}", ", ".join(f"{score:.2f}" for score in scores))


main()
