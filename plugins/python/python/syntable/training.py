"""Data for training: views by number, streams that resume, a buffer that grows while a net trains on it."""

from __future__ import annotations

import atexit
import os
import random
import sys
import threading
import weakref
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import GeneratorType, TracebackType
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

from . import _syntable
from ._arguments import whole
from .errors import SyntableError
from .generating import Generation, product_names, scene_range, thread_count
from .progress import Progress, listener
from .recipes import Recipe, as_recipe
from .samples import Sample

if TYPE_CHECKING:
    from .torch import DetectionDataset, DetectionStream, Transform

__all__ = ["Buffer", "Stream", "StreamLoop", "Views"]

#: Number of scenes of an endless stream: the most that a recipe may have.
_ENDLESS = 100_000_000


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
        from .torch import DetectionDataset

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
        from .torch import DetectionStream

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
        self._rank, self._world = stream.shard()
        first, end = stream._scenes
        turns, view = divmod(stream._next, stream._per_scene)
        start = first + self._rank + turns * self._world
        self._queue: _Queue[Sample] | None = None
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
                stream._next = place + 1
                return sample
        self.close()
        stream._next, stream._turn = 0, object()
        raise StopIteration

    def close(self) -> None:
        """Ends the work. The stream keeps its position."""
        queue, self._queue = self._queue, None
        if queue is not None:
            queue.close()

    def __del__(self) -> None:
        if getattr(self, "_queue", None) is not None:
            self.close()

    def __reduce__(self) -> Any:
        raise TypeError("a loop over a stream cannot be pickled: pass the stream")


_T = TypeVar("_T")


class _Queue(Generic[_T]):
    """A bounded queue that a thread fills from an iterator."""

    #: Interval at which a waiting thread handles signals, s.
    INTERVAL = 0.1

    def __init__(self, source: Iterator[_T], size: int, close: Callable[[], None] | None) -> None:
        self._items: deque[_T] = deque()
        # Even without a place in the queue, the thread holds one item.
        self._size = max(1, size)
        self._changed = threading.Condition()
        self._is_closed = False
        self._is_over = False
        self._error: BaseException | None = None
        self._close_source = close
        self._process = os.getpid()
        self._thread = threading.Thread(target=self._fill, args=(source,), name="syntable samples", daemon=True)
        self._thread.start()
        _QUEUES.add(self)

    def _fill(self, source: Iterator[_T]) -> None:
        try:
            for item in source:
                with self._changed:
                    while len(self._items) >= self._size and not self._is_closed:
                        self._changed.wait()
                    if self._is_closed:
                        return
                    self._items.append(item)
                    self._changed.notify_all()
        except BaseException as error:  # the thread that takes items raises it
            self._error = error
        finally:
            with self._changed:
                self._is_over = True
                self._changed.notify_all()

    def __iter__(self) -> Iterator[_T]:
        return self

    def __next__(self) -> _T:
        self._check_process()
        with self._changed:
            while not self._items and not self._is_over and not self._is_closed:
                self._changed.wait(self.INTERVAL)
            if self._items:
                item = self._items.popleft()
                self._changed.notify_all()
                return item
            error, self._error = self._error, None
        if error is not None and not self._is_closed:
            raise error
        raise StopIteration

    def ready(self) -> bool:
        """Whether an item is here."""
        self._check_process()
        with self._changed:
            return bool(self._items)

    def close(self) -> None:
        """Ends the thread."""
        if os.getpid() != self._process:
            return
        _QUEUES.discard(self)
        with self._changed:
            self._is_closed = True
            self._items.clear()
            self._changed.notify_all()
        if self._close_source is not None:
            self._close_source()
        if self._thread is not threading.current_thread():
            self._thread.join()

    def _check_process(self) -> None:
        if os.getpid() != self._process:
            raise SyntableError(
                "this process was forked from one that had begun to make samples, and lacks its threads "
                '(start processes with multiprocessing\'s "spawn", or pass num_workers=0 to a DataLoader)'
            )


#: Queues whose threads work. They must end before Python does.
_QUEUES: weakref.WeakSet[_Queue[Any]] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    for queue in list(_QUEUES):
        queue.close()


class Buffer(Generic[_T]):
    """A pool of the latest samples, which grows while a net trains on it.

    Making a sample takes longer than a training step on it. A buffer lets each sample be drawn several times, in
    different batches, while a thread makes further ones. Once it is full, a new sample replaces the oldest one.

    The thread takes a few samples ahead: while a buffer works, its stream's ``state_dict`` is ahead of the batches.

    With ``reuse``, the buffer takes a new sample for every ``reuse`` samples drawn, and waits for it if necessary: the
    batches depend on the stream and the seed alone. Without it, the buffer takes whatever is made, and never waits:
    batches come as fast as possible, and depend on time.

    Args:
        stream: Samples: a `Stream`, `generate`, or any iterable.
        size: Number of samples to hold.
        start: Number of samples before the first batch.
        reuse: Number of times that a sample is drawn on average.
        seed: Seed of the draws.
        transform: What the buffer holds of a sample, such as tensors. It is called in the thread that makes samples.

    Raises:
        TypeError: If ``stream`` cannot be iterated.
        ValueError: If a number is out of range.
    """

    def __init__(
        self,
        stream: Iterable[Any],
        size: int,
        *,
        start: int = 1,
        reuse: float | None = 16,
        seed: int = 0,
        transform: Callable[[Any], _T] | None = None,
    ) -> None:
        self._size = whole(size, "size", 1)
        self._start = whole(start, "start", 1, self._size)
        if reuse is not None and not reuse > 0:
            raise ValueError(f"reuse is a positive number, or None, not {reuse!r}")
        if transform is not None and not callable(transform):
            raise TypeError(f"transform is a function of a sample, not {transform!r}")
        self._reuse = reuse
        self._draw = random.Random(whole(seed, "seed", -(2**63)))
        self._held: list[_T] = []
        self._taken = 0
        self._credit = 0.0
        self._lock = threading.Lock()
        self._is_closed = False
        source = iter(stream)
        samples: Iterator[Any] = source if transform is None else map(transform, source)
        # A generator that another thread runs cannot be closed.
        close = None if isinstance(source, GeneratorType) else getattr(source, "close", None)
        self._queue: _Queue[Any] = _Queue(samples, 8, close)

    def batch(self, count: int) -> list[_T]:
        """Draws samples at random: without repetition, unless the buffer has fewer.

        Raises:
            ValueError: If the count is below 1, or the buffer is closed or the stream has no sample.
        """
        count = whole(count, "count", 1)
        with self._lock:
            if self._is_closed:
                raise ValueError("the buffer is closed")
            self._admit(count)
            if not self._held:
                raise ValueError("the stream has no sample")
            if count <= len(self._held):
                return self._draw.sample(self._held, count)
            return self._draw.choices(self._held, k=count)

    def _admit(self, count: int) -> None:
        """Takes new samples before a draw."""
        while self._taken < self._start and self._take():
            pass
        if self._reuse is None:
            while self._queue.ready() and self._take():
                pass
            return
        self._credit += count / self._reuse
        while self._credit >= 1:
            self._credit -= 1
            self._take()

    def _take(self) -> bool:
        try:
            sample = next(self._queue)
        except StopIteration:
            return False
        if len(self._held) < self._size:
            self._held.append(sample)
        else:
            self._held[self._taken % self._size] = sample
        self._taken += 1
        return True

    @property
    def taken(self) -> int:
        """Number of samples that the buffer has taken from the stream."""
        return self._taken

    def __len__(self) -> int:
        return len(self._held)

    def close(self) -> None:
        """Ends the thread, and forgets the samples."""
        self._is_closed = True
        self._queue.close()
        with self._lock:
            self._held.clear()

    def __enter__(self) -> Buffer[_T]:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Buffer({len(self._held)} of {self._size} samples, {self._taken} taken)"

    def __reduce__(self) -> Any:
        raise TypeError("a buffer cannot be pickled: pass its stream, and make a buffer there")
