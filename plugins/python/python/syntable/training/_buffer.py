"""A pool of the latest samples."""

from __future__ import annotations

import random
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import GeneratorType, TracebackType
from typing import Any, Generic

from .._arguments import whole
from ._queue import _T, _Queue
from ._stream import Stream, StreamLoop


class Buffer(Generic[_T]):
    """A pool of the latest samples, which grows while a net trains on it.

    Making a sample takes longer than a training step on it. A buffer lets each sample be drawn several times, in
    different batches, while a thread makes further ones. Once it is full, a new sample replaces the oldest one.

    With ``reuse``, the buffer takes a new sample for every ``reuse`` samples drawn, and waits for it if necessary: the
    batches depend on the stream and the seed alone. Without it, the buffer takes whatever is made, and never waits:
    batches come as fast as possible, and depend on time.

    The ``state_dict`` of a buffer of a `Stream` continues the batches exactly. It has numbers of views and no samples:
    `load_state_dict` makes the held samples again, which takes the time of ``size`` samples at most. Keep this state
    instead of the stream's, which is ahead of the batches because the thread takes samples ahead.

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
        self._transform = transform
        self._draw = random.Random(whole(seed, "seed", -(2**63)))
        #: Samples, each with its position in the stream; a new one replaces the oldest.
        self._held: list[tuple[int, _T]] = []
        self._taken = 0
        self._credit = 0.0
        self._lock = threading.Lock()
        self._is_closed = False
        self._stream = stream
        self._begin = stream.state_dict()["next"] if isinstance(stream, Stream) else 0
        self._queue = self._fill()

    def _fill(self) -> _Queue[tuple[int, _T]]:
        """Begins to take samples from where the stream stands."""
        source = iter(self._stream)
        # A generator that another thread runs cannot be closed.
        close = None if isinstance(source, GeneratorType) else getattr(source, "close", None)
        return _Queue(_placed(source, self._transform), 8, close)

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
                drawn = self._draw.sample(self._held, count)
            else:
                drawn = self._draw.choices(self._held, k=count)
            return [sample for _, sample in drawn]

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

    def state_dict(self) -> dict[str, Any]:
        """The state after the last batch: the positions of the held samples in the stream, and the state of the draws.
        JSON can hold it.

        Raises:
            TypeError: If the samples come from something else than a `Stream`.
            ValueError: If the buffer is closed.
        """
        self._check_stream()
        with self._lock:
            if self._is_closed:
                raise ValueError("the buffer is closed")
            oldest = self._taken - len(self._held)
            version, numbers, gauss = self._draw.getstate()
            return {
                "size": self._size,
                "begin": self._begin,
                "taken": self._taken,
                "held": [self._held[number % self._size][0] for number in range(oldest, self._taken)],
                "credit": self._credit,
                "draw": [version, list(numbers), gauss],
            }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Continues from a state: makes the held samples again. The next batch is the one after the state.

        The stream has to be of the same recipe, products and shard, and ``transform`` a pure function.

        Raises:
            TypeError: If it is not the state of a buffer, or the samples come from something else than a `Stream`.
            ValueError: If the state is of another size, or the stream lacks one of the samples. The buffer is then
                closed.
        """
        stream = self._check_stream()
        if not isinstance(state, Mapping) or set(state) != _STATE:
            raise TypeError(f"the state of a buffer is what its state_dict() returns, not {state!r}")
        if state["size"] != self._size:
            raise ValueError(f"the state is of a buffer of {state['size']} samples, and this one holds {self._size}")
        places, taken = [whole(place, "held", 0) for place in state["held"]], whole(state["taken"], "taken", 0)
        begin, (version, numbers, gauss) = whole(state["begin"], "begin", 0), state["draw"]
        if len(places) != min(taken, self._size):
            raise TypeError(f"the state of a buffer after {taken} samples does not hold {len(places)} samples")
        with self._lock:
            if self._is_closed:
                raise ValueError("the buffer is closed")
            self._draw.setstate((version, tuple(numbers), gauss))
            self._begin, self._taken, self._credit = begin, taken - len(places), float(state["credit"])
            self._queue.close()
            stream.load_state_dict({"next": places[0] if places else begin})
            self._queue = self._fill()
            self._held = []
            try:
                self._take_again(places)
            except BaseException:
                self._is_closed = True
                self._queue.close()
                self._held.clear()
                raise

    def _take_again(self, places: list[int]) -> None:
        """Takes the samples that the buffer held, oldest first."""
        ring: dict[int, tuple[int, _T]] = {}
        for place in places:
            item = next(self._queue, None)
            if item is None or item[0] != place:
                found = "ends" if item is None else f"has view {item[0]}"
                raise ValueError(f"the stream {found} where it had view {place}: it is not the stream of the state")
            ring[self._taken % self._size] = item
            self._taken += 1
        self._held = [ring[number] for number in range(len(ring))]

    def _check_stream(self) -> Stream:
        if not isinstance(self._stream, Stream):
            kind = type(self._stream).__name__
            raise TypeError(f"only a buffer of a Stream has a state: it cannot take samples of a {kind} again")
        return self._stream

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
        raise TypeError("a buffer cannot be pickled: make one there, and load the state_dict of this one")


#: Keys of a state.
_STATE = {"size", "begin", "taken", "held", "credit", "draw"}


def _placed(source: Iterator[Any], transform: Callable[[Any], _T] | None) -> Iterator[tuple[int, _T]]:
    """Samples with their positions in their stream; 0 if they come from something else."""
    for sample in source:
        place = source.place if isinstance(source, StreamLoop) else 0
        yield place, sample if transform is None else transform(sample)
