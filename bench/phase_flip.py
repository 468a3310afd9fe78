#!/usr/bin/python3
"""Flips the phases of a simulated series, each place with its own defocus, as other programs do before
they reconstruct.

The view is cut into strips of 16 columns. A strip is taken from the view whose phases were flipped with
the defocus of the strip's middle (Xiong et al. 2009, as IMOD's ctfphaseflip publishes it).

usage: phase_flip.py FOLDER FLIPPED.mrc"""

import json
import os
import sys

import mrcfile
import numpy as np

STRIP_px, BORDER_px = 16, 64
WAVELENGTH_A, CS_A, AMPLITUDE_CONTRAST = 0.0196875, 2.7e7, 0.07  # simulate's, at 300 kV


def sign_of_transfer(kx, ky, view, more_defocus_A):
    """Returns the sign of minus the contrast transfer function as CTFFIND4 defines it."""
    direction = np.arctan2(ky, kx) - np.radians(view["defocus_angle_deg"])
    u, v = view["defocus_A"]
    defocus = (u + v) / 2 + (u - v) / 2 * np.cos(2 * direction) + more_defocus_A
    k2 = kx**2 + ky**2
    chi = np.pi * WAVELENGTH_A * k2 * (defocus - WAVELENGTH_A**2 * k2 * CS_A / 2)
    return np.sign(np.sqrt(1 - AMPLITUDE_CONTRAST**2) * np.sin(chi)
                   + AMPLITUDE_CONTRAST * np.cos(chi))


def flip(image, view, pixel_A):
    """Returns a view [y, x] with its phases flipped."""
    wide = np.pad(image, BORDER_px, mode="reflect")
    spectrum = np.fft.rfft2(wide)
    kx, ky = np.meshgrid(np.fft.rfftfreq(wide.shape[1], pixel_A), np.fft.fftfreq(wide.shape[0], pixel_A))
    slope_A = np.tan(np.radians(view["tilt_deg"])) * pixel_A  # per pixel
    flipped, width = np.empty_like(image), image.shape[1]
    for begin in range(0, width, STRIP_px):
        end = min(begin + STRIP_px, width)
        sign = sign_of_transfer(kx, ky, view, slope_A * ((begin + end) / 2 - width / 2))
        whole = np.fft.irfft2(spectrum * sign, wide.shape)[BORDER_px:-BORDER_px, BORDER_px:-BORDER_px]
        flipped[:, begin:end] = whole[:, begin:end]
    return flipped


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    folder, output = sys.argv[1:]
    with open(os.path.join(folder, "phantom.json")) as file:
        views = json.load(file)["views"]
    with mrcfile.open(os.path.join(folder, "tilt_series.mrc")) as stack:
        pixel_A = float(stack.voxel_size.x)
        images = [flip(image, view, pixel_A) for image, view in zip(stack.data, views, strict=True)]
    with mrcfile.new(output, np.array(images, np.float32), overwrite=True) as stack:
        stack.voxel_size = pixel_A


main()
