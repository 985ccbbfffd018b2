#!/usr/bin/env python3
"""Reads the clouds of the ply writer by their headers and projects the points back to the pixels that they are from.

    python3 check_ply.py DATASET

The dataset has the clouds `world` (all properties), `camera` (without colors) and `bare`, the arrays `npy` and the cameras in
`all.jsonl`, of the same views.
"""

import json
import pathlib
import sys

import numpy as np

TYPES = {"float": "<f4", "uchar": "u1", "ushort": "<u2"}


def read(path):
    """The points of a binary PLY file, and its comments."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    lines = data[:end].decode("ascii").splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"], lines
    words = [line.split() for line in lines[2:-1]]
    comments = " ".join(" ".join(w[1:]) for w in words if w[0] == "comment")
    ((_, element, count),) = [w for w in words if w[0] == "element"]
    assert element == "vertex"
    dtype = np.dtype([(w[2], TYPES[w[1]]) for w in words if w[0] == "property"])
    assert len(data) == end + int(count) * dtype.itemsize, path
    return np.frombuffer(data, dtype, offset=end), comments


def main():
    root = pathlib.Path(sys.argv[1])
    total = 0
    for line in (root / "all.jsonl").read_text().splitlines():
        record = json.loads(line)
        name = f"{record['scene']:06}_{record['view']:04}"
        K = np.array(record["camera"]["K"])
        camera_from_world = np.array(record["camera"]["camera_from_world"])
        depth, rgb, ids = (np.load(root / "npy" / p / f"{name}.npy") for p in ("depth", "rgb", "instance"))
        v, u = np.nonzero(np.isfinite(depth))
        assert len(u) < depth.size
        for cloud, properties in (("world", "x y z red green blue instance"), ("camera", "x y z instance"), ("bare", "x y z")):
            points, comments = read(root / cloud / f"{name}.ply")
            assert " ".join(points.dtype.names) == properties, points.dtype.names
            assert ("z up" in comments) == (cloud == "world"), comments
            p = np.stack([points[axis] for axis in "xyz"]).astype(float)
            if cloud == "world":
                p = camera_from_world[:3, :3] @ p + camera_from_world[:3, 3:]
            assert len(points) == len(u), f"{name}: {len(points)} points"
            assert np.allclose(p[2], depth[v, u], rtol=1e-5, atol=1e-6), f"{name} {cloud}: depth"
            pixels = (K @ p / p[2])[:2]
            assert np.allclose(pixels, [u + 0.5, v + 0.5], atol=1e-3), f"{name} {cloud}: pixels"
            if "instance" in properties:
                assert (points["instance"] == ids[v, u]).all(), f"{name} {cloud}: ids"
            if "red" in properties:
                got = np.stack([points[c] for c in ("red", "green", "blue")], -1)
                assert (got == rgb[v, u]).all(), f"{name} {cloud}: colors"
            total += len(points)
    assert total > 50000, total
    print(f"{total} points")


if __name__ == "__main__":
    main()
