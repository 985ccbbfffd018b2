#!/usr/bin/env python3
"""Writes a small dataset of a format as its published files are, with NumPy, Pillow and pycocotools, and what a reader must
find in it.

    python3 foreign.py FORMAT FOLDER

`FOLDER/data` is the dataset; `FOLDER/truth.json` is a list of images in their order, each a list of objects with their
visible and amodal mask as pixels of rows, and their category.
"""

import json
import pathlib
import sys

import numpy as np
from PIL import Image
from pycocotools import mask as coco_mask

WIDTH, HEIGHT = 53, 37
kind, folder = sys.argv[1], pathlib.Path(sys.argv[2])
root = folder / "data"
rng = np.random.default_rng(7)
# Outlines of objects, each far from the others, and what is seen of each; none if all of it is. Coordinates are none at which
# pycocotools rounds, so that decimals in text change no pixel.
STAR = [4.33, 4.13, 12.73, 3.23, 16.93, 9.43, 11.23, 14.83, 8.13, 8.93]
TRIANGLE = [25.53, 3.03, 44.23, 6.63, 30.13, 16.33]
TRIANGLE_SEEN = [25.53, 3.03, 44.23, 6.63, 38.03, 9.63, 28.03, 9.63]
BEYOND = [30.03, 22.03, 60.03, 25.03, 58.53, 41.03, 33.33, 39.93]
IMAGES = [[(STAR, None, 1), (TRIANGLE, TRIANGLE_SEEN, 2)], [], [(BEYOND, None, 2), (STAR, STAR, 1)]]


def drawn(polygon):
    return coco_mask.decode(coco_mask.merge(coco_mask.frPyObjects([polygon], HEIGHT, WIDTH))) > 0


def rle(mask):
    encoded = coco_mask.encode(np.asfortranarray(mask.astype(np.uint8)))
    return {"size": encoded["size"], "counts": encoded["counts"].decode()}


def box(mask):
    return coco_mask.toBbox(coco_mask.encode(np.asfortranarray(mask.astype(np.uint8)))).tolist()


def image(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(rng.integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8)).save(path)


def objects():
    """Of each image its objects: amodal polygon, both masks, category."""
    for shapes in IMAGES:
        yield [(amodal, drawn(amodal), drawn(seen or amodal) & drawn(amodal), category) for amodal, seen, category in shapes]


def write(path, value):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value, indent=1))


def records(names):
    return [{"id": 10 + n, "file_name": name, "width": WIDTH, "height": HEIGHT} for n, name in enumerate(names)]


def kins():
    names = [f"{n:06}.png" for n in range(len(IMAGES))]
    annotations = []
    for n, found in enumerate(objects()):
        image(root / "training/image_2" / names[n])
        for (amodal, seen, category), (_, a, v, _) in zip(IMAGES[n], found):
            annotations.append({
                "id": len(annotations), "image_id": 10 + n, "category_id": category, "iscrowd": 0,
                "a_segm": [amodal], "a_bbox": [int(x) for x in box(a)], "a_area": int(a.sum()),
                "i_segm": [seen or amodal], "i_bbox": [int(x) for x in box(v)], "i_area": int(v.sum()),
                "oco_id": 0, "ico_id": 0})
    categories = [{"supercategory": "Living Thing", "id": 1, "name": "cyclist"}, {"supercategory": "vehicles", "id": 2, "name": "car"}]
    write(root / "update_train_2020.json", {"images": records(names), "annotations": annotations, "categories": categories})


def d2sa():
    names = [f"D2S_{n:06}.jpg" for n in (200, 201, 202)]
    annotations = []
    for n, found in enumerate(objects()):
        image(root / "images" / names[n])
        for place, (_, a, v, category) in enumerate(found):
            area, hidden = float(a.sum()), a & ~v
            record = {
                "id": 1 + len(annotations), "image_id": 10 + n, "category_id": 10 * category, "iscrowd": False, "area": area,
                "bbox": box(a), "segmentation": rle(a), "visible_mask": rle(v), "occlude_rate": float(hidden.sum()) / area,
                "occl_depth": 0, "amodal_region": {"name": "x", "area": area, "isStuff": False, "bbox": box(a), "order": place + 1},
                "amodal_base": {"url": "", "image_id": 10 + n, "size": 2, "author": "x", "depth_constraint": ""}}
            if hidden.any():
                record["invisible_mask"] = rle(hidden)
            annotations.append(record)
    categories = [{"supercategory": "x", "id": 10, "name": "cyclist"}, {"supercategory": "x", "id": 20, "name": "car"}]
    # Sections in an order of its own.
    write(root / "annotations/D2S_amodal_validation.json",
          {"annotations": annotations, "type": "instances", "images": records(names), "categories": categories, "info": {}})


def cocoa():
    names = [f"COCO_train2014_{n:012}.jpg" for n in (5, 77, 990)]
    annotations = []
    for n, found in enumerate(objects()):
        image(root / "train2014" / names[n])
        if not found:
            continue
        regions = [{"segmentation": [0.0, 0.0, 53.0, 0.0, 53.0, 37.0, 0.0, 37.0], "name": "wall", "area": 1961.0, "isStuff": 1,
                    "occlude_rate": 0.4, "order": len(found) + 1, "visible_mask": rle(~drawn(STAR)), "invisible_mask": rle(drawn(STAR))}]
        for place, (amodal, a, v, category) in reversed(list(enumerate(found))):
            hidden = a & ~v
            region = {"segmentation": amodal, "name": ["cyclist", "car"][category - 1], "area": float(a.sum()), "isStuff": 0,
                      "occlude_rate": float(hidden.sum()) / float(a.sum()), "order": place + 1}
            if hidden.any():
                region |= {"visible_mask": rle(v), "invisible_mask": rle(hidden)}
            regions.insert(0, region)
        annotations.append({"id": 1 + n, "image_id": 10 + n, "url": "http://x", "author": "x", "size": len(regions),
                            "depth_constraint": "1-2,1-3", "regions": regions})
    images = [dict(record, data_captured="2013") for record in records(names)]
    write(root / "annotations/COCO_amodal_train2014.json", {"images": images, "annotations": annotations, "info": {}, "licenses": []})


def osd_amodal():
    for n, found in enumerate(objects()):
        name = f"{'learn' if n else 'test'}{n}"
        image(root / "image_color" / f"{name}.png")
        labels = np.zeros((HEIGHT, WIDTH), np.uint8)
        for folder in ("disparity", "annotation", "amodal_annotation", "occlusion_annotation"):
            (root / folder).mkdir(exist_ok=True)
        for label, (_, a, v, _) in enumerate(found, 1):
            labels[v] = label
            Image.fromarray(a.astype(np.uint8) * 255).save(root / "amodal_annotation" / f"{name}_{label}.png")
            if (a & ~v).any():
                Image.fromarray((a & ~v).astype(np.uint8)).save(root / "occlusion_annotation" / f"{name}_{label}.png")
        Image.fromarray(labels).save(root / "annotation" / f"{name}.png")
        depth = rng.integers(0, 2000, (HEIGHT, WIDTH)).astype(np.uint16)
        Image.fromarray(depth).save(root / "disparity" / f"{name}.png")


def labeled(found, support):
    """Labels with a palette, as Pillow writes them: 0 in a corner, then what objects stand on, then the objects."""
    labels = np.full((HEIGHT, WIDTH), support, np.uint8)
    labels[:5, :3] = 0
    for label, (_, _, v, _) in enumerate(found, support + 1):
        labels[v] = label
    indexed = Image.fromarray(labels)
    indexed.putpalette(rng.integers(0, 255, 768, dtype=np.uint8).tobytes())
    return indexed


def tod():
    scene = root / "training_set/scene_00003"
    for n, found in enumerate(objects()):
        image(scene / f"rgb_{n:05}.jpeg")
        labeled(found, 1).save(scene / f"segmentation_{n:05}.png")
        Image.fromarray(rng.integers(0, 2000, (HEIGHT, WIDTH)).astype(np.uint16)).save(scene / f"depth_{n:05}.png")
    write(scene / "scene_description.txt", {
        "house_id": "x", "room_id": "fr_0", "table": {"mesh_filename": "x"},
        "object_descriptions": [{"mesh_filename": "x", "axis_aligned_bbox3D_center": [0, 0, 1]} for _ in range(2)],
        "views": {"background": {}, "background+table": {}, "background+table+objects": [{}]}})


def ocid():
    for n, found in enumerate(objects()):
        place, support = ("table/bottom/box/seq02", 2) if n else ("floor/top/seq01", 1)
        scene, name = root / "ARID20" / place, f"result_2018-08-20-09-30-3{n}.png"
        image(scene / "rgb" / name)
        for other in ("label", "depth", "pcd"):
            (scene / other).mkdir(exist_ok=True)
        labels = labeled(found, support)
        # Some are gray, with 8 or 16 bits.
        (labels if n == 0 else Image.fromarray(np.asarray(labels).astype(np.uint8 if n == 1 else np.uint16))).save(scene / "label" / name)
        Image.fromarray(rng.integers(0, 2000, (HEIGHT, WIDTH)).astype(np.uint16)).save(scene / "depth" / name)


def yolo():
    for split in ("train", "val"):
        for n, shapes in enumerate(IMAGES):
            image(root / "images" / split / f"photo {n}.jpg")
            lines = [" ".join([str(category - 1)] + [f"{x / (HEIGHT if i % 2 else WIDTH):.9f}" for i, x in enumerate(polygon)])
                     for polygon, _, category in shapes]
            labels = root / "labels" / split / f"photo {n}.txt"
            labels.parent.mkdir(parents=True, exist_ok=True)
            # An image without objects need not have a file.
            if lines:
                labels.write_text("\n".join(lines))
    (root / "data.yaml").write_text("path: ../datasets/x # where it is\ntrain: images/train\nval: images/val\n\n"
                                    "nc: 2\nnames:\n  0: cyclist\n  1: car\n")


globals()[kind]()
pixels = lambda mask: mask.astype(int).tolist()
truth = [[[pixels(drawn(amodal) if kind == "yolo" else v), pixels(a), ["cyclist", "car"][category - 1]]
          for (amodal, a, v, category) in found] for found in objects()]
if kind == "osd_amodal":
    truth = [truth[n] for n in (1, 2, 0)]
write(folder / "truth.json", truth)
