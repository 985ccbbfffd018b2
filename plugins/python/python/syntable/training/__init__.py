"""Data for training: views by number, streams that resume, a buffer that grows while a net trains on it."""

from ._buffer import Buffer
from ._stream import Stream, StreamLoop
from ._views import Views

__all__ = ["Buffer", "Stream", "StreamLoop", "Views"]
