"""A pool of the latest samples."""

from __future__ import annotations

import random
import threading
from collections.abc import Callable, Iterable, Iterator
from types import GeneratorType, TracebackType
from typing import Any, Generic

from .._arguments import whole
from ._queue import _T, _Queue


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
