"""The share of dark pixels of each object, in the annotations of a dataset: `07_own_annotation.py OUT`."""

import sys

import syntable as st


@st.annotator(reads=["rgb", "visible_mask"], provides={"darkness": st.PerObject(float, doc="Share of dark pixels.")})
def darkness(view):
    "Share of dark pixels of each visible object."
    dark = view.rgb.mean(axis=-1) < 51
    return {id: dark[mask].mean() for id, mask in zip(view.ids, view.visible_masks) if mask.any()}


st.run(st.recipe("quickstart").set("write.coco", {"include": ["darkness"]}), sys.argv[1])
