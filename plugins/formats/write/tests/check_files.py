#!/usr/bin/env python3
"""Compares the files of the png and npy writers with the values that the jsonl writer wrote, and with NumPy's own files.

    python3 check_files.py DATASET

The dataset has `all.jsonl`, the folders `png` and `npy`, and `npy/*/*.npy` that must equal what `numpy.save` writes.
"""

import io
import json
import pathlib
import sys

import numpy as np
from PIL import Image
from pycocotools import mask as coco_mask


def same(got, want, name):
    got, want = np.asarray(got), np.asarray(want)
    assert got.shape == want.shape and np.array_equal(got, want), f"{name}: {got.dtype} {got.shape} {want.shape}"


def main():
    root = pathlib.Path(sys.argv[1])
    checked = 0
    for line in (root / "all.jsonl").read_text().splitlines():
        record = json.loads(line)
        name = f"{record['scene']:06}_{record['view']:04}"
        png = lambda product, end="": np.asarray(Image.open(root / "png" / product / f"{name}{end}.png"))
        npy = lambda product, end="": np.load(root / "npy" / product / f"{name}{end}.npy")

        same(png("rgb"), np.array(record["rgb"], dtype=np.uint8), f"{name} rgb")
        same(npy("rgb"), np.array(record["rgb"], dtype=np.uint8), f"{name} rgb")
        depth = np.array([[np.inf if d is None else d for d in row] for row in record["depth"]], dtype=np.float32)
        same(npy("depth"), depth, f"{name} depth")
        # In steps of 0.25 mm, rounded (no value lies half way), 0 where there is none.
        steps = np.where(np.isfinite(depth), np.minimum(np.rint(np.nan_to_num(depth.astype(float), posinf=0) * 4000), 65535), 0)
        same(png("depth"), steps, f"{name} depth in steps")
        assert png("depth").dtype == np.uint16
        same(png("instance"), np.array(record["instance"]), f"{name} instance")
        assert npy("instance").dtype == np.uint16 and npy("rgb").dtype == np.uint8 and npy("depth").dtype == np.float32

        normal = np.array(record["normal"], dtype=np.float32)
        same(npy("normal"), normal, f"{name} normal")
        shown = np.rint(normal.astype(float) * [1, -1, -1] * 127 + 128)
        same(png("normal"), np.where(np.any(normal != 0, axis=2, keepdims=True), shown, 0), f"{name} normal shown")

        ids = [int(i) for i in record["visible_mask"]]
        for product in ("visible_mask", "amodal_mask"):
            stack, stack_ids = npy(product), npy(product, "_ids")
            assert stack.dtype == bool and stack_ids.dtype == np.uint16
            same(stack_ids, np.array(ids, dtype=np.uint16), f"{name} {product} ids")
            masks = [coco_mask.decode(record[product][str(i)]) > 0 for i in ids]
            same(stack, np.array(masks).reshape((len(ids),) + depth.shape), f"{name} {product}")
            for i, mask in zip(ids, masks):
                same(png(product, f"_{i:04}"), mask * 255, f"{name} {product} {i}")
        boxes = [record["amodal_box"][str(i)] for i in ids]
        same(npy("amodal_box"), np.array(boxes, dtype=np.int64).reshape(len(ids), 4), f"{name} amodal_box")
        same(npy("occlusion_rate"), np.array([record["occlusion_rate"][str(i)] for i in ids]), f"{name} rates")
        same(npy("occlusion_order"), np.array(record["occlusion_order"], dtype=bool).reshape(len(ids), len(ids)),
             f"{name} order")
        assert npy("occlusion_order").dtype == bool
        checked += 1
    files = sorted((root / "npy").rglob("*.npy"))
    for path in files:
        saved = io.BytesIO()
        np.save(saved, np.load(path))
        assert saved.getvalue() == path.read_bytes(), f"{path}: numpy.save writes other bytes"
    assert checked and files
    print(f"{checked} views, {len(files)} npy files")


if __name__ == "__main__":
    main()
