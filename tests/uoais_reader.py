#!/usr/bin/env python3
"""Reads a dataset as UOAIS-Net's training code and SynTable's evaluation code do (specification 3.1).

    python3 uoais_reader.py DATASET coco|syntable_1
    python3 uoais_reader.py IMAGES uoais FILE

What that code asserts is asserted, what it requires is required, and what it does with the values is done.
"""

import contextlib
import json
import pathlib
import sys

import numpy as np
from PIL import Image
from pycocotools import mask as coco_mask
from pycocotools.coco import COCO


def register(root, file):
    """The COCO reader with UOAIS-Net's extra keys."""
    with contextlib.redirect_stdout(sys.stderr):
        coco = COCO(str(file))
    categories = {c: i for i, c in enumerate(sorted(coco.getCatIds()))}
    image_ids = sorted(coco.imgs.keys())
    images = coco.loadImgs(image_ids)
    annotations = [coco.imgToAnns[i] for i in image_ids]
    ids = [a["id"] for per_image in annotations for a in per_image]
    assert len(set(ids)) == len(ids), "annotation ids are not unique"
    records = []
    for image, per_image in zip(images, annotations):
        record = {
            "file_name": root / image["file_name"], "depth_file_name": root / image["depth_file_name"],
            "height": image["height"], "width": image["width"], "image_id": image["id"], "annotations": []}
        for annotation in per_image:
            assert annotation["image_id"] == record["image_id"]
            assert annotation.get("ignore", 0) == 0
            instance = {key: annotation[key] for key in ("bbox", "category_id", "occluded_rate", "area")}
            for key in ("segmentation", "visible_mask", "occluded_mask"):
                rle = annotation[key]
                assert isinstance(rle, dict), f"{key}: polygons crash the reader"
                assert isinstance(rle["counts"], str), f"{key}: uncompressed runs crash the reader"
                instance[key] = rle
            instance["iscrowd"] = annotation.get("iscrowd", 0)
            instance["category_id"] = categories[annotation["category_id"]]
            record["annotations"].append(instance)
        records.append(record)
    return records


def load(record):
    """The data mapper, without augmentation."""
    rgb = np.asarray(Image.open(record["file_name"]))
    assert rgb.dtype == np.uint8 and rgb.shape == (record["height"], record["width"], 3)
    depth = np.asarray(Image.open(record["depth_file_name"]))
    assert depth.dtype == np.uint16 and depth.shape == rgb.shape[:2], (depth.dtype, depth.shape)
    depth = np.clip(depth.astype(np.float32), 250, 2500)
    depth = ((depth - 250) / (2500 - 250) * 255).astype(np.uint8)
    instances = []
    for instance in record["annotations"]:
        if instance["iscrowd"]:
            continue
        amodal, visible, occluded = (coco_mask.decode(instance[k]) for k in ("segmentation", "visible_mask", "occluded_mask"))
        for mask in (amodal, visible, occluded):
            assert mask.shape == rgb.shape[:2]
        assert len(instance["bbox"]) == 4 and 0 <= instance["occluded_rate"] <= 1
        # Boxes are computed again from the amodal mask; the class is the 5 % rule.
        ys, xs = np.nonzero(amodal)
        instances.append({"box": [xs.min(), ys.min(), xs.max() + 1, ys.max() + 1], "occluded": instance["occluded_rate"] >= 0.05})
        # The modified evaluator.
        _ = instance["area"] * instance["occluded_rate"]
    return np.dstack([depth] * 3), instances


def evaluate(root, file):
    """SynTable's evaluation finds an annotation's image at the same position of the list."""
    data = json.loads(file.read_text())
    assert len(data["images"]) == len(data["annotations"]), "images are not repeated per annotation"
    matrices = {}
    for image, annotation in zip(data["images"], data["annotations"]):
        assert image["id"] == annotation["image_id"]
        matrices.setdefault(image["id"], np.load(root / image["occlusion_order_file_name"]))
    counts = {i: sum(a["image_id"] == i for a in data["annotations"]) for i in matrices}
    assert all(matrix.shape == (counts[i],) * 2 for i, matrix in matrices.items())
    text = file.read_text()
    assert json.dumps(data, indent=4) + "\n" == text, "not as Python indents"


def main():
    root, compat = pathlib.Path(sys.argv[1]), sys.argv[2]
    file = pathlib.Path(sys.argv[3]) if compat == "uoais" else root / "annotation_final.json"
    records = register(root, file)
    instances = [load(record)[1] for record in records]
    if compat == "syntable_1":
        evaluate(root, file)
    if compat != "coco":
        assert all(instances), "an image without annotations crashes the evaluation"
    assert any(instances), "nothing was read"
    print(f"{len(records)} images, {sum(map(len, instances))} objects, {sum(t['occluded'] for p in instances for t in p)} occluded")


if __name__ == "__main__":
    main()
