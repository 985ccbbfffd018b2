"""Failures of a detector: the worst images, the objects that it misses, and the property that explains them best.

    python evaluate_detector.py
    python look_at_failures.py

Takes any dataset with predictions in a list of COCO's results, as `evaluate_detector.py` writes it:

    python look_at_failures.py --data detector/data --predictions detector/predictions.json --out failures
"""

import argparse
import json
from pathlib import Path

import numpy as np

import syntable as st
from syntable.drawing import png

GREEN, RED, BLUE = (60, 220, 90), (255, 50, 50), (70, 130, 255)


def overlaps(labels: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    "IoU of each label with each prediction."
    common = np.einsum("ahw,bhw->ab", labels.astype(float), predicted.astype(float))
    either = labels.sum(axis=(1, 2))[:, None] + predicted.sum(axis=(1, 2))[None] - common
    return common / np.maximum(either, 1)


def properties(sample: st.Sample) -> dict[str, np.ndarray]:
    "What may explain a failure: a number for each object."
    masks = sample.visible_masks
    areas = masks.sum(axis=(1, 2))
    # Pixels of other objects beside each object.
    grown = np.pad(masks, [(0, 0), (1, 1), (1, 1)])
    grown = grown[:, :-2, 1:-1] | grown[:, 2:, 1:-1] | grown[:, 1:-1, :-2] | grown[:, 1:-1, 2:]
    touching = np.einsum("ahw,bhw->ab", grown.astype(float), masks.astype(float)) > 0
    with np.errstate(invalid="ignore"):
        return {
            "occlusion rate": sample.occlusion_rates,
            "visible area, px": areas,
            "distance, m": np.einsum("ahw,hw->a", masks, sample.depth) / areas,
            "touching objects": touching.sum(axis=1) - touching.diagonal(),
            "pixels at the border": areas - masks[:, 1:-1, 1:-1].sum(axis=(1, 2)),
        }


def explained(values: np.ndarray, missed: np.ndarray) -> float:
    "AUC: probability that a missed object has a greater value than a found one. 0.5 explains nothing."
    bad, good = values[missed][:, None], values[~missed][None]
    return float(((bad > good) + 0.5 * (bad == good)).mean()) if bad.size and good.size else 0.5


def overlay(sample: st.Sample, predicted: np.ndarray, missed: np.ndarray) -> np.ndarray:
    "The image; its labels, found ones green and missed ones red; the predictions in blue."
    parts = [sample.rgb]
    for masks, colors in [
        (sample.visible_masks, [RED if one else GREEN for one in missed]),
        (predicted, [BLUE] * len(predicted)),
    ]:
        drawn = sample.rgb * 0.5
        for mask, color in zip(masks, colors):
            inside = np.pad(mask, 1)
            inside = inside[:-2, 1:-1] & inside[2:, 1:-1] & inside[1:-1, :-2] & inside[1:-1, 2:]
            drawn[mask] = 0.7 * drawn[mask] + 0.3 * np.array(color)
            drawn[mask & ~inside] = color
        parts.append(drawn.astype(np.uint8))
    return np.concatenate(parts, axis=1)


def main(data: Path, predictions: Path, out: Path, worst: int, iou: float) -> None:
    dataset = st.open(data)
    masks: dict[str, list[np.ndarray]] = {sample.name: [] for sample in dataset}
    for one in json.loads(predictions.read_text()):
        masks[one["image_id"]].append(st.Mask.from_rle(one["segmentation"]).array())

    # Which images are the worst?
    scores = [of["visible_overlap_f"] or 0.0 for of in st.evaluate(dataset, predictions).by_image.values()]
    order = sorted(range(len(dataset)), key=lambda place: scores[place])[:worst]

    # Which objects are missed, and what have they in common?
    missed, values, sheets = [], [], {}
    for place, sample in enumerate(dataset):
        predicted = np.array(masks[sample.name], dtype=bool).reshape(-1, *sample.shape)
        best = overlaps(sample.visible_masks, predicted).max(axis=1, initial=0)
        seen = sample.visible_masks.any(axis=(1, 2))
        missed.append((best < iou)[seen])
        values.append({name: one[seen] for name, one in properties(sample).items()})
        if place in order:
            sheets[place] = overlay(sample, predicted, best < iou)

    print(f"worst of {len(dataset)} images, by the F of visible masks:")
    for place in order:
        print(f"    {dataset[place].name}: {scores[place]:.1f}, {missed[place].sum()} objects missed")
    out.mkdir(parents=True, exist_ok=True)
    (out / "worst.png").write_bytes(png(np.concatenate([sheets[place] for place in order])))

    all_missed = np.concatenate(missed)
    print(f"{all_missed.sum()} of {len(all_missed)} visible objects missed: no prediction with an IoU of {iou}")
    table = {name: np.concatenate([one[name] for one in values]) for name in values[0]}
    power = {name: explained(one, all_missed) for name, one in table.items()}
    print(f"{'found, by thirds of a property':32}{'low':>6}{'middle':>8}{'high':>6}{'AUC':>7}")
    for name, one in sorted(table.items(), key=lambda item: -abs(power[item[0]] - 0.5)):
        thirds = np.array_split(np.argsort(one, kind="stable"), 3)
        low, middle, high = (f"{1 - all_missed[third].mean():.0%}" for third in thirds)
        print(f"{name:32}{low:>6}{middle:>8}{high:>6}{power[name]:7.2f}")
    strongest = max(power, key=lambda name: abs(power[name] - 0.5))
    print(f"explains most misses: {'high' if power[strongest] > 0.5 else 'low'} {strongest}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=Path("detector/data"), help="labeled dataset (%(default)s)")
    parser.add_argument("--predictions", type=Path, default=Path("detector/predictions.json"), help="(%(default)s)")
    parser.add_argument("--out", type=Path, default=Path("failures"), help="folder for the sheet (%(default)s)")
    parser.add_argument("--worst", type=int, default=3, help="number of images on the sheet (%(default)s)")
    parser.add_argument("--iou", type=float, default=0.5, help="IoU from which an object is found (%(default)s)")
    main(**vars(parser.parse_args()))
