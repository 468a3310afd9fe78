"""Small pictures of sections, as notebooks show them."""

import base64
import html
import struct
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

LARGEST = 512  # pixels on a side of a picture
SMALLEST = 256  # pixels on the screen
CLIPPED = 0.5  # per cent of the pixels that become black, and as many that become white


def figure(section: npt.NDArray[Any], caption: str) -> str:
    """Return a section [y, x] as HTML, with y upwards, and a caption below."""
    grey = _grey(_reduced(section)[::-1])
    width = max(SMALLEST, grey.shape[1])
    data = base64.b64encode(png(grey)).decode("ascii")
    return (f'<figure style="margin:0"><img alt="{html.escape(caption)}" width="{width}" '
            f'style="image-rendering:pixelated" src="data:image/png;base64,{data}">'
            f"<figcaption>{html.escape(caption)}</figcaption></figure>")


def png(grey: npt.NDArray[np.uint8]) -> bytes:
    """Return a picture [row, column] as a PNG file of 8-bit grey (PNG specification, ISO 15948)."""
    def chunk(kind: bytes, data: bytes) -> bytes:
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    height, width = grey.shape
    rows = b"".join(b"\0" + row.tobytes() for row in grey)  # 0: rows are not filtered
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows))
            + chunk(b"IEND", b""))


def _reduced(section: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the means of squares of pixels that are so large that the picture is small."""
    step = -(-max(section.shape) // LARGEST)
    if step == 1:
        return section
    down, across = (min(step, side) for side in section.shape)
    height, width = section.shape[0] // down, section.shape[1] // across
    whole = section[:height * down, :width * across]
    return np.asarray(whole.reshape(height, down, width, across).mean(axis=(1, 3)))


def _grey(section: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    finite = section[np.isfinite(section)]
    if finite.size == 0:
        return np.zeros(section.shape, np.uint8)
    low, high = np.percentile(finite, [CLIPPED, 100 - CLIPPED])
    scaled = (np.nan_to_num(section, nan=low) - low) / max(float(high - low), 1e-30)
    return np.asarray(np.round(255 * np.clip(scaled, 0, 1)), np.uint8)
