"""Samples in memory: views of a recipe without files."""

from __future__ import annotations

import operator
import os
from collections.abc import Iterable, Iterator, Mapping
from types import TracebackType
from typing import Any

from . import _syntable
from ._arguments import index, whole
from .progress import Progress, listener
from .recipes import Recipe, as_recipe
from .samples import Sample

__all__ = ["Generation", "generate"]

#: Products of every sample: camera, objects and categories cost next to nothing.
ALWAYS = ("camera", "object_info", "category_id")

#: Products of samples whose caller names none.
DEFAULT = (
    "rgb",
    "depth",
    "visible_mask",
    "amodal_mask",
    "visible_box",
    "amodal_box",
    "occlusion_rate",
    "occlusion_order",
)

#: Properties of samples, and the products that they need.
PROPERTIES = {
    "visible_masks": ("visible_mask",),
    "amodal_masks": ("amodal_mask",),
    "occlusion_masks": ("occlusion_mask",),
    "visible_boxes": ("visible_box",),
    "amodal_boxes": ("amodal_box",),
    "occlusion_rates": ("occlusion_rate",),
    "objects": (),
    "ids": (),
}


def product_names(products: Iterable[str] | None) -> list[str]:
    """Names of products as the library knows them, each once.

    Raises:
        TypeError: If they are not names.
    """
    if isinstance(products, str):
        raise TypeError(f"products is a list of names, such as [{products!r}]")
    names: dict[str, None] = {}
    for name in DEFAULT if products is None else products:
        if not isinstance(name, str):
            raise TypeError(f"a product is named by text, not {name!r}")
        names.update(dict.fromkeys(PROPERTIES.get(name, (name,))))
    names.update(dict.fromkeys(ALWAYS))
    return list(names)


def scene_range(scenes: range | tuple[int, int] | int | None) -> tuple[int, int] | None:
    """Scenes as a half-open pair.

    Raises:
        TypeError: If it is neither a range, a pair nor one number.
        ValueError: If the range has steps, is empty or begins before 0.
    """
    if scenes is None:
        return None
    if isinstance(scenes, bool):
        raise TypeError("scenes is a range, such as range(0, 10)")
    one = index(scenes)
    if one is not None:
        scenes = range(one, one + 1)
    if isinstance(scenes, range):
        if scenes.step != 1:
            raise ValueError(f"scenes are made one after the other: {scenes} has steps of {scenes.step}")
        scenes = (scenes.start, scenes.stop)
    try:
        first, end = map(operator.index, scenes)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise TypeError(f"scenes is a range, such as range(0, 10), not {scenes!r}") from None
    if not 0 <= first < end < 2**32:
        raise ValueError(f"scenes {first} to {end} (exclusive) are no scenes: numbers begin at 0")
    return (first, end)


def thread_count(threads: int | None) -> int | None:
    """A number of threads.

    Raises:
        TypeError: If it is not an integer.
        ValueError: If it is not between 1 and 1024.
    """
    return None if threads is None else whole(threads, "threads", 1, 1024)


class Generation(Iterator[Sample]):
    """Iterator of samples in the order of scenes and views. Threads make them ahead, and wait while nobody takes them.

    It ends after the last sample; ``failed`` then has the numbers of scenes that could not be made. `close`, the end of
    a ``with`` block, and its deletion end the work early.
    """

    def __init__(self, raw: _syntable.Generator) -> None:
        self._raw = raw

    def __iter__(self) -> Generation:
        return self

    def __next__(self) -> Sample:
        return Sample(next(self._raw))

    @property
    def failed(self) -> list[int]:
        """Numbers of the scenes that failed, ascending. Complete after the last sample."""
        return self._raw.failed

    def close(self) -> None:
        """Ends the work, and the iterator with it. Stages in Python that run two seconds longer are interrupted."""
        self._raw.close()

    def __enter__(self) -> Generation:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __reduce__(self) -> Any:
        raise TypeError("samples in the making cannot be pickled: pass the recipe, and generate them there")


def generate(
    recipe: Recipe | str | os.PathLike[str] | Mapping[str, Any],
    products: Iterable[str] | None = None,
    *,
    scenes: range | tuple[int, int] | int | None = None,
    threads: int | None = None,
    allow_code: bool = False,
    progress: Progress = False,
) -> Generation:
    """Makes the views of a recipe in memory, one after the other.

    A sample has the pixels and labels that `run` would write for the same recipe, scene and view.

    Args:
        recipe: A recipe, its path, ``builtin:NAME``, or dicts.
        products: What samples have, such as ``["rgb", "depth", "amodal_mask"]``. Camera, object information and
            categories are always there. Only what is named is computed. Default: image, depth, masks, boxes, occlusion
            rates and order.
        scenes: Numbers of the scenes, such as ``range(100, 200)``. Default: all scenes of the recipe.
        threads: Number of threads; samples do not depend on it. Default: all cores.
        allow_code: Run code that the recipe brings: native libraries and programs.
        progress: Shows progress, or receives every event; see `Progress`.

    Raises:
        RecipeError: If the recipe has mistakes.
        SyntableError: If the work fails. A scene that fails has no samples, and is in `Generation.failed`.
    """
    made = scene_range(scenes)
    raw = _syntable.Generator(
        as_recipe(recipe)._raw,
        product_names(products),
        None if made is None else (*made, 1),
        thread_count(threads),
        bool(allow_code),
        listener(progress),
    )
    return Generation(raw)
