"""Amodal masks, occlusion rates and occlusion order: `02_amodal.py FOLDER_OF_MESHES OUT`.

Kubric has none of them. The script renders each object alone. Object i occludes object j where i is visible in the
amodal mask of j.
"""

import sys

import kubric as kb
import numpy as np
from scene import build

scene, renderer, objects = build(sys.argv[1], "scratch")
frames = renderer.render(return_layers=["rgba", "segmentation"])
ids = kb.adjust_segmentation_idxs(frames["segmentation"], scene.assets, objects)[..., 0]
visible = np.stack([ids == number + 1 for number in range(len(objects))])
renderer.samples_per_pixel, renderer.use_denoising = 1, False
amodal = []
for body in objects:
    for other in scene.assets:
        if isinstance(other, kb.PhysicalObject):
            other.linked_objects[renderer].hide_render = other is not body
    amodal.append(renderer.render(return_layers=["segmentation"])["segmentation"][..., 0] > 0)
amodal = np.stack(amodal)
kb.write_image_dict(frames, sys.argv[2])
for frame in range(len(ids)):
    flat = [masks[:, frame].reshape(len(objects), -1).astype(np.float32) for masks in (visible, amodal)]
    order = flat[0] @ flat[1].T > 0
    np.fill_diagonal(order, False)
    rate = 1 - flat[0].sum(axis=1) / np.maximum(flat[1].sum(axis=1), 1)
    labels = {"visible": visible[:, frame], "amodal": amodal[:, frame], "rate": rate, "order": order}
    np.savez(f"{sys.argv[2]}/labels_{frame}.npz", **labels)
    print(frame, "occlusion rate", rate.mean(), "order", order.sum(), "outside", (visible & ~amodal)[:, frame].sum())
