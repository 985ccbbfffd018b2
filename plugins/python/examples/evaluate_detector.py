"""A detector's scores: objects that stand out of the table in a depth image, compared with the labels.

    python evaluate_detector.py

The detector fits the plane of the table, and joins neighboring pixels above it whose depths differ little. It needs no
training, so it is a baseline for a net. `look_at_failures.py` examines its predictions.
"""

import argparse
import json
from pathlib import Path

import numpy as np

import syntable as st


def points_of(depth: np.ndarray, K: np.ndarray) -> np.ndarray:
    "Points of a depth image in the camera's frame, height × width × 3, m."
    height, width = depth.shape
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)  # pixel centers
    return np.stack([(x - K[0, 2]) / K[0, 0] * depth, (y - K[1, 2]) / K[1, 1] * depth, depth], axis=-1)


def table_plane(points: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, float]:
    "Normal towards the camera, and offset, of the plane with most points within 5 mm (RANSAC)."
    best, most = (np.array([0.0, 0.0, -1.0]), 0.0), 0
    for _ in range(200):
        a, b, c = points[rng.choice(len(points), 3, replace=False)]
        normal = np.cross(b - a, c - a)
        if (length := np.linalg.norm(normal)) < 1e-9:
            continue
        normal *= -np.sign(normal @ a) / length
        inside = (np.abs((points - a) @ normal) < 0.005).sum()
        if inside > most:
            best, most = (normal, float(a @ normal)), inside
    return best


def is_smooth(depth: np.ndarray, step: float) -> np.ndarray:
    "Whether each pixel and its right neighbor show one surface: their depths fit the slope on the left or the right."
    slope = np.diff(1 / depth, axis=1)  # constant on a plane
    bend = np.abs(np.diff(slope, axis=1))
    least = np.minimum(np.pad(bend, [(0, 0), (1, 0)]), np.pad(bend, [(0, 0), (0, 1)]))
    return least * np.minimum(depth[:, 1:], depth[:, :-1]) ** 2 < step


def components(inside: np.ndarray, depth: np.ndarray, step: float) -> np.ndarray:
    "Number of the component of each pixel, from 1; 0 outside. A component is one smooth surface."
    label = np.where(inside, np.arange(1, inside.size + 1).reshape(inside.shape), 0)
    across = inside[:, 1:] & inside[:, :-1] & is_smooth(depth, step)
    down = inside[1:] & inside[:-1] & is_smooth(depth.T, step).T
    while True:
        before = label.copy()
        for joined, one, other in [(across, label[:, 1:], label[:, :-1]), (down, label[1:], label[:-1])]:
            np.minimum(one, other, out=one, where=joined)
            np.minimum(one, other, out=other, where=joined)
        label[inside] = label.ravel()[label[inside] - 1]  # jumps to the label of the label
        if np.array_equal(label, before):
            return label


def detect(sample: st.Sample, *, height: float = 0.006, step: float = 0.002, pixels: int = 12) -> dict:
    "Predicted visible masks with scores, from depth and camera alone."
    depth = sample.depth.astype(float)
    points = points_of(depth, sample.camera.K)
    near = points[depth < np.median(depth)]
    normal, offset = table_plane(near, np.random.default_rng(0))
    above = points @ normal - offset
    far = np.quantile(depth[np.abs(above) < 0.005], 0.99)
    label = components((above > height) & (above < 0.4) & (depth < far), depth, step)
    ids, areas = np.unique(label[label > 0], return_counts=True)
    ids, areas = ids[areas >= pixels], areas[areas >= pixels]
    # Larger components have higher scores. `evaluate` counts predictions with a score of at least 0.5.
    return {"masks": label == ids[:, None, None], "scores": 1 - 0.5 * np.minimum(pixels / areas, 1)}


def main(out: Path, scenes: int, size: list[int]) -> None:
    recipe = st.recipe("quickstart").set("dataset.scenes", scenes).set("camera.resolution", size)
    recipe = recipe.set("place[2].count", 12).set("dataset.seed", 100)
    dataset = st.run(recipe, out / "data").open()

    # Predictions are a dict of arrays for each image: `masks`, and optionally `scores`, `amodal_masks` and more.
    predictions = [detect(sample) for sample in dataset]
    scores = st.evaluate(dataset, predictions, save=out / "scores.json", overwrite=True)
    print(scores)
    print(f"visible F {scores.visible_f:.1f}, visible AP {scores.visible_ap:.1f}, {scores.predictions} predictions")

    # The same through a file, as other programs write it: a list of COCO's results.
    results = [
        {"image_id": sample.name, "score": float(score), "segmentation": st.Mask(mask).rle()}
        for sample, of in zip(dataset, predictions)
        for mask, score in zip(of["masks"], of["scores"])
    ]
    (out / "predictions.json").write_text(json.dumps(results))
    again = st.evaluate(dataset, out / "predictions.json")
    print(f"the same from {out / 'predictions.json'}: {again.scores == scores.scores}")

    # Pages with the worst images, their labels and predictions.
    st.report(dataset, out / "report", scores=out / "scores.json", overwrite=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("detector"), help="folder for all files (%(default)s)")
    parser.add_argument("--scenes", type=int, default=4, help="number of scenes (%(default)s)")
    parser.add_argument("--size", type=int, nargs=2, default=[320, 240], metavar="PX", help="width, height (320 240)")
    main(**vars(parser.parse_args()))
