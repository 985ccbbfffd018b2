"""Samples for a training loop, without a dataset: `06_training_loop.py`."""

import syntable as st
import torch
from syntable.torch import collate

stream = st.Stream(st.recipe("quickstart"), ["rgb", "visible_mask", "amodal_mask"])
for images, targets in torch.utils.data.DataLoader(stream.torch(), batch_size=2, collate_fn=collate):
    print(images[0].shape, {name: value.shape for name, value in targets[0].items() if hasattr(value, "shape")})
