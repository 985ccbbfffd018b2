"""Stages in Python, which recipes name like all others.

    @st.annotator(reads=["rgb", "visible_mask"], provides={"darkness": st.PerObject(float)})
    def darkness(view):
        "Share of dark pixels of each object."
        return {id: float((view.rgb[mask].mean(-1) < 51).mean()) for id, mask in zip(view.ids, view.visible_masks)}

A decorator registers the stage in this process: `run`, `generate`, `convert` and `Recipe.check` know it from then on. The
command loads a file of stages with ``syntable --plugin my_stages.py …``. The same decorator again, as in a notebook cell,
replaces the stage. The library calls stages on its own threads, one call at a time because of Python's global lock.

A dataset records each stage with the digest of its code, so that no run continues a dataset that other code began. The
code of functions that the stage calls does not count, and code without a file, as in an interpreter, has no digest. If
the module has a ``__version__``, it is recorded in place of the digest: raise it with every change of what stages
return.
"""

from __future__ import annotations

import atexit

from .. import _syntable
from .._options import ObjectPool, Range
from ._arguments import Asset, Body, Finished, LitScene, Output, PlacedScene, Support, View
from ._calls import Unlucky
from ._decorators import annotator, asset_source, light, placer, sensor, writer
from ._products import Image, PerObject, Tensor, Value

__all__ = [
    "Asset",
    "Body",
    "Finished",
    "Image",
    "LitScene",
    "ObjectPool",
    "Output",
    "PerObject",
    "PlacedScene",
    "Range",
    "Support",
    "Tensor",
    "Unlucky",
    "Value",
    "View",
    "annotator",
    "asset_source",
    "light",
    "placer",
    "sensor",
    "writer",
]

# Threads of the library must not call Python while it ends.
atexit.register(_syntable.end_calls)
