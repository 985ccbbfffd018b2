#!/usr/bin/env python3
"""Checks the appearance of objects against image and masks, of a dataset with the writers `arrays` (npz) and `cut` (png).

    check_appearance.py DATASET exact|denoised|alone

`exact`: lit as in the scene, without a denoiser: what the image shows of an object alone has the same codes. `denoised`:
the same up to what a denoiser takes from neighbors. `alone`: other light, the same opacity.
"""

import pathlib
import sys

import numpy as np
from PIL import Image

root, mode = pathlib.Path(sys.argv[1]), sys.argv[2]


def shrunk(mask, radius):
    """Pixels whose neighbors within a radius are all set."""
    out = np.ones_like(mask)
    height, width = mask.shape
    padded = np.pad(mask, radius)
    for dy in range(2 * radius + 1):
        for dx in range(2 * radius + 1):
            out &= padded[dy : dy + height, dx : dx + width]
    return out


objects = hidden_px = inner_px = off_px = 0
differences = []
for path in sorted((root / "arrays").glob("*.npz")):
    view = np.load(path)
    height, width = view["rgb"].shape[:2]
    bits = view["amodal_bits"]
    amodal = np.unpackbits(bits, axis=2, count=width).astype(bool)
    appearance, normals = view["appearance"], view["amodal_normal"]
    assert appearance.shape == (len(view["ids"]), height, width, 4) and appearance.dtype == np.uint8
    assert normals.shape == (len(view["ids"]), height, width, 3) and normals.dtype == np.float32
    for k, number in enumerate(view["ids"]):
        objects += 1
        color, alpha = appearance[k, ..., :3], appearance[k, ..., 3]
        visible = view["visible_ids"] == number
        hidden_px += int((amodal[k] & ~visible).sum())
        assert not color[alpha == 0].any(), "transparent pixels are 0"

        # Opacity is the mask but at edges: within one pixel of both sides.
        inside, outside = shrunk(amodal[k], 1), shrunk(~amodal[k], 1)
        assert (alpha[inside] > 127).mean() > 0.995 if inside.any() else True, f"object {number} has holes"
        assert (alpha[outside] <= 127).mean() > 0.9995, f"object {number} is where it is not"
        edges = ~inside & ~outside
        off_px += int(((alpha > 127) != amodal[k])[edges].sum())
        assert ((alpha > 127) == amodal[k])[edges].mean() > 0.6

        # The box of what is not transparent, and the image that was cut to it.
        rows, columns = np.nonzero(alpha.any(axis=1))[0], np.nonzero(alpha.any(axis=0))[0]
        x, y, w, h = view["appearance_box"][k]
        assert (x, y, w, h) == (columns[0], rows[0], columns[-1] + 1 - columns[0], rows[-1] + 1 - rows[0])
        cut = Image.open(root / "cut" / "appearance" / f"{path.stem}_{number:04}.png")
        assert cut.mode == "RGBA" and np.array_equal(np.array(cut), appearance[k, y : y + h, x : x + w])

        # Normals where the object is, and those of the image where that shows it.
        length = np.linalg.norm(normals[k], axis=2)
        assert (np.abs(length[amodal[k]] - 1) < 1e-3).all() and not length[~amodal[k]].any()
        assert np.array_equal(normals[k][visible], view["normal"][visible])

        # What the image shows of the object and nothing else. Samples reach one pixel beyond their own.
        inner = shrunk(visible, 2) & (alpha == 255)
        inner_px += int(inner.sum())
        differences.append(np.abs(color[inner].astype(int) - view["rgb"][inner].astype(int)).ravel())

difference = np.concatenate(differences)
assert objects > 10 and hidden_px > 500 and inner_px > 2000, (objects, hidden_px, inner_px)
if mode == "exact":
    assert not difference.any(), f"{(difference > 0).sum()} of {difference.size} codes differ"
elif mode == "denoised":
    assert difference.mean() < 2.5 and np.percentile(difference, 99) < 20, (difference.mean(), np.percentile(difference, 99))
else:
    assert difference.mean() > 1, "light of the whole scene"
print(
    f"{objects} objects, {hidden_px} hidden pixels, {inner_px} inner ones whose codes differ by {difference.mean():.3f}, "
    f"{off_px} pixels at edges on the other side"
)
