#!/usr/bin/env python3
"""Reads a COCO file with pycocotools and compares the masks with the run lengths in the field `expected`.

    python3 check_coco.py FILE
"""

import sys

from pycocotools import mask as coco_mask
from pycocotools.coco import COCO


def main():
    coco = COCO(sys.argv[1])
    assert coco.getImgIds() == [1] and coco.getCatIds(catNms=["object"]) == [1]
    annotations = coco.loadAnns(coco.getAnnIds())
    for annotation in annotations:
        rle = coco.annToRLE(annotation)
        got = rle["counts"]
        got = got if isinstance(got, str) else got.decode()
        name = f"annotation {annotation['id']}: {annotation['segmentation']}"
        assert got == annotation["expected"], f"{name}: {got}, not {annotation['expected']}"
        assert coco_mask.area(rle) == annotation["area"], f"{name}: area"
    print(f"{len(annotations)} masks")


if __name__ == "__main__":
    main()
