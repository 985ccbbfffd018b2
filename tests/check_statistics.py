#!/usr/bin/env python3
"""Counts a dataset of SynTable's layout with NumPy and compares with what `syntable stats --json` printed.

    python3 tests/check_statistics.py DATASET STATISTICS.json

Reads the annotation file with `json`, masks with pycocotools, images with Pillow. Of several datasets in the file, the first
one is that of the folder; distances to the others follow from their histograms alone, as far as bins are whole numbers.
"""

import json
import math
import sys
from pathlib import Path

import numpy as np
from PIL import Image
from pycocotools import mask as coco_mask


def main() -> int:
    root, printed = Path(sys.argv[1]), json.loads(Path(sys.argv[2]).read_text())
    found = printed["datasets"][0]
    data = json.loads((root / "annotation_final.json").read_text())
    images = {image["id"]: image for image in data["images"]}
    objects = {number: [] for number in images}
    for annotation in data["annotations"]:
        objects[annotation["image_id"]].append(annotation)
    values = {name: [] for name in ("occlusion_rate", "objects_per_view", "component_size", "components_per_view",
                                    "object_area", "object_size", "object_distance", "brightness", "depth")}
    layers, edges, cyclic, hidden_px, amodal_px, occluded = [0, 0, 0], 0, 0, 0, 0, 0
    cells = []
    for number, image in images.items():
        masks = [tuple(decoded(it[key]) for key in ("visible_mask", "segmentation")) for it in objects[number]]
        values["objects_per_view"].append(len(masks))
        for it, (visible, amodal) in zip(objects[number], masks):
            hidden = int((amodal & ~visible).sum())
            values["occlusion_rate"].append(hidden / amodal.sum())
            values["object_area"].append(amodal.sum())
            hidden_px, amodal_px, occluded = hidden_px + hidden, amodal_px + int(amodal.sum()), occluded + (hidden > 0)
            low, high = np.array(it["object"]["bounds_m"])
            pose = np.array(it["object"]["camera_from_object"])
            values["object_size"].append((high - low).max())
            values["object_distance"].append(np.linalg.norm((pose @ [*((low + high) / 2), 1.0])[:3]))
        n = len(masks)
        order = np.array([[i != j and bool((masks[i][0] & masks[j][1] & ~masks[j][0]).any()) for j in range(n)]
                          for i in range(n)]).reshape(n, n)
        edges += int(order.sum())
        # Powers of the matrix reach along paths: of either direction for components, of one for cycles.
        either, one = (power(order | order.T), power(order)) if n else (order, order)
        sizes = sorted(len(group) for group in {tuple(np.flatnonzero(row)) for row in either | np.eye(n, dtype=bool)})
        values["component_size"] += sizes
        values["components_per_view"].append(len(sizes))
        cyclic += bool(np.diag(one).any())
        for it in range(n):
            is_occluded, occludes = order[:, it].any(), order[it].any()
            layers[0 if not is_occluded else 1 if occludes else 2] += 1
        rgb = np.asarray(Image.open(root / image["file_name"]).convert("RGB")).astype(float)
        luma = rgb @ [0.2126, 0.7152, 0.0722]
        values["brightness"].append(luma.mean() / 255)
        rows, columns = (np.arange(edge) * 16 // edge for edge in luma.shape)
        cells.append(np.round([[luma[rows == y][:, columns == x].mean() for x in range(16)] for y in range(16)]))
        depth = np.asarray(Image.open(root / image["depth_file_name"])).astype(float) / 1000
        values["depth"].append(depth[depth > 0])
    values["depth"] = np.concatenate(values["depth"])

    totals = found["totals"]
    same("images", totals["images"], len(images))
    same("#VI", totals["visible_instances"], len(data["annotations"]))
    same("#OI", totals["occluded_instances"], occluded)
    same("pixels", (totals["occluded_px"], totals["amodal_px"]), (hidden_px, amodal_px))
    close("average rate", totals["average_occlusion_rate"], hidden_px / amodal_px)
    close("mean rate", totals["mean_occlusion_rate"], np.mean(values["occlusion_rate"]))
    same("edges", (totals["edges"], totals["cyclic_views"]), (edges, cyclic))
    same("layers", [found["layers"][name] for name in ("top", "intermediate", "bottom")], layers)
    for name, own in values.items():
        of = next(it for it in found["distributions"] if it["name"] == name)
        tolerance = 2e-3 if name == "depth" else 1e-9
        same(f"number of {name}", of["n"], len(own))
        close(f"mean {name}", of["mean"], np.mean(own), tolerance)
        close(f"range of {name}", [of["min"], of["max"]], [np.min(own), np.max(own)], tolerance)
        if name != "depth":
            shifted = np.asarray(own, float) + 1e-9
            last = of["edges"][:-1] + [of["edges"][-1] + 1]
            same(f"histogram of {name}", of["counts"], np.histogram(shifted, last)[0].tolist())
    pairs = [(i, j) for i in range(len(cells)) for j in range(i) if np.abs(cells[i] - cells[j]).max() <= 5]
    same("views with near-duplicates", found["near_duplicates"]["views"], len({it for pair in pairs for it in pair}))
    for other, apart in zip(printed["datasets"][1:], printed["distances"]):
        compare(found, other, apart)
    print(f"{len(images)} images, {len(data['annotations'])} objects")
    return 0


def compare(one: dict, other: dict, apart: dict) -> None:
    """Distances once more from histograms: of whole numbers both, of others the divergence."""
    for it in apart["quantities"]:
        of = [next((q for q in d["distributions"] if q["name"] == it["name"]), None) for d in (one, other)]
        if it["name"] == "layer":
            counts = [np.array(list(d["layers"].values()), float) for d in (one, other)]
        else:
            counts = [np.array(q["counts"], float) for q in of]
        p, q = (c / c.sum() for c in counts)
        entropy = lambda x: -sum(v * math.log2(v) for v in x if v > 0)
        close(f"divergence of {it['name']}", it["jensen_shannon"], entropy((p + q) / 2) - (entropy(p) + entropy(q)) / 2)
        if it["name"] in ("objects_per_view", "component_size", "components_per_view"):
            widths = np.diff(of[0]["edges"])
            same("widths", set(widths), {1.0})
            close(f"distance of {it['name']}", it["wasserstein_1"], np.abs(np.cumsum(p - q)).sum())


def decoded(rle: dict) -> np.ndarray:
    return coco_mask.decode({"size": rle["size"], "counts": rle["counts"].encode()}).astype(bool)


def power(order: np.ndarray) -> np.ndarray:
    """Whether a path of one edge or more leads from a row to a column."""
    path = order.copy()
    for _ in range(len(order)):
        path = path | (path.astype(int) @ order.astype(int) > 0)
    return path


def same(what: str, found: object, wanted: object) -> None:
    assert found == wanted, f"{what}: {found}, NumPy has {wanted}"


def close(what: str, found: object, wanted: object, tolerance: float = 1e-9) -> None:
    assert np.allclose(found, wanted, rtol=0, atol=tolerance), f"{what}: {found}, NumPy has {wanted}"


if __name__ == "__main__":
    sys.exit(main())
