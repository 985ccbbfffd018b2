"""Wrong labels in the BOP folder of task 4: `09_wrong_labels.py OUT/bop`. BlenderProc has no such check."""

import json
import sys

import imageio.v3 as iio
import numpy as np

folder = f"{sys.argv[1]}/train_pbr/000000"
with open(f"{folder}/scene_gt_info.json") as file:
    views = json.load(file)
for view, rows in views.items():
    iio.imread(f"{folder}/rgb/{int(view):06}.png")
    shown = np.zeros((480, 640), int)
    for number, row in enumerate(rows):
        name = f"{int(view):06}_{number:06}.png"
        amodal, visible = (iio.imread(f"{folder}/{kind}/{name}") > 0 for kind in ("mask", "mask_visib"))
        shown += visible
        if (visible & ~amodal).any():
            print(name, "visible outside the amodal mask:", (visible & ~amodal).sum())
        if visible.sum() != row["px_count_visib"]:
            print(name, "px_count_visib", row["px_count_visib"], "mask", visible.sum())
        if abs(row["px_count_visib"] / max(row["px_count_all"], 1) - row["visib_fract"]) > 1e-6:
            print(name, "visib_fract", row["visib_fract"])
        y, x = np.nonzero(visible)
        box = [x.min(), y.min(), np.ptp(x), np.ptp(y)] if len(x) else [-1] * 4
        if np.abs(np.subtract(box, row["bbox_visib"])).max() > 1:
            print(name, "bbox_visib", row["bbox_visib"], "mask", box)
    if (shown > 1).any():
        print(view, "pixels of two visible masks:", (shown > 1).sum())
