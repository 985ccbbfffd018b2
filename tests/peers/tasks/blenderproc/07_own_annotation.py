"""The share of dark pixels of each object, added to the dataset of task 1: `07_own_annotation.py OUT`."""

import json
import sys

import imageio.v3 as iio
from pycocotools.coco import COCO

coco = COCO(f"{sys.argv[1]}/coco_annotations.json")
for annotation in coco.dataset["annotations"]:
    image = iio.imread(f"{sys.argv[1]}/{coco.imgs[annotation['image_id']]['file_name']}")
    dark = image[..., :3].mean(axis=-1) < 51
    annotation["darkness"] = float(dark[coco.annToMask(annotation) > 0].mean())
with open(f"{sys.argv[1]}/coco_annotations.json", "w") as file:
    json.dump(coco.dataset, file)
