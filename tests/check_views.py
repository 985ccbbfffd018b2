#!/usr/bin/env python3
"""Flow, soft masks and support of a small dataset, made again from depth, cameras and a finer image.

    python3 check_views.py FOLDER FINE

FOLDER has `arrays/{scene}_{view}.npz`, `views.jsonl` with cameras, and FINE the arrays of the same scenes with four times as
many pixels along either edge.
"""

import json
import pathlib
import sys

import numpy as np

SUBPIXELS = 4
TOLERANCE_M = 0.002


def arrays(folder):
    files = sorted((folder / "arrays").glob("[0-9]*_[0-9]*.npz"))
    return [dict(np.load(file)) for file in files]


def rays(camera):
    """Directions of pixel centers in the camera frame, z = 1."""
    k = np.array(camera["K"])
    v, u = np.mgrid[0:camera["height"], 0:camera["width"]] + 0.5
    return np.stack([(u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1], np.ones_like(u)], axis=-1)


def expected_flow(this, depth, camera, following):
    depth = np.where(np.isfinite(depth), depth, 0).astype(float)
    point = rays(camera) * depth[..., None]
    world = np.array(camera["world_from_camera"])
    there = np.linalg.inv(np.array(following["world_from_camera"]))
    move = there @ world
    point = point @ move[:3, :3].T + move[:3, 3]
    is_seen = (depth > 0) & (point[..., 2] > 0)
    k = np.array(following["K"])
    with np.errstate(divide="ignore", invalid="ignore"):
        u = k[0, 0] * point[..., 0] / point[..., 2] + k[0, 2]
        v = k[1, 1] * point[..., 1] / point[..., 2] + k[1, 2]
    return np.stack([u, v], axis=-1), point[..., 2], is_seen


def inner(ids):
    """Pixels whose neighbors show the same body."""
    same = np.ones_like(ids, dtype=bool)
    for dy, dx in [(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]:
        same &= np.roll(ids, (dy, dx), axis=(0, 1)) == ids
    return same


def surrounding(depth, to):
    """Depths of the four pixels whose centers surround each point."""
    low = np.floor(np.nan_to_num(to, posinf=0, neginf=0) - 0.5)
    around = []
    for dy, dx in (0, 0), (0, 1), (1, 0), (1, 1):
        x, y = low[..., 0] + dx, low[..., 1] + dy
        x, y = (np.clip(i, 0, size - 1).astype(int) for i, size in ((x, depth.shape[1]), (y, depth.shape[0])))
        around.append(depth[y, x])
    return np.stack(around, axis=-1)


def check_flow(records, views):
    checked = seen_pixels = hidden = 0
    for (record, this), (after, that) in zip(zip(records, views), [*zip(records, views)][1:] + [(None, None)]):
        if after is None or after["scene"] != record["scene"]:
            assert not this["flow"].any() and not this["flow_visibility"].any(), "the last view has no flow"
            continue
        to, depth, has_flow = expected_flow(this, this["depth"], record["camera"], after["camera"])
        height, width = this["depth"].shape
        v, u = np.mgrid[0:height, 0:width] + 0.5
        assert np.allclose(this["flow"][has_flow], (to - np.stack([u, v], axis=-1))[has_flow], rtol=1e-4, atol=1e-3)
        assert not this["flow"][~has_flow].any()
        inside = has_flow & (to >= 0).all(-1) & (to[..., 0] < width) & (to[..., 1] < height)
        visibility = this["flow_visibility"]
        hides = surrounding(that["depth"], to).max(axis=-1) < depth - TOLERANCE_M
        assert (visibility == np.where(inside, np.where(hides, 1, 2), 0)).mean() > 0.9999
        x, y = (np.clip(np.floor(to[..., i]).astype(int), 0, size - 1) for i, size in ((0, width), (1, height)))
        seen = visibility == 2
        # What is seen there is the same body, but for pixels at its edge.
        seen &= inner(that["instance"])[y, x]
        same = this["instance"][seen] == that["instance"][y[seen], x[seen]]
        assert same.mean() > 0.998, f"{same.mean()} of the points that are seen are of the same body"
        seen_pixels += seen.sum()
        hidden += (visibility == 1).sum()
        checked += 1
    assert checked and seen_pixels > 1000 and hidden > 50, (checked, seen_pixels, hidden)


def check_soft_masks(views, fine):
    objects = 0
    for view, sharp in zip(views, fine):
        height, width = view["instance"].shape
        assert sharp["instance"].shape == (SUBPIXELS * height, SUBPIXELS * width)
        squares = sharp["instance"].reshape(height, SUBPIXELS, width, SUBPIXELS)
        for i, visible, amodal in zip(view["ids"], view["visible_soft_mask"], view["amodal_soft_mask"]):
            share = (squares == i).mean(axis=(1, 3))
            assert (np.abs(visible - share) > 1e-6).mean() < 1e-4, f"object {i}"
            assert (visible <= amodal).all() and amodal.max() <= 1
            objects += 1
    assert objects > 10, objects


def check_support(records):
    for scene in {record["scene"]: record for record in records}.values():
        graph, order = scene["support_graph"], scene["removal_order"]
        edges = [(e["supporter"], e["supported"]) for e in graph["edges"]]
        reached = set(graph["roots"])
        while new := {b for a, b in edges if a in reached} - reached:
            reached |= new
        assert set(order["order"]) <= reached, "all that can be removed rests on the table or the floor"
        assert not graph["floating"], graph["floating"]
        forced = {f["id"] for f in order["forced"]}
        place = {i: n for n, i in enumerate(order["order"])}
        for a, b in edges:
            assert a not in place or b not in place or place[b] < place[a] or a in forced, (a, b)


def main():
    folder, fine = map(pathlib.Path, sys.argv[1:3])
    records = [json.loads(line) for line in (folder / "views.jsonl").read_text().splitlines()]
    records.sort(key=lambda record: (record["scene"], record["view"]))
    views = arrays(folder)
    check_flow(records, views)
    check_soft_masks(views, arrays(fine))
    check_support(records)
    print(f"{len(views)} views")


if __name__ == "__main__":
    main()
