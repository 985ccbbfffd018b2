"""A bounded queue between a thread that makes items and one that takes them."""

from __future__ import annotations

import atexit
import os
import threading
import weakref
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Generic, TypeVar

from ..errors import SyntableError

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
