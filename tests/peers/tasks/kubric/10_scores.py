"""AP and overlap F of predicted amodal masks, with pycocotools: `10_scores.py OUT` for the output of task 2.

The predictions are the labels, moved by three pixels.
"""

import glob
import sys

import numpy as np
from pycocotools import mask
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval
from scipy.optimize import linear_sum_assignment

truth, found = [], []
for view, file in enumerate(sorted(glob.glob(f"{sys.argv[1]}/labels_*.npz"))):
    labels = np.load(file)
    for amodal in labels["amodal"][labels["visible"].any(axis=(1, 2))]:
        for objects, array in ((truth, amodal), (found, np.roll(amodal, 3, axis=1))):
            code = mask.encode(np.asfortranarray(array.astype(np.uint8)))
            objects.append(
                {"id": len(objects) + 1, "image_id": view, "category_id": 1, "iscrowd": 0, "score": 1.0}
                | {"segmentation": code, "area": float(array.sum()), "bbox": mask.toBbox(code).tolist()}
            )
views = sorted({one["image_id"] for one in truth})
coco = COCO()
images = [{"id": view, "height": 480, "width": 640} for view in views]
coco.dataset = {"images": images, "annotations": truth, "categories": [{"id": 1}]}
coco.createIndex()
scores = COCOeval(coco, coco.loadRes(found), "segm")
scores.evaluate()
scores.accumulate()
scores.summarize()

each = []
for view in views:
    label, guess = ([mask.decode(o["segmentation"]) for o in all if o["image_id"] == view] for all in (truth, found))
    label, guess = (np.stack(masks).reshape(len(masks), -1).astype(float) for masks in (label, guess))
    shared = label @ guess.T
    f = 2 * shared / (label.sum(axis=1)[:, None] + guess.sum(axis=1))
    rows, columns = linear_sum_assignment(-f)
    overlap = shared[rows, columns].sum()
    precision, recall = overlap / guess.sum(), overlap / label.sum()
    each.append(2 * precision * recall / (precision + recall))
print("amodal F", 100 * np.mean(each))
