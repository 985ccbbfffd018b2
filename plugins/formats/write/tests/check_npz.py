#!/usr/bin/env python3
"""Compares the archives of the npz writer, read by NumPy without pickles, with the labels that the jsonl writer wrote as
run lengths, decoded by pycocotools.

    python3 check_npz.py DATASET ID

The dataset has `all.jsonl` and the archives `ID/{scene:06}_{view:04}.npz` of the writer's default products. The archives
of `records` also have cameras, names and poses.
"""

import json
import pathlib
import sys

import numpy as np
from pycocotools import mask as coco_mask


def same(got, want, dtype, name):
    want = np.asarray(want, dtype=dtype)
    assert got.dtype == want.dtype, f"{name}: {got.dtype}, not {want.dtype}"
    assert got.shape == want.shape and np.array_equal(got, want), f"{name}: {got.shape} {want.shape}"


def main():
    root, writer = pathlib.Path(sys.argv[1]), sys.argv[2]
    checked = objects = 0
    for line in (root / "all.jsonl").read_text().splitlines():
        record = json.loads(line)
        name = f"{record['scene']:06}_{record['view']:04}"
        ids = [int(i) for i in record["amodal_mask"]]
        with np.load(root / writer / f"{name}.npz", allow_pickle=False) as archive:
            arrays = {key: archive[key] for key in archive.files}
        depth = [[np.inf if d is None else d for d in row] for row in record["depth"]]
        same(arrays["rgb"], record["rgb"], np.uint8, f"{name} rgb")
        same(arrays["depth"], depth, np.float32, f"{name} depth")
        size = arrays["depth"].shape
        same(arrays["ids"], ids, np.uint16, f"{name} ids")

        decode = lambda product: [coco_mask.decode(record[product][str(i)]) > 0 for i in ids]
        visible = np.zeros(size, np.uint16)
        for i, mask in zip(ids, decode("visible_mask")):
            visible[mask] = i
        same(arrays["visible_ids"], visible, np.uint16, f"{name} visible_ids")
        bits = arrays["amodal_bits"]
        assert bits.dtype == np.uint8 and bits.shape == (len(ids), size[0], (size[1] + 7) // 8), f"{name} {bits.shape}"
        # As the book says.
        amodal = np.unpackbits(bits, axis=2, count=size[1])
        same(amodal, np.array(decode("amodal_mask")).reshape((len(ids),) + size), np.uint8, f"{name} amodal_bits")
        assert not np.any(np.unpackbits(bits, axis=2)[:, :, size[1]:]), f"{name}: bits of no pixel"

        for product, width in (("visible_box", 4), ("amodal_box", 4), ("category_id", None)):
            want = np.array([record[product][str(i)] for i in ids], dtype=np.int64)
            same(arrays[product], want.reshape((len(ids), width) if width else len(ids)), np.int64, f"{name} {product}")
        order = np.array(record["occlusion_order"], dtype=bool).reshape(len(ids), len(ids))
        same(arrays["occlusion_order"], order, bool, f"{name} order")
        if writer == "records":
            camera = record["camera"]
            for field, shape in (("K", (3, 3)), ("world_from_camera", (4, 4)), ("width", ())):
                array = arrays[f"camera_{field}"]
                assert array.shape == shape and np.array_equal(array, camera[field]), f"{name} camera_{field}"
            # Text arrays compare with Python's texts.
            assert arrays["object_name"].tolist() == [record["object_name"][str(i)] for i in ids], f"{name} names"
            infos = [record["object_info"][str(i)] for i in ids]
            if infos:
                assert arrays["object_info_asset"].tolist() == [info["asset"] for info in infos], f"{name} assets"
                poses = np.array([info["camera_from_object"] for info in infos])
                same(arrays["object_info_camera_from_object"], poses, np.float64, f"{name} poses")
        checked, objects = checked + 1, objects + len(ids)
    assert checked > 2 and objects > 9
    print(f"{checked} archives with {objects} objects")


if __name__ == "__main__":
    main()
