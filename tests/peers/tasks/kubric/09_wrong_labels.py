"""Wrong labels in the COCO file of task 4: `09_wrong_labels.py OUT`. Kubric has no such check."""

import sys

import imageio.v3 as iio
import numpy as np
from pycocotools import mask
from pycocotools.coco import COCO

coco = COCO(f"{sys.argv[1]}/coco_annotations.json")
for view, image in coco.imgs.items():
    iio.imread(f"{sys.argv[1]}/{image['file_name']}")
    shown = np.zeros((480, 640), int)
    for one in coco.imgToAnns[view]:
        visible = coco.annToMask(one)
        shown += visible
        if visible.sum() != one["area"]:
            print(view, one["id"], "area", one["area"], "mask", visible.sum())
        box = mask.toBbox(mask.encode(np.asfortranarray(visible))).tolist()
        if box != one["bbox"]:
            print(view, one["id"], "bbox", one["bbox"], "mask", box)
    if (shown > 1).any():
        print(view, "pixels of two visible masks:", (shown > 1).sum())
