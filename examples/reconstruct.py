#!/usr/bin/python3
"""Reconstructs the series of ./demo: reconstruct.py tilt_series.mrc tilt_series.tlt 75 tomogram.mrc"""
import sys

import tomofield

stack, tlt, thickness, output = sys.argv[1:]
made = tomofield.reconstruct(stack, tlt=tlt, thickness=float(thickness), contrast="bright",
                             with_margin=False, output=output)
print("voxels in x, y, z:", made.model.region().size)
