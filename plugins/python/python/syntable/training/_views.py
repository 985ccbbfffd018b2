"""Views of a recipe by number."""

from __future__ import annotations

import os
import random
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, overload

from .. import _syntable
from .._arguments import whole
from ..generating import product_names, scene_range, thread_count
from ..progress import Progress, listener
from ..recipes import Recipe, as_recipe
from ..samples import Sample

if TYPE_CHECKING:
    from ..torch import DetectionDataset, Transform


class Views(Sequence[Sample]):
    """The views of a recipe by number, made when they are asked for: ``views[i]`` is a pure function of recipe and
    ``i``.

    Any order, sampler and number of processes gives the same samples, equal to those of `generate` and `run`. View
    ``i`` is view ``i % views_per_scene`` of scene ``i // views_per_scene``. A scene is made as a whole, since a view
    that fails its checks changes the whole scene, and the last scenes are kept: ask for views of one scene one after
    the other, or use `order`, which shuffles so.

    Views can be pickled, and used by several threads. Each process has threads of its own: start it with ``spawn``.

    Args:
        recipe: A recipe, its path, ``builtin:NAME``, or dicts.
        products: What samples have; see `generate`.
        scenes: Numbers of the scenes, such as ``range(100, 200)``. Default: all scenes of the recipe.
        threads: Number of threads; samples do not depend on it. Default: all cores.
        keep: Number of scenes to keep in memory.
        allow_code: Run code that the recipe brings: native libraries and programs.
        progress: Shows progress, or receives every event; see `Progress`.

    Raises:
        RecipeError: If the recipe has mistakes.
    """

    def __init__(
        self,
        recipe: Recipe | str | os.PathLike[str] | Mapping[str, Any],
        products: Iterable[str] | None = None,
        *,
        scenes: range | tuple[int, int] | int | None = None,
        threads: int | None = None,
        keep: int = 8,
        allow_code: bool = False,
        progress: Progress = False,
    ) -> None:
        made = as_recipe(recipe)
        self._parts = (
            made,
            product_names(products),
            _scenes_of(made, scenes),
            thread_count(threads),
            whole(keep, "keep", 1),
            bool(allow_code),
            progress,
        )
        self._begin()

    def _begin(self) -> None:
        recipe, products, (self._first, self._end), threads, keep, allow_code, progress = self._parts
        self._per_scene = recipe.views_per_scene
        self._raw = _syntable.Scenes(recipe._raw, products, keep, threads, allow_code, listener(progress))

    @property
    def views_per_scene(self) -> int:
        """Number of views of each scene."""
        return self._per_scene

    def __len__(self) -> int:
        return (self._end - self._first) * self._per_scene

    def _place(self, index: Any) -> tuple[int, int]:
        if isinstance(index, bool) or not hasattr(index, "__index__"):
            raise TypeError(f"a view is named by its number, an integer, not {index!r}")
        place = index.__index__()
        place += len(self) if place < 0 else 0
        if not 0 <= place < len(self):
            raise IndexError(f"view {index} of {len(self)} views")
        scene, view = divmod(place, self._per_scene)
        return (self._first + scene, view)

    @overload
    def __getitem__(self, index: int) -> Sample: ...
    @overload
    def __getitem__(self, index: slice) -> list[Sample]: ...
    def __getitem__(self, index: int | slice) -> Sample | list[Sample]:
        """A view, or several.

        Raises:
            IndexError: If there is no such view.
            SyntableError: If its scene fails.
        """
        if isinstance(index, slice):
            return self.__getitems__(range(*index.indices(len(self))))
        return self.__getitems__([index])[0]

    def __getitems__(self, indices: Iterable[int]) -> list[Sample]:
        """Several views, with their scenes made in parallel. DataLoader calls it for each batch."""
        return [Sample(raw) for raw in self._raw.views([self._place(index) for index in indices])]

    def order(self, seed: int = 0) -> list[int]:
        """All numbers of views, shuffled: scenes in random order, and the views of each scene together, in random
        order.

        Args:
            seed: Another seed is another order: pass the number of the epoch.
        """
        draw = random.Random(whole(seed, "seed", -(2**63)))
        scenes = list(range(self._end - self._first))
        draw.shuffle(scenes)
        order: list[int] = []
        for scene in scenes:
            views = list(range(scene * self._per_scene, (scene + 1) * self._per_scene))
            draw.shuffle(views)
            order += views
        return order

    def close(self) -> None:
        """Ends the threads, and forgets the scenes. A later view starts them again."""
        self._raw.close()

    def torch(self, transform: Transform | None = None, *, products: Iterable[str] = ()) -> DetectionDataset:
        """The views as a map-style dataset of PyTorch; see `syntable.torch.DetectionDataset`."""
        from ..torch import DetectionDataset

        return DetectionDataset(self, transform, products=products)

    def __repr__(self) -> str:
        return f"Views({self._parts[0]!r}: {len(self)} views of scenes {self._first} to {self._end - 1})"

    def __getstate__(self) -> dict[str, Any]:
        return {"parts": self._parts}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._parts = state["parts"]
        self._begin()


def _scenes_of(recipe: Recipe, scenes: range | tuple[int, int] | int | None) -> tuple[int, int]:
    """Numbers of scenes that a recipe has.

    Raises:
        ValueError: If it lacks some.
    """
    count = recipe.scenes
    first, end = scene_range(scenes) or (0, count)
    if end > count:
        raise ValueError(f"scenes {first} to {end} (exclusive): the recipe has {count} scenes")
    return (first, end)
