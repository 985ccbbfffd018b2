"""Images of samples for notebooks and scripts."""

from __future__ import annotations

import colorsys
import struct
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from .samples import Sample

__all__ = ["color_of", "png", "sheet", "show"]


def color_of(id: int) -> tuple[int, int, int]:
    """Color of an object: neighbors in number differ most."""
    hue = (id * 0.61803398875) % 1.0
    return tuple(round(255 * channel) for channel in colorsys.hsv_to_rgb(hue, 0.75, 1.0))  # type: ignore[return-value]


def sheet(sample: Sample) -> npt.NDArray[np.uint8]:
    """The image beside its labels: visible parts filled, hidden parts striped, outlines of the amodal masks."""
    height, width = sample.shape
    image = sample["rgb"] if "rgb" in sample else None
    base = image if image is not None else np.full((height, width, 3), 40, np.uint8)
    labels = base.astype(np.float32) * 0.6
    visible = sample.visible_masks if "visible_mask" in sample else None
    amodal = sample.amodal_masks if "amodal_mask" in sample else None
    stripes = (np.add.outer(np.arange(height), np.arange(width)) // 3) % 2 == 0
    for row, id in enumerate(sample.ids.tolist()):
        color = np.asarray(color_of(id), np.float32)
        if visible is not None:
            labels[visible[row]] = 0.45 * labels[visible[row]] + 0.55 * color
        if amodal is not None:
            hidden = amodal[row] & stripes & (~visible[row] if visible is not None else True)
            labels[hidden] = 0.5 * labels[hidden] + 0.5 * color
    for row, id in enumerate(sample.ids.tolist()):
        mask = amodal if amodal is not None else visible
        if mask is not None:
            labels[_edge(mask[row])] = color_of(id)
    parts = [labels.astype(np.uint8)] if image is None else [image, labels.astype(np.uint8)]
    return np.concatenate(parts, axis=1)


def _edge(mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    inside = np.pad(mask, 1)
    whole = inside[:-2, 1:-1] & inside[2:, 1:-1] & inside[1:-1, :-2] & inside[1:-1, 2:]
    return mask & ~whole


def png(image: npt.NDArray[Any]) -> bytes:
    """An image as a PNG file: bool, uint8 or uint16 of height × width, or uint8 of height × width × 3."""
    height, width = image.shape[:2]
    if image.dtype == np.bool_:
        image = image.astype(np.uint8) * 255
    bits, color = (8 * image.dtype.itemsize, 2 if image.ndim == 3 else 0)
    # PNG stores the high byte first.
    pixels = np.ascontiguousarray(image, image.dtype.newbyteorder(">")).view(np.uint8).reshape(height, -1)
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels], axis=1)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, bits, color, 0, 0, 0)
    body = zlib.compress(rows.tobytes(), 6)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def show(sample: Sample, ax: Any = None) -> Any:
    """Draws a sample with matplotlib: its image beside its labels. Returns the axes.

    Raises:
        ImportError: Without matplotlib: ``pip install "syntable[viz]"``.
    """
    try:
        import matplotlib.pyplot as plt  # type: ignore[import-not-found, unused-ignore]
    except ImportError:
        raise ImportError('drawing needs matplotlib: pip install "syntable[viz]"') from None
    drawn = sheet(sample)
    if ax is None:
        height, width, _ = drawn.shape
        _, ax = plt.subplots(figsize=(12, 12 * height / width))
    ax.imshow(drawn)
    ax.set_axis_off()
    ax.set_title(f"scene {sample.scene}, view {sample.view}: {len(sample.ids)} objects")
    return ax
