"""An annotator in Python without the package syntable: the share of dark pixels of each object. Needs NumPy."""

import io
import json
import struct
import sys

import numpy as np


def receive():
    """The arrays of the next message; None at the end."""
    start = sys.stdin.buffer.read(8)
    if len(start) < 8:
        return None
    letters, length = struct.unpack("<4sI", start)
    if letters != b"SYN1":
        sys.exit(f"messages of the version {letters!r} are unknown")
    return np.load(io.BytesIO(sys.stdin.buffer.read(length)))


def answer(message, **arrays):
    """Answers a message with arrays, and repeats its number."""
    file = io.BytesIO()
    np.savez(file, syntable_number=message["syntable_number"], **arrays)
    sys.stdout.buffer.write(struct.pack("<4sI", b"SYN1", file.tell()) + file.getvalue())
    sys.stdout.buffer.flush()


start = receive()
options = json.loads(str(start["syntable_options"]))
answer(start)
while (view := receive()) is not None:
    dark = view["rgb"].mean(axis=-1) < 255 * options["threshold"]
    shares = [dark[mask].mean() if mask.any() else 0.0 for mask in view["visible_mask"]]
    answer(view, darkness=np.array(shares, dtype=np.float64))
