"""Samples for a training loop, without a dataset: `06_training_loop.py FOLDER_OF_MESHES`."""

import sys

import kubric as kb
import torch
from scene import build


def samples(scenes):
    """Images with visible masks."""
    for seed in range(scenes):
        scene, renderer, objects = build(sys.argv[1], "scratch", seed, views=2)
        frames = renderer.render(return_layers=["rgba", "segmentation"])
        ids = kb.adjust_segmentation_idxs(frames["segmentation"], scene.assets, objects)[..., 0]
        for image, labels in zip(frames["rgba"], ids):
            masks = [labels == number + 1 for number in range(len(objects)) if (labels == number + 1).any()]
            yield torch.from_numpy(image[..., :3].copy()), [torch.from_numpy(mask) for mask in masks]


for image, masks in samples(2):
    print(image.shape, len(masks))
