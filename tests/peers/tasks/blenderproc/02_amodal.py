"""Amodal masks, occlusion rates and occlusion order: `02_amodal.py FOLDER_OF_MESHES OUT`.

The BOP writer renders each object alone with pyrender. The order needs code: object i occludes object j where i is
visible in the amodal mask of j.
"""

import json
import sys

import blenderproc as bproc
import imageio.v3 as iio
import numpy as np

bproc.init()
from scene import build

objects = build(sys.argv[1])
bproc.renderer.enable_depth_output(activate_antialiasing=False)
bproc.renderer.enable_segmentation_output(map_by=["category_id", "instance", "name"])
data = bproc.renderer.render()
bproc.writer.write_bop(sys.argv[2], objects, depths=data["depth"], colors=data["colors"])

folder = f"{sys.argv[2]}/train_pbr/000000"
for view, rows in json.load(open(f"{folder}/scene_gt_info.json")).items():
    number = {one["name"]: one["idx"] for one in data["instance_attribute_maps"][int(view)]}
    visible = np.stack([data["instance_segmaps"][int(view)] == number.get(body.get_name(), -1) for body in objects])
    amodal = np.stack([iio.imread(f"{folder}/mask/{int(view):06}_{n:06}.png") > 0 for n in range(len(rows))])
    flat = [masks.reshape(len(objects), -1).astype(np.float32) for masks in (visible, amodal)]
    order = flat[0] @ flat[1].T > 0
    np.fill_diagonal(order, False)
    np.save(f"{sys.argv[2]}/order_{view}.npy", order)
    np.save(f"{sys.argv[2]}/visible_{view}.npy", visible)
    print(view, "occlusion rate", np.mean([1 - row["visib_fract"] for row in rows]), "order", order.sum())
