"""The dataset of task 1 as COCO: `04_coco.py OUT`. Kubric has no writer for COCO or BOP."""

import json
import sys

import numpy as np
from PIL import Image
from pycocotools import mask

with open(f"{sys.argv[1]}/metadata.json") as file:
    names = json.load(file)["objects"]
images, annotations = [], []
for frame in range(4):
    images.append({"id": frame, "file_name": f"rgba_{frame:05}.png", "width": 640, "height": 480})
    ids = np.asarray(Image.open(f"{sys.argv[1]}/segmentation_{frame:05}.png"))
    for number in set(ids[ids > 0].tolist()):
        code = mask.encode(np.asfortranarray(ids == number).astype(np.uint8))
        annotations.append(
            {"id": len(annotations) + 1, "image_id": frame, "category_id": 1, "iscrowd": 0, "name": names[number - 1]}
            | {"bbox": mask.toBbox(code).tolist(), "area": int(mask.area(code))}
            | {"segmentation": {"size": [480, 640], "counts": code["counts"].decode()}}
        )
with open(f"{sys.argv[1]}/coco_annotations.json", "w") as file:
    categories = [{"id": 1, "name": "object"}]
    json.dump({"images": images, "annotations": annotations, "categories": categories}, file)
