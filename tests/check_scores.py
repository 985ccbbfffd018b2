"""Compares scores of random predictions with those of pycocotools, and with panoptic quality computed pixel by pixel.

    check_scores.py make FOLDER            # labels as COCO annotations, and a result file
    check_scores.py compare FOLDER SCORES  # the file that `syntable eval --json` printed
    check_scores.py bop FOLDER SCORES      # that of the same labels in the layout of BOP, which has no crowds

Scores have many ties, images have crowds, too many predictions, none, or no labels, and objects are of all sizes. Image ids
are not in the order of names. Some predictions are of a wrong category, some of one that no label has.
"""

import contextlib
import io
import json
import struct
import sys
import zlib
from pathlib import Path

import numpy as np
from pycocotools import mask
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

WIDTH, HEIGHT = 320, 240
IMAGES = 14
NO_LABELS, NO_RESULTS, MANY = 3, 5, 7
CATEGORIES = {9: "mug", 4: "bowl, deep", 30: "plate", 17: "unseen"}
SCORES = "ap ap50 ap75 aps apm apl ar1 ar10 ar100 ars arm arl".split()
LEAST = 0.5


def labels_of(folder: Path) -> Path:
    return folder / "data" / "annotations" / "instances_train.json"


def encode(pixels: np.ndarray) -> dict:
    rle = mask.encode(np.asfortranarray(pixels.astype(np.uint8)))
    return {"size": [HEIGHT, WIDTH], "counts": rle["counts"].decode()}


def decode(rle: dict) -> np.ndarray:
    return mask.decode(rle).astype(bool)


def uncompressed(pixels: np.ndarray) -> dict:
    flat = np.concatenate([[False], pixels.ravel(order="F")])
    edges = np.flatnonzero(flat[1:] != flat[:-1])
    return {"size": [HEIGHT, WIDTH], "counts": [int(n) for n in np.diff([0, *edges, flat.size - 1])]}


def ellipse(at: list[float], axes: list[float]) -> np.ndarray:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return ((x - at[0]) / axes[0]) ** 2 + ((y - at[1]) / axes[1]) ** 2 <= 1


def shape(random: np.random.Generator) -> tuple[list[float], list[float]]:
    size = random.choice([8, 18, 40, 75])
    return [random.uniform(0, WIDTH), random.uniform(0, HEIGHT)], [size * random.uniform(0.6, 1.2) for _ in range(2)]


def moved(random: np.random.Generator, at: list[float], axes: list[float]) -> tuple[list[float], list[float]]:
    return [x + random.normal(0, 2) for x in at], [max(x * random.normal(1, 0.12), 2) for x in axes]


def stacked(shapes: list) -> list[tuple[np.ndarray, np.ndarray]]:
    """Amodal and visible masks; later shapes are in front."""
    hidden, out = np.zeros((HEIGHT, WIDTH), bool), []
    for at, axes in reversed(shapes):
        amodal = ellipse(at, axes)
        out.append((amodal, amodal & ~hidden))
        hidden |= amodal
    return [it for it in out[::-1] if it[1].any()]


def make(folder: Path) -> None:
    random = np.random.default_rng(3)
    images, annotations, results = [], [], []
    for number in range(IMAGES):
        ident = 100 - 7 * number
        images.append({"id": ident, "file_name": f"{number:02}_0.jpg", "width": WIDTH, "height": HEIGHT})
        shapes = [] if number == NO_LABELS else [shape(random) for _ in range(random.integers(3, 9))]
        for amodal, visible in stacked(shapes):
            full, shown = encode(amodal), encode(visible)
            annotations.append({"segmentation": full, "visible_mask": shown, "image_id": ident, "iscrowd": 0})
        if number % 2:
            crowd = ellipse([WIDTH / 2, HEIGHT / 2], [random.uniform(20, 60), random.uniform(20, 60)])
            annotations.append({"segmentation": uncompressed(crowd), "image_id": ident, "iscrowd": 1})
        found = [moved(random, *it) for it in shapes for _ in range(random.integers(0, 3))]
        found += [shape(random) for _ in range(3)]
        # Small ones, of which more than a hundred are seen.
        found += [([random.uniform(0, WIDTH), random.uniform(0, HEIGHT)], [4, 4]) for _ in range(200 * (number == MANY))]
        for amodal, visible in stacked([] if number == NO_RESULTS else found):
            score = round(float(random.uniform(0.05, 1)), 1)
            results.append(
                {
                    "image_id": ident,
                    "category_id": 1,
                    "score": score,
                    "segmentation": encode(visible),
                    "amodal_segmentation": encode(amodal),
                }
            )
    kinds = np.random.default_rng(4)
    for number, annotation in enumerate(annotations, 1):
        rle = annotation["segmentation"]
        rle = mask.frPyObjects(rle, HEIGHT, WIDTH) if isinstance(rle["counts"], list) else rle
        category = int(kinds.choice([9, 4, 30]))
        annotation |= {"id": number, "category_id": category, "area": int(mask.area(rle)), "bbox": mask.toBbox(rle).tolist()}
    assert max(sum(it["image_id"] == image["id"] for it in results) for image in images) > 130
    for it in results:
        it["category_id"] = int(kinds.choice(list(CATEGORIES), p=[0.7, 0.1, 0.1, 0.1]))
    many = [it["category_id"] for it in results if it["image_id"] == images[MANY]["id"]]
    assert many.count(9) > 110
    random.shuffle(results)
    labels_of(folder).parent.mkdir(parents=True)
    categories = [{"id": ident, "name": name, "supercategory": ""} for ident, name in CATEGORIES.items()]
    data = {"info": {}, "images": images, "annotations": annotations, "categories": categories}
    labels_of(folder).write_text(json.dumps(data))
    (folder / "results.json").write_text(json.dumps(results))
    make_bop(folder, data, results)


def write_png(path: Path, pixels: np.ndarray) -> None:
    """Gray or RGB."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = b"".join(b"\0" + row.tobytes() for row in pixels.astype(np.uint8))

    def chunk(name: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))

    head = struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 8, 2 if pixels.ndim == 3 else 0, 0, 0, 0)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + body)


def make_bop(folder: Path, data: dict, results: list) -> None:
    """The same labels without crowds as scene 1 of a dataset in the layout of BOP; predictions name their images."""
    scene = folder / "bop" / "test" / "000001"
    identity, truth, info, camera, names = [1, 0, 0, 0, 1, 0, 0, 0, 1], {}, {}, {}, {}
    for number, image in enumerate(data["images"]):
        own = [it for it in data["annotations"] if it["image_id"] == image["id"] and not it["iscrowd"]]
        write_png(scene / "rgb" / f"{number:06}.png", np.zeros((HEIGHT, WIDTH, 3)))
        for entry, it in enumerate(own):
            for name, key in (("mask", "segmentation"), ("mask_visib", "visible_mask")):
                write_png(scene / name / f"{number:06}_{entry:06}.png", 255 * decode(it[key]))
        poses = {"cam_R_m2c": identity, "cam_t_m2c": [0, 0, 1000]}
        truth[number] = [{**poses, "obj_id": it["category_id"]} for it in own]
        counts = {"px_count_all": 1, "px_count_valid": 1, "px_count_visib": 1, "visib_fract": 1.0}
        info[number] = [{**counts, "bbox_obj": [0, 0, 1, 1], "bbox_visib": [0, 0, 1, 1]} for _ in own]
        camera[number] = {"cam_K": [300, 0, 160, 0, 300, 120, 0, 0, 1], "depth_scale": 1.0}
        names[image["id"]] = f"000001/{number:06}"
    for name, content in (("scene_gt", truth), ("scene_gt_info", info), ("scene_camera", camera)):
        (scene / f"{name}.json").write_text(json.dumps(content))
    named = [{**it, "image_id": names[it["image_id"]]} for it in results]
    (folder / "bop_results.json").write_text(json.dumps(named))


def of_bop(folder: Path) -> tuple[dict, list]:
    """What pycocotools is given for these: images by their numbers, and no crowds."""
    data, results = json.loads(labels_of(folder).read_text()), json.loads((folder / "results.json").read_text())
    numbers = {image["id"]: number for number, image in enumerate(data["images"], 1)}
    data["annotations"] = [it for it in data["annotations"] if not it["iscrowd"]]
    for image in data["images"]:
        image["id"] = numbers[image["id"]]
    for it in [*data["annotations"], *results]:
        it["image_id"] = numbers[it["image_id"]]
    return data, results


def coco_scores(folder: Path, kind: str, what: str, categories: bool, bop: bool = False) -> tuple[list[float | None], dict]:
    """The twelve scores, and AP by category."""
    data, results = json.loads(labels_of(folder).read_text()), json.loads((folder / "results.json").read_text())
    if bop:
        data, results = of_bop(folder)
    if kind == "visible":
        for it in data["annotations"]:
            if not it["iscrowd"]:
                rle = it["segmentation"] = it["visible_mask"]
                it |= {"area": int(mask.area(rle)), "bbox": mask.toBbox(rle).tolist()}
    key = "segmentation" if kind == "visible" else "amodal_segmentation"
    # `loadRes` sets the area of a result from its box if it has one, and else from its mask.
    predicted = (lambda rle: {"bbox": mask.toBbox(rle).tolist()}) if what == "bbox" else (lambda rle: {"segmentation": rle})
    results = [{**{k: it[k] for k in ("image_id", "category_id", "score")}, **predicted(it[key])} for it in results]
    if not categories:
        # Else pycocotools ranks equal scores of an image by category.
        data["categories"] = data["categories"][:1]
        for it in [*data["annotations"], *results]:
            it["category_id"] = data["categories"][0]["id"]
    with contextlib.redirect_stdout(io.StringIO()):
        truth = COCO()
        truth.dataset = data
        truth.createIndex()
        evaluation = COCOeval(truth, truth.loadRes(results), what)
        evaluation.params.useCats = int(categories)
        evaluation.evaluate()
        evaluation.accumulate()
        evaluation.summarize()
    each = {}
    for index, category in enumerate(evaluation.params.catIds if categories else []):
        found = evaluation.eval["precision"][:, :, index, 0, -1]
        each[category] = 100 * float(found[found > -1].mean()) if (found > -1).any() else None
    return [None if value == -1 else 100 * float(value) for value in evaluation.stats], each


def panoptic(folder: Path) -> list[float]:
    data, results = json.loads(labels_of(folder).read_text()), json.loads((folder / "results.json").read_text())
    total, hits, missed, spurious = 0.0, 0, 0, 0
    for image in data["images"]:
        own = [it for it in data["annotations"] if it["image_id"] == image["id"]]
        labels = [decode(it["visible_mask"]) for it in own if not it["iscrowd"]]
        crowd = np.zeros((HEIGHT, WIDTH), bool)
        for it in own:
            if it["iscrowd"]:
                crowd |= decode(mask.frPyObjects(it["segmentation"], HEIGHT, WIDTH))
        crowd &= ~np.any([crowd & False, *labels], axis=0)
        found = [it for it in results if it["image_id"] == image["id"] and it["score"] >= LEAST]
        painted = np.zeros((HEIGHT, WIDTH), int)
        for number, it in enumerate(sorted(found, key=lambda it: -it["score"]), 1):
            painted[decode(it["segmentation"])] = number
        taken = set()
        for number in np.unique(painted[painted > 0]):
            segment = painted == number
            ious = [(segment & label).sum() / (segment | label).sum() for label in labels]
            best = int(np.argmax(ious)) if ious else 0
            if ious and ious[best] > 0.5:
                assert best not in taken
                taken.add(best)
                total, hits = total + ious[best], hits + 1
            elif (segment & crowd).sum() <= 0.5 * segment.sum():
                spurious += 1
        missed += len(labels) - len(taken)
    whole = hits + 0.5 * (missed + spurious)
    return [100 * total / whole, 100 * total / hits, 100 * hits / whole]


def compare_bop(folder: Path, scores: Path) -> None:
    wanted = {}
    for kind in ("amodal", "visible"):
        for what, name in (("segm", "mask"), ("bbox", "box")):
            values, each = coco_scores(folder, kind, what, True, bop=True)
            wanted |= {f"categories_{kind}_{name}_{score}": value for score, value in zip(SCORES, values)}
            # No label is of the category 17, which is no object of the dataset then.
            wanted |= {f"obj_{it:06}_{kind}_{name}_ap": value for it, value in each.items() if it != 17}
    assert len(wanted) == 60 and sum(value is not None and 0 < value < 100 for value in wanted.values()) >= 50, wanted
    differences(wanted, json.loads(scores.read_text())["scores"])


def compare(folder: Path, scores: Path) -> None:
    found = json.loads(scores.read_text())["scores"]
    wanted = dict(zip(("pq", "sq", "rq"), panoptic(folder)))
    for kind in ("amodal", "visible"):
        for what, name in (("segm", "mask"), ("bbox", "box")):
            values, _ = coco_scores(folder, kind, what, False)
            wanted |= {f"{kind}_{name}_{score}": value for score, value in zip(SCORES, values)}
            values, each = coco_scores(folder, kind, what, True)
            wanted |= {f"categories_{kind}_{name}_{score}": value for score, value in zip(SCORES, values)}
            words = {category: CATEGORIES[category].replace(", ", "_") for category in each}
            wanted |= {f"{words[category]}_{kind}_{name}_ap": value for category, value in each.items()}
    assert len(wanted) == 115 and sum(value is not None and 0 < value < 100 for value in wanted.values()) >= 95, wanted
    differences(wanted, found)


def differences(wanted: dict, found: dict) -> None:
    wrong = []
    for name, value in wanted.items():
        if (value is None) != (found[name] is None) or value is not None and abs(found[name] - value) > 1e-7:
            wrong.append(f"{name}: {found[name]}, not {value}")
    if wrong:
        sys.exit("\n".join(wrong))


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["make", folder]:
            make(Path(folder))
        case ["compare", folder, scores]:
            compare(Path(folder), Path(scores))
        case ["bop", folder, scores]:
            compare_bop(Path(folder), Path(scores))
        case _:
            sys.exit(__doc__)
