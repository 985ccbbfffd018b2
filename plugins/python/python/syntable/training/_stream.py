"""One view after the other, in shards, from any point."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from .. import _syntable
from .._arguments import whole
from ..generating import Generation, product_names, thread_count
from ..progress import Progress, listener
from ..recipes import Recipe, as_recipe
from ..samples import Sample
from ._queue import _Queue
from ._views import _scenes_of

if TYPE_CHECKING:
    from ..torch import DetectionStream, Transform

#: Number of scenes of an endless stream: the most that a recipe may have.
_ENDLESS = 100_000_000


class Stream:
    """The samples of a recipe as an endless stream or in passes, shared among processes, resumable at any sample.

    Each of ``world`` processes takes every ``world``-th scene. Without ``rank`` and ``world``, they come from
    ``torch.distributed``, if it is initialized, and from the worker of PyTorch's DataLoader that iterates. Threads make
    a few samples ahead, and wait while nobody takes them: ``num_workers=0`` is the best setting of a DataLoader.

    ``for sample in stream`` begins where the stream stands, and ends with the pass. The next loop begins the next pass:
    the same scenes again. ``state_dict()`` is one integer; `load_state_dict` continues exactly after that sample.

    Args:
        recipe: A recipe, its path, ``builtin:NAME``, or dicts.
        products: What samples have; see `generate`.
        scenes: Numbers of the scenes, such as ``range(100, 200)``. Default: all scenes of the recipe.
        endless: Go on after the recipe's last scene with further scenes, which never repeat.
        rank: Number of this process, from 0.
        world: Number of processes.
        threads: Number of threads; samples do not depend on it. Default: all cores.
        ahead: Number of samples that wait for the caller, in addition to the scenes in work.
        allow_code: Run code that the recipe brings: native libraries and programs.
        progress: Shows progress, or receives every event; see `Progress`.

    Raises:
        RecipeError: If the recipe has mistakes.
        ValueError: If ``rank`` is not below ``world``, or both ``scenes`` and ``endless`` are given.
    """

    def __init__(
        self,
        recipe: Recipe | str | os.PathLike[str] | Mapping[str, Any],
        products: Iterable[str] | None = None,
        *,
        scenes: range | tuple[int, int] | int | None = None,
        endless: bool = False,
        rank: int | None = None,
        world: int | None = None,
        threads: int | None = None,
        ahead: int = 4,
        allow_code: bool = False,
        progress: Progress = False,
    ) -> None:
        made = as_recipe(recipe)
        if endless and scenes is not None:
            raise ValueError("an endless stream has all scenes: leave out `scenes`, or `endless`")
        if (rank is None) != (world is None):
            raise ValueError("rank and world come together: the number of this process, and the number of processes")
        if rank is not None and world is not None:
            world = whole(world, "world", 1)
            if whole(rank, "rank", 0) >= world:
                raise ValueError(f"rank is below world ({world}), not {rank}")
        if endless:
            made = made.set("dataset.scenes", _ENDLESS)
        self._recipe = made
        self._scenes = _scenes_of(made, scenes)
        self._per_scene = made.views_per_scene
        self._shard = None if rank is None or world is None else (int(rank), world)
        self._options = (product_names(products), thread_count(threads), bool(allow_code), progress)
        self._ahead = whole(ahead, "ahead", 0)
        self._next = 0
        self._turn = object()

    @property
    def views_per_scene(self) -> int:
        """Number of views of each scene."""
        return self._per_scene

    def shard(self) -> tuple[int, int]:
        """Number of this process or worker, and number of all."""
        return self._shard or _shard_of_process()

    def __iter__(self) -> StreamLoop:
        return StreamLoop(self)

    def _generation(self, first: int, end: int, step: int) -> Generation:
        products, threads, allow_code, progress = self._options
        raw = _syntable.Generator(
            self._recipe._raw, products, (first, end, step), threads, allow_code, listener(progress)
        )
        return Generation(raw)

    def state_dict(self) -> dict[str, int]:
        """The position: the number of views of this process up to the next sample."""
        return {"next": self._next}

    def load_state_dict(self, state: Mapping[str, int]) -> None:
        """Continues from a position: the next loop begins with the sample after it.

        Raises:
            TypeError: If it is not the state of a stream.
            ValueError: If the position is below 0.
        """
        if not isinstance(state, Mapping) or set(state) != {"next"}:
            raise TypeError(f"the state of a stream is {{'next': number}}, not {state!r}")
        self._next = whole(state["next"], "next", 0)
        self._turn = object()

    def torch(self, transform: Transform | None = None, *, products: Iterable[str] = ()) -> DetectionStream:
        """The stream as an iterable dataset of PyTorch; see `syntable.torch.DetectionStream`."""
        from ..torch import DetectionStream

        return DetectionStream(self, transform, products=products)

    def __repr__(self) -> str:
        return f"Stream({self._recipe!r}: sample {self._next} of {'shard %d of %d' % self.shard()})"

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_turn"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._turn = object()


def _shard_of_process() -> tuple[int, int]:
    """Rank and number of processes by PyTorch, if it is imported."""
    rank, world = 0, 1
    distributed = sys.modules.get("torch.distributed")
    if distributed is not None and distributed.is_available() and distributed.is_initialized():
        rank, world = distributed.get_rank(), distributed.get_world_size()
    data = sys.modules.get("torch.utils.data")
    worker = data.get_worker_info() if data is not None else None
    if worker is not None:
        rank, world = rank * worker.num_workers + worker.id, world * worker.num_workers
    return rank, world


class StreamLoop(Iterator[Sample]):
    """One loop over a stream. `close`, and its deletion, end the work."""

    def __init__(self, stream: Stream) -> None:
        # A new loop ends the ones before: they would take the same samples.
        self._turn = stream._turn = object()
        self._stream = stream
        #: Position of the sample before the next one.
        self.place = -1
        self._rank, self._world = stream.shard()
        first, end = stream._scenes
        turns, view = divmod(stream._next, stream._per_scene)
        start = first + self._rank + turns * self._world
        self._queue: _Queue[Sample] | None = None
        self._is_closed = False
        if start < end:
            samples = stream._generation(start, end, self._world)
            self._queue = _Queue(samples, stream._ahead, samples.close)

    def __iter__(self) -> StreamLoop:
        return self

    def __next__(self) -> Sample:
        stream = self._stream
        if self._turn is not stream._turn:
            self.close()
            raise RuntimeError("another loop over this stream has begun: use one stream for each loop")
        for sample in self._queue or ():
            scene = (sample.scene - stream._scenes[0] - self._rank) // self._world
            place = scene * stream._per_scene + sample.view
            # The scene may have views from before the stop.
            if place >= stream._next:
                self.place, stream._next = place, place + 1
                return sample
        if self._is_closed:
            raise StopIteration
        self.close()
        stream._next, stream._turn = 0, object()
        raise StopIteration

    def close(self) -> None:
        """Ends the work. The stream keeps its position."""
        self._is_closed = True
        queue, self._queue = self._queue, None
        if queue is not None:
            queue.close()

    def __del__(self) -> None:
        if getattr(self, "_queue", None) is not None:
            self.close()

    def __reduce__(self) -> Any:
        raise TypeError("a loop over a stream cannot be pickled: pass the stream")
