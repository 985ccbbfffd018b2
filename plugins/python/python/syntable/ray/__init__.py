"""Datasets on a Ray cluster: `run` makes one in files, and `dataset` makes one in memory for Ray Data.

    import syntable as st
    import syntable.ray

    recipe = st.recipe("quickstart")
    syntable.ray.run(recipe, "s3://bucket/mine")             # the files of st.run(recipe, "s3://bucket/mine")
    views = syntable.ray.dataset(recipe, ["rgb", "depth"])   # a ray.data.Dataset with a row per view

Every node needs this package, in the same version.
"""

from __future__ import annotations

try:
    import ray as _  # type: ignore[import-not-found, import-untyped, unused-ignore]
except ImportError:
    raise ImportError('work on a cluster needs Ray: pip install "ray[data]"') from None

from ._running import run
from ._views import dataset

__all__ = ["dataset", "run"]
