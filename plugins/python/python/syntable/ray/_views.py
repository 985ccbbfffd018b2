"""Views of a recipe as a dataset of Ray Data."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from .._arguments import whole
from ..generating import DEFAULT, PROPERTIES, product_names, scene_range, thread_count
from ..recipes import Recipe, as_recipe
from ._nodes import Job, connect

if TYPE_CHECKING:
    import ray.data  # type: ignore[import-not-found, import-untyped, unused-ignore]

__all__ = ["dataset"]


def dataset(
    recipe: Recipe | str | os.PathLike[str] | Mapping[str, Any],
    products: Iterable[str] | None = None,
    *,
    scenes: range | tuple[int, int] | int | None = None,
    threads: int = 1,
    gpus: float = 0,
    blocks: int | None = None,
    plugins: Iterable[str | os.PathLike[str]] = (),
    allow_code: bool = False,
    runtime_env: Mapping[str, Any] | None = None,
) -> ray.data.Dataset:
    """The views of a recipe as a dataset of Ray Data, with a row for each view. Nothing is made before it is read.

    Tasks on all nodes make the scenes with ``st.generate``, while other tasks read their rows. Rows depend on scene and
    view alone, and not on the number of tasks. Their order is that of the tasks, unless
    ``ray.data.DataContext.get_current().execution_options.preserve_order`` is True.

    A row has these columns, and those of ``products``:

    ========================  ===============================================================================
    column                    value
    ========================  ===============================================================================
    ``scene``, ``view``       numbers, from 0
    ``ids``                   ids of the annotated objects, ascending: the order of all rows over objects
    a value per pixel         array, height × width or height × width × channels
    a mask per object         objects × height × width, bool
    a number per object       objects, float; NaN where an object has none
    numbers per object        objects × numbers, float, such as boxes (x, y, width, height), px
    a text per object         list of texts
    an image per object       objects × height × width and more; zeros where an object has none
    a record                  JSON, as text
    ``camera``                JSON, as text; with ``K`` (3 × 3, px) and ``world_from_camera`` (4 × 4, m)
    ========================  ===============================================================================

    Arrays over objects have as many rows as the view has objects. A batch has them as an array of arrays.

    Args:
        recipe: A recipe, its path, ``builtin:NAME``, or dicts. See `run` on its way to the nodes.
        products: Names of the columns, such as ``["rgb", "depth", "amodal_mask"]``. Only what is named is computed.
            Default: image, depth, masks, boxes, occlusion rates and order.
        scenes: Numbers of the scenes, such as ``range(100, 200)``. Default: all scenes of the recipe.
        threads: Number of threads of a task, and of processors that it reserves.
        gpus: Number of graphics cards that a task reserves; a part of 1 lets tasks share a card.
        blocks: Number of tasks. Default: Ray Data decides by the size of the rows and by the cluster.
        plugins: Python files and modules with stages, which each task loads.
        allow_code: Run code that the recipe brings: native libraries and programs.
        runtime_env: Ray's environment of the tasks.

    Raises:
        RecipeError: If the recipe has mistakes. Mistakes on a node raise when the dataset is read.
        ImportError: Without ``ray[data]``.

    A scene that fails has no rows, and a warning in the log of its task.
    """
    try:
        from ray.data import read_datasource  # type: ignore[import-not-found, import-untyped, unused-ignore]
    except ImportError:
        raise ImportError('datasets of Ray Data need pandas and PyArrow: pip install "ray[data]"') from None
    from ._source import Views

    read = as_recipe(recipe)
    made = scene_range(scenes)
    names = list(DEFAULT) if products is None else _columns(products)
    source = Views(
        Job.of(read, plugins),
        names,
        made or (0, read.scenes),
        read.views_per_scene,
        thread_count(threads) or 1,
        bool(allow_code),
    )
    env = connect(runtime_env)
    more = {} if env is None else {"runtime_env": env}
    return read_datasource(
        source,
        num_cpus=source.threads,
        num_gpus=gpus or None,
        override_num_blocks=None if blocks is None else whole(blocks, "blocks", 1),
        **more,
    )


def _columns(products: Iterable[str]) -> list[str]:
    """The products of the columns: `visible_masks` means `visible_mask`, as for `st.generate`."""
    names = list(dict.fromkeys(products)) if not isinstance(products, str) else products
    product_names(names)
    found = (name for product in names for name in PROPERTIES.get(product, (product,)))
    return list(dict.fromkeys(found))
