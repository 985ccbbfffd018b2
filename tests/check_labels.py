"""Checks labels that follow from masks and poses, with pycocotools and NumPy.

    python3 tests/check_labels.py LABELS.jsonl

Outlines must be those of `tolerance_px = 0`: pycocotools fills them to the masks, pixel by pixel. All pixels of a mask lie
in the rotated box, within the projected cuboid, and the graph says what the order matrix says.
"""

import json
import sys

import numpy as np
from pycocotools import mask as coco


def filled(polygons, size):
    if not polygons:
        return np.zeros(size, bool)
    return coco.decode(coco.merge(coco.frPyObjects(polygons, *size))).astype(bool)


def check_outline(mask, outline):
    size = mask.shape
    again = filled(outline["polygons"], size) & ~filled(outline["holes"], size)
    assert (again == mask).all(), f"{(again != mask).sum()} pixels differ"


def check_rotated_box(mask, box):
    rows, columns = np.nonzero(mask)
    corners = np.concatenate([np.stack([columns + dx, rows + dy], 1) for dx in (0, 1) for dy in (0, 1)])
    angle = np.radians(box["angle_deg"])
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    along = (corners - box["center_px"]) @ axes.T
    extent = np.abs(along).max(0) * 2
    assert np.allclose(extent, box["size_px"], atol=1e-6), (extent, box["size_px"])
    area = np.ptp(corners, 0).prod()
    assert np.prod(box["size_px"]) <= area + 1e-6, "larger than the upright box"


def check_cuboid(mask, cuboid):
    corners = np.array(cuboid["corners_px"], float)
    rows, columns = np.nonzero(mask)
    low, high = corners.min(0), corners.max(0)
    assert low[0] <= columns.min() + 0.5 and columns.max() + 0.5 <= high[0], "wider than the cuboid"
    assert low[1] <= rows.min() + 0.5 and rows.max() + 0.5 <= high[1], "higher than the cuboid"
    pose = np.array(cuboid["camera_from_cuboid"])
    signs = np.array([[(i >> k & 1) - 0.5 for k in range(3)] for i in range(8)])
    again = (signs * cuboid["size_m"]) @ pose[:3, :3].T + pose[:3, 3]
    assert np.allclose(again, cuboid["corners_camera_m"], atol=1e-9)


def check_graph(order, ids, graph, layers):
    order = np.array(order, bool)
    edges = [[ids[i], ids[j]] for i, j in np.argwhere(order)]
    assert graph["edges"] == edges, (graph["edges"], edges)
    for number, instance in enumerate(ids):
        occluded, occludes = order[:, number].any(), order[number].any()
        layer = "top" if not occluded else "intermediate" if occludes else "bottom"
        assert layers[str(instance)] == layer, (instance, layer)
    depth = {instance: number for number, layer in enumerate(graph["depth_layers"]) for instance in layer}
    together = [set(cycle) for cycle in graph["cycles"]]
    for i, j in edges:
        assert depth[i] < depth[j] or any({i, j} <= cycle for cycle in together), (i, j)


def main(path):
    objects = 0
    with open(path, encoding="utf-8") as lines:
        for row in map(json.loads, lines):
            for kind in ("visible", "amodal"):
                for instance, runs in row[f"{kind}_mask"].items():
                    runs = dict(runs, counts=runs["counts"].encode()) if isinstance(runs["counts"], str) else coco.frPyObjects(runs, *runs["size"])
                    mask = coco.decode(runs).astype(bool)
                    check_outline(mask, row[f"{kind}_outline"][instance])
                    check_rotated_box(mask, row[f"{kind}_rotated_box"][instance])
                    check_cuboid(mask, row["cuboid"][instance])
                    objects += 1
            ids = sorted(int(instance) for instance in row["amodal_mask"])
            check_graph(row["occlusion_order"], ids, row["occlusion_graph"], row["occlusion_layer"])
    print(f"{objects} masks")


if __name__ == "__main__":
    main(sys.argv[1])
