"""Draws the same sections of several volumes, for bench/realistic."""

import math
import os

import mrcfile
import numpy as np
from PIL import Image, ImageDraw

LABEL, GAP, ZOOM, COLUMNS = 16, 4, 2, 4  # pixels, factor, number
LOW, HIGH = 1.0, 99.0  # percentiles of the two sections that are black and white


def sections(volume):
    """Returns the middle sections across Z and, below it, across Y, dense dark, as one image in
    [0, 1]. The rows run upwards, as in viewers of MRC files."""
    across_z = volume[volume.shape[0] // 2, ::-1]
    across_y = volume[::-1, volume.shape[1] // 2]
    values = np.concatenate([across_z, across_y]).astype(np.float64)
    low, high = np.percentile(values, (LOW, HIGH))
    return 1 - np.clip((values - low) / max(high - low, 1e-30), 0, 1)


def tile(image, label):
    picture = Image.fromarray((255 * image).astype(np.uint8))
    picture = picture.resize((ZOOM * picture.width, ZOOM * picture.height), Image.BICUBIC)
    framed = Image.new("L", (picture.width + GAP, picture.height + LABEL + GAP), 255)
    framed.paste(picture, (GAP // 2, LABEL))
    ImageDraw.Draw(framed).text((GAP, 2), label, fill=0)
    return framed


def draw(folder, methods, file):
    """Draws the truth and the volumes of the methods in a folder side by side, each from its own
    1st to its 99th percentile."""
    tiles = [tile(sections(mrcfile.read(os.path.join(folder, name + ".mrc"))), name)
             for name in ["truth", *methods]]
    width, height = tiles[0].size
    columns = min(COLUMNS, len(tiles))
    panel = Image.new("L", (columns * width, math.ceil(len(tiles) / columns) * height), 255)
    for number, one in enumerate(tiles):
        panel.paste(one, (number % columns * width, number // columns * height))
    panel.save(file)
