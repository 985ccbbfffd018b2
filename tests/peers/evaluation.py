#!/usr/bin/env python3
"""Times `syntable eval` and `syntable stats` beside pycocotools and a NumPy restatement of SynTable's evaluation. Not part of CI.

    cargo build --release
    python3 -m venv /tmp/peers && /tmp/peers/bin/pip install numpy scipy pycocotools
    /tmp/peers/bin/python tests/peers/evaluation.py --work /tmp/evaluation

Makes images of overlapping ellipses and polygons: labels as COCO annotations with amodal, visible and occlusion masks,
predictions as a result file. Predictions are labels that were moved and reshaped; some are missing, others are of nothing.
What is in the folder is used again. pycocotools computes AP of the four kinds of masks and boxes; the restatement, with
the reference's full-frame arrays, scores the first images, and its time is extrapolated. Nothing else should run meanwhile.
"""

import argparse
import contextlib
import io
import json
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from pycocotools import mask
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

ROOT = Path(__file__).resolve().parents[2]
WIDTH, HEIGHT = 640, 480
MISSING, SPURIOUS = 0.08, 0.12


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", type=Path, default=ROOT / "target" / "release" / "syntable")
    parser.add_argument("--work", type=Path, help="folder for labels and predictions; a temporary one if left out")
    parser.add_argument("--images", type=int, default=5000)
    parser.add_argument("--objects", type=int, default=15, help="objects of an image")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--subset", type=int, default=25, help="images that the restatement scores")
    parser.add_argument("--only-ours", action="store_true", help="leave the others out")
    parser.add_argument("options", nargs="*", help="further options of `syntable eval`, after `--`")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = (args.work or Path(temporary)) / f"{args.images}x{args.objects}"
        make(folder, args.images, args.objects)
        print(f"{args.images} images of {args.objects} objects, {WIDTH} × {HEIGHT}, {args.threads} threads", flush=True)
        ours(folder, args.binary, args.threads, args.options)
        if not args.only_ours:
            restated(folder, args.subset, args.images)
            # Last, for what its memory says of the processes before it.
            pycocotools(folder)
    return 0


def say(who: str, seconds: float, more: str) -> None:
    print(f"{who:44} {seconds:8.1f} s   {more}", flush=True)


# Images ---------------------------------------------------------------------------------------------------------------


def labels_of(folder: Path) -> Path:
    return folder / "data" / "annotations" / "instances_train.json"


def make(folder: Path, images: int, objects: int) -> None:
    """Labels and predictions, unless they are there."""
    if (folder / "results.json").is_file():
        return
    labels_of(folder).parent.mkdir(parents=True, exist_ok=True)
    (folder / "data" / "images").mkdir(exist_ok=True)
    with multiprocessing.Pool(2) as pool:
        made = pool.starmap(image, [(number, objects) for number in range(images)], chunksize=20)
    annotations = [annotation for of_image, _ in made for annotation in of_image]
    for number, annotation in enumerate(annotations, 1):
        annotation["id"] = number
    data = {
        "info": {"description": "random clutter"},
        "images": [
            {"id": number + 1, "file_name": f"{number:06}_0000.png", "width": WIDTH, "height": HEIGHT}
            for number in range(images)
        ],
        "annotations": annotations,
        "categories": [{"id": 1, "name": "object", "supercategory": ""}],
    }
    labels_of(folder).write_text(json.dumps(data))
    (folder / "results.json").write_text(json.dumps([result for _, results in made for result in results]))


def image(number: int, objects: int) -> tuple[list, list]:
    """Annotations and results of an image."""
    random = np.random.default_rng([7, number])
    shapes = [shape(random) for _ in range(objects)]
    labels = [
        {"image_id": number + 1, "category_id": 1, "iscrowd": 0, "instance_id": place + 1, **of_label(amodal, visible)}
        for place, (amodal, visible) in enumerate(stacked(shapes))
        if visible.any()
    ]
    found = [moved(random, it) for it in shapes if random.random() > MISSING]
    found += [shape(random) for _ in range(random.binomial(objects, SPURIOUS))]
    results = [
        {
            "image_id": number + 1,
            "category_id": 1,
            "score": round(float(random.beta(4, 1.5)), 3),
            "segmentation": encode(visible),
            "amodal_segmentation": encode(amodal),
        }
        for amodal, visible in stacked(found)
        if visible.any()
    ]
    return labels, results


def shape(random: np.random.Generator) -> dict:
    """Center, size, turn and corners of a shape; an ellipse has none."""
    corners = random.uniform(0.55, 1.0, random.integers(5, 11)) if random.random() < 0.5 else np.empty(0)
    size = random.uniform(18, 75)
    return {
        "at": [random.uniform(0.15, 0.85) * WIDTH, random.uniform(0.15, 0.85) * HEIGHT],
        "axes": [size, size * random.uniform(0.4, 1.0)],
        "turn": random.uniform(0, 2 * np.pi),
        "corners": corners,
    }


def moved(random: np.random.Generator, it: dict) -> dict:
    """A shape about as the given one."""
    return {
        "at": [x + random.normal(0, 2.5) for x in it["at"]],
        "axes": [x * random.normal(1, 0.06) for x in it["axes"]],
        "turn": it["turn"] + random.normal(0, 0.05),
        "corners": it["corners"] * random.normal(1, 0.04, len(it["corners"])),
    }


def pixels(it: dict) -> np.ndarray:
    """The pixels of a shape, with a rough edge."""
    out = np.zeros((HEIGHT, WIDTH), bool, order="F")
    reach = max(it["axes"]) + 2
    x0, x1 = (int(np.clip(it["at"][0] + side * reach, 0, WIDTH)) for side in (-1, 1))
    y0, y1 = (int(np.clip(it["at"][1] + side * reach, 0, HEIGHT)) for side in (-1, 1))
    y, x = np.mgrid[y0:y1, x0:x1]
    dx, dy = x - it["at"][0], y - it["at"][1]
    u = (dx * np.cos(it["turn"]) + dy * np.sin(it["turn"])) / it["axes"][0]
    v = (dy * np.cos(it["turn"]) - dx * np.sin(it["turn"])) / it["axes"][1]
    angle = np.arctan2(v, u)
    edge = 1 + 0.02 * np.sin(23 * angle)
    if len(it["corners"]):
        around = np.linspace(-np.pi, np.pi, len(it["corners"]) + 1)
        edge *= np.interp(angle, around, np.append(it["corners"], it["corners"][0]))
    out[y0:y1, x0:x1] = u * u + v * v <= edge * edge
    return out


def stacked(shapes: list[dict]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Amodal and visible masks; later shapes are in front."""
    hidden, out = np.zeros((HEIGHT, WIDTH), bool, order="F"), []
    for it in reversed(shapes):
        amodal = pixels(it)
        out.append((amodal, amodal & ~hidden))
        hidden |= amodal
    return out[::-1]


def encode(pixels: np.ndarray) -> dict:
    rle = mask.encode(np.asfortranarray(pixels.view(np.uint8)))
    return {"size": [HEIGHT, WIDTH], "counts": rle["counts"].decode()}


def of_label(amodal: np.ndarray, visible: np.ndarray) -> dict:
    full, shown = encode(amodal), encode(visible)
    boxes = [[int(x) for x in mask.toBbox(it)] for it in (full, shown)]
    hidden = amodal & ~visible
    return {
        "segmentation": full,
        "area": int(amodal.sum()),
        "bbox": boxes[0],
        "visible_mask": shown,
        "visible_bbox": boxes[1],
        "amodal_mask": full,
        "amodal_bbox": boxes[0],
        "occluded_mask": encode(hidden),
        "occluded_rate": float(hidden.sum() / amodal.sum()),
    }


# The programs ---------------------------------------------------------------------------------------------------------


def ours(folder: Path, binary: Path, threads: int, options: list[str]) -> None:
    data, threads = folder / "data", ["--threads", str(threads)]
    print(timed("syntable eval", [binary, "eval", "--gt", data, "--pred", folder / "results.json", *threads, *options]))
    print(timed("syntable stats", [binary, "stats", data, "--labels-only", *threads]), flush=True)


def timed(what: str, command: list) -> str:
    """Says time and memory of a command, and gives what it prints."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert process.stdout is not None
    said = process.stdout.read()
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, said
    say(what, time.perf_counter() - start, f"{used.ru_maxrss / 1024:.0f} MiB")
    return said


def pycocotools(folder: Path) -> None:
    for kind, key in (("amodal", "amodal_segmentation"), ("visible", "segmentation")):
        start = time.perf_counter()
        with contextlib.redirect_stdout(io.StringIO()):
            truth = COCO(str(labels_of(folder)))
            if kind == "visible":
                for annotation in truth.anns.values():
                    annotation["segmentation"] = annotation["visible_mask"]
                    annotation["area"] = float(mask.area(annotation["segmentation"]))
                    annotation["bbox"] = annotation["visible_bbox"]
            results = json.loads((folder / "results.json").read_text())
            keys = ("image_id", "category_id", "score")
            found = truth.loadRes([{**{key: it[key] for key in keys}, "segmentation": it[key]} for it in results])
        read = time.perf_counter() - start
        for what in ("segm", "bbox"):
            start = time.perf_counter()
            with contextlib.redirect_stdout(io.StringIO()):
                evaluation = COCOeval(truth, found, what)
                evaluation.params.useCats = 0
                evaluation.evaluate()
                evaluation.accumulate()
                evaluation.summarize()
            seconds = time.perf_counter() - start
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            more = f"AP {100 * evaluation.stats[0]:.9f}, reading {read:.1f} s, {peak:.0f} MiB"
            say(f"pycocotools, AP of {kind} {what}", seconds, more)


def restated(folder: Path, subset: int, images: int) -> None:
    """Overlap, boundary, F@.75 of amodal, visible and invisible masks, as the reference computes them."""
    labels, results = json.loads(labels_of(folder).read_text()), json.loads((folder / "results.json").read_text())
    grouped: tuple[dict, dict] = ({}, {})
    for number in range(1, subset + 1):
        grouped[0][number], grouped[1][number] = [], []
    for side, records in enumerate((labels["annotations"], results)):
        for it in records:
            if it["image_id"] <= subset and it.get("score", 1) >= 0.5:
                grouped[side][it["image_id"]].append(it)
    start, rows = time.perf_counter(), []
    for number in range(1, subset + 1):
        found = sorted(grouped[1][number], key=lambda it: -it["score"])
        rows.append(scores(grouped[0][number], found))
    seconds = (time.perf_counter() - start) / subset * images
    means = 100 * np.mean(rows, axis=0)
    say("restatement in NumPy, extrapolated", seconds, f"from {subset} images; there " + " ".join(f"{x:.1f}" for x in means))


def decode(rle: dict) -> np.ndarray:
    return mask.decode(rle).astype(bool)


def scores(labels: list[dict], found: list[dict]) -> list[float]:
    truth = [[decode(it[key]) for it in labels] for key in ("segmentation", "visible_mask", "occluded_mask")]
    made = [[decode(it[key]) for it in found] for key in ("amodal_segmentation", "segmentation")]
    made.append([a ^ v for a, v in zip(*made)])
    amodal, pairs = prf(truth[0], made[0], None)
    visible, _ = prf(painted(truth[1]), painted(made[1]), None)
    occluded = [o.any() for o in truth[2]], [o.sum() >= 0.05 * a.sum() and o.any() for a, o in zip(made[0], made[2])]
    kept = [np.flatnonzero(it) for it in occluded]
    both = [(i, j) for i, j in pairs if occluded[0][i] and occluded[1][j]]
    both = [(int(np.searchsorted(kept[0], i)), int(np.searchsorted(kept[1], j))) for i, j in both]
    invisible, _ = prf([truth[2][i] for i in kept[0]], [made[2][j] for j in kept[1]], both)
    return amodal + visible + invisible


def painted(masks: list[np.ndarray]) -> list[np.ndarray]:
    of = np.zeros((HEIGHT, WIDTH), int)
    for number, it in enumerate(masks, 1):
        of[it] = number
    return [of == number for number in np.unique(of) if number]


def prf(truth: list[np.ndarray], found: list[np.ndarray], pairs: list | None) -> tuple[list[float], list]:
    from scipy.optimize import linear_sum_assignment

    if not truth or not found:
        p, r = float(not found), float(not truth)
        f = float(not truth and not found)
        return [p, r, f, p, r, f, f], []
    f = np.array([[2 * (g & c).sum() / (g.sum() + c.sum()) for c in found] for g in truth])
    if pairs is None:
        pairs = list(zip(*linear_sum_assignment(f.max() - f)))
    both = sum((truth[i] & found[j]).sum() for i, j in pairs)
    overlap = harmonic(both / sum(c.sum() for c in found), both / sum(g.sum() for g in truth))
    lines = [boundary(g) for g in truth], [boundary(c) for c in found]
    p = sum((lines[1][j] & dilated(lines[0][i])).sum() for i, j in pairs) / sum(it.sum() for it in lines[1])
    r = sum((lines[0][i] & dilated(lines[1][j])).sum() for i, j in pairs) / sum(it.sum() for it in lines[0])
    return [*overlap, *harmonic(p, r), sum(f[i, j] > 0.75 for i, j in pairs) / len(truth)], pairs


def harmonic(p: float, r: float) -> list[float]:
    return [p, r, 2 * p * r / (p + r) if p + r > 0 else 0.0]


def boundary(it: np.ndarray) -> np.ndarray:
    out = np.zeros_like(it)
    out[:, :-1] |= it[:, 1:] != it[:, :-1]
    out[:-1] |= it[1:] != it[:-1]
    out[:-1, :-1] |= it[1:, 1:] != it[:-1, :-1]
    return out


def dilated(it: np.ndarray) -> np.ndarray:
    radius = int(np.ceil(0.003 * np.hypot(*it.shape)))
    padded, out = np.pad(it, radius), np.zeros_like(it)
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            if dx * dx + dy * dy <= radius * radius:
                out |= padded[radius + dy : radius + dy + it.shape[0], radius + dx : radius + dx + it.shape[1]]
    return out


if __name__ == "__main__":
    sys.exit(main())
