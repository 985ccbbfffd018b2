"""Amodal masks, occlusion rates and occlusion order of the dataset of task 1: `02_amodal.py DATASET`."""

import sys

import syntable as st

for sample in st.open(sys.argv[1]):
    print(sample.name, "occlusion rate", sample.occlusion_rates.mean(), "order", sample.occlusion_order.sum())
    assert (sample.visible_masks <= sample.amodal_masks).all()
