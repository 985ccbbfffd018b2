"""Samples for a training loop, without a dataset: `06_training_loop.py FOLDER_OF_MESHES`."""

import sys

import blenderproc as bproc
import torch

bproc.init()
from scene import build


def samples(scenes):
    """Images with visible masks. Amodal masks exist only in the files of the BOP writer."""
    for seed in range(scenes):
        bproc.clean_up(clean_up_camera=True)
        build(sys.argv[1], seed, views=2)
        bproc.renderer.enable_segmentation_output(map_by=["category_id", "instance"])
        data = bproc.renderer.render()
        for image, ids, table in zip(data["colors"], data["instance_segmaps"], data["instance_attribute_maps"]):
            masks = [ids == one["idx"] for one in table if one["category_id"] > 0]
            yield torch.from_numpy(image.copy()), [torch.from_numpy(mask) for mask in masks]


for image, masks in samples(2):
    print(image.shape, len(masks))
