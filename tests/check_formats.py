#!/usr/bin/env python3
"""Compares the files of all formats of one dataset with each other: every reader must find the same masks.

    python3 check_formats.py DATASET
"""

import json
import pathlib
import sys

import h5py
import numpy as np
import pyarrow.parquet
from PIL import Image
from pycocotools import mask as coco_mask
from pycocotools.coco import COCO

root = pathlib.Path(sys.argv[1])
lines = [json.loads(line) for line in (root / "jsonl.jsonl").open()]
views = [line for line in lines if "view" in line]
decode = lambda rles: {int(i): coco_mask.decode(rle) > 0 for i, rle in rles.items()}
visible = {(v["scene"], v["view"]): decode(v["visible_mask"]) for v in views}
amodal = {(v["scene"], v["view"]): decode(v["amodal_mask"]) for v in views}
shown = {key: {i: m for i, m in masks.items() if m.any()} for key, masks in visible.items()}


def same(found, expected, what):
    """As many masks, each the same as one of the others."""
    assert len(found) == len(expected), f"{what}: {len(found)} masks, not {len(expected)}"
    rest = [np.asarray(m) > 0 for m in expected]
    for mask in found:
        at = next((k for k, other in enumerate(rest) if np.array_equal(other, np.asarray(mask) > 0)), None)
        assert at is not None, f"{what}: a mask that is none of the dataset's"
        rest.pop(at)


def key_of(name):
    scene, view = pathlib.Path(name).stem.split("_")[:2]
    return int(scene), int(view)


def coco_like(file, masks_of, expected, what):
    coco = COCO(str(file))
    for image in coco.imgs.values():
        key = key_of(image["file_name"])
        same(masks_of(coco, coco.imgToAnns[image["id"]]), expected(key), f"{what} {key}")
    assert coco.imgs, what
    print(what)


coco_like(root / "coco/annotations/instances_train.json", lambda c, a: [c.annToMask(x) for x in a],
          lambda k: list(amodal[k].values()), "coco")
d2sa, = (root / "d2sa").rglob("*.json")
coco_like(d2sa, lambda c, a: [coco_mask.decode(x["visible_mask"]) for x in a if "visible_mask" in x],
          lambda k: [m for i, m in visible[k].items()], "d2sa")

# Polygons follow the outline of a mask within half a pixel.
kins, = (root / "kins").rglob("*.json")
coco = COCO(str(kins))
for image in coco.imgs.values():
    key = key_of(image["file_name"])
    for annotation in coco.imgToAnns[image["id"]]:
        mask = coco_mask.decode(annotation["inmodal_seg"]) > 0 if "inmodal_seg" in annotation else None
        assert mask is None or any(np.array_equal(mask, m) for m in visible[key].values()), f"kins {key}"
print("kins")

cocoa, = (root / "cocoa").rglob("*.json")
data = json.loads(cocoa.read_text())
names = {image["id"]: image["file_name"] for image in data["images"]}
for annotation in data["annotations"]:
    key = key_of(names[annotation["image_id"]])
    assert annotation["size"] == len(annotation["regions"]) <= len(amodal[key]), f"cocoa {key}"
    for region in annotation["regions"]:
        if "visible_mask" in region:
            mask = coco_mask.decode(region["visible_mask"]) > 0
            assert any(np.array_equal(mask, m) for m in visible[key].values()), f"cocoa {key}"
print("cocoa")

panoptic, = (root / "coco_panoptic").rglob("*.json")
data = json.loads(panoptic.read_text())
names = {image["id"]: image["file_name"] for image in data["images"]}
things = {c["id"] for c in data["categories"] if c["isthing"]}
for annotation in data["annotations"]:
    key = key_of(names[annotation["image_id"]])
    paths = [p for p in (root / "coco_panoptic").rglob(pathlib.Path(annotation["file_name"]).name)
             if p.parent.name != "images"]
    rgb = np.array(Image.open(paths[0])).astype(int)
    ids = rgb[..., 0] + 256 * rgb[..., 1] + 65536 * rgb[..., 2]
    segments = [s for s in annotation["segments_info"] if s["category_id"] in things]
    same([ids == s["id"] for s in segments], list(shown[key].values()), f"panoptic {key}")
print("panoptic")

uoais, = (root / "uoais").rglob("*.json")
data = json.loads(uoais.read_text())
names = {image["id"]: image["file_name"] for image in data["images"]}
for image in data["images"]:
    key = key_of(image["file_name"])
    of = [a for a in data["annotations"] if a["image_id"] == image["id"]]
    same([coco_mask.decode(a["segmentation"]) for a in of], list(amodal[key].values()), f"uoais {key}")
    same([coco_mask.decode(a["visible_mask"]) for a in of], list(visible[key].values()), f"uoais {key}")
print("uoais")

osd = next(p.parent for p in (root / "osd_amodal").rglob("annotation"))
for path in sorted((osd / "annotation").glob("*.png")):
    labels = np.array(Image.open(path))
    masks = [labels == i for i in np.unique(labels) if i > 0]
    assert any(len(m) == len(masks) and all(any(np.array_equal(a, b) for b in m.values()) for a in masks)
               for m in shown.values()), f"osd {path.name}"
print("osd")

for path in sorted((root / "hdf5").rglob("*.hdf5")):
    with h5py.File(path) as file:
        ids = np.array(file["instance_segmaps"])
        assert file["colors"].shape[:2] == file["depth"].shape == ids.shape
        found = [ids == i for i in np.unique(ids) if i > 0]
    assert any(all(any(np.array_equal(a, b) for b in found) for a in m.values()) for m in shown.values()), path.name
print("hdf5")

rows = pyarrow.parquet.read_table(root / "parquet" / "instances").to_pylist()
for key, masks in amodal.items():
    of = [row for row in rows if (row["scene"], row["view"]) == key]
    assert [row["instance"] for row in of] == sorted(masks), f"parquet {key}"
    for row in of:
        i, found = row["instance"], {n: coco_mask.decode(row[f"{n}_mask"]) > 0 for n in ("visible", "amodal")}
        assert np.array_equal(found["amodal"], masks[i]) and np.array_equal(found["visible"], visible[key][i]), key
        rate = 1 - found["visible"].sum() / found["amodal"].sum()
        assert abs(row["occlusion_rate"] - rate) < 1e-12 and row["asset"] and row["category"], row
    assert all(Image.open(root / "parquet/instances" / row["image_file"]).size == (160, 120) for row in of)
print("parquet")

# Vertices of the meshes of BOP, seen with its poses, are in the objects' amodal masks.
names = json.loads((root / "bop/objects.json").read_text())
infos = json.loads((root / "bop/models/models_info.json").read_text())
assert list(infos) == list(names)
meshes = {}
for obj_id in names:
    lines = (root / f"bop/models/obj_{int(obj_id):06}.ply").read_text().splitlines()
    count = int(next(line for line in lines if line.startswith("element vertex")).split()[2])
    start = lines.index("end_header") + 1
    # Colors or texture coordinates follow the position.
    meshes[obj_id] = np.array([line.split()[:3] for line in lines[start : start + count]], float)
found = []
for folder in sorted((root / "bop/train_pbr").iterdir()):
    cameras, truth = (json.loads((folder / f"scene_{name}.json").read_text()) for name in ("camera", "gt"))
    for image, entries in truth.items():
        K = np.array(cameras[image]["cam_K"]).reshape(3, 3)
        for index, entry in enumerate(entries):
            R, t = np.array(entry["cam_R_m2c"]).reshape(3, 3), np.array(entry["cam_t_m2c"])
            points = (meshes[str(entry["obj_id"])] @ R.T + t) @ K.T
            x, y = np.round(points[:, :2] / points[:, 2:]).astype(int).T
            mask = np.pad(np.array(Image.open(folder / f"mask/{int(image):06}_{index:06}.png")) == 255, 1)
            near = np.logical_or.reduce([np.roll(mask, (a, b), (0, 1)) for a in (-1, 0, 1) for b in (-1, 0, 1)])
            inside = (x >= 0) & (x < 160) & (y >= 0) & (y < 120) & (points[:, 2] > 0)
            hits = near[y[inside] + 1, x[inside] + 1]
            # What is thinner than a pixel lies between the centers of pixels: ends of feathers and handles.
            if mask.sum() > 100:
                assert hits.mean() > 0.9, f"{folder.name} {image} {index}: {hits.mean()}"
                found.append(hits)
found = np.concatenate(found)
assert found.size > 1000 and found.mean() > 0.995, (found.size, found.mean())
print("models")

for path in sorted((root / "npz").glob("*.npz")):
    with np.load(path) as file:
        assert file.files, path.name
print("npz")

for line in views:
    areas, key = line["occlusion_areas"], (line["scene"], line["view"])
    ids = areas["ids"]
    for a, i in enumerate(ids):
        for b, j in enumerate(ids):
            hidden = int((visible[key][i] & amodal[key][j]).sum()) if i != j else 0
            assert areas["seen"][a][b] == hidden, f"orders {key}: {i} {j}"
            assert areas["direct"][a][b] <= areas["all"][a][b] and hidden <= areas["all"][a][b]
    assert sorted(line["depth_order"]["front_to_back"]) == ids
    depth = np.load(root / "npy" / "amodal_depth" / f"{key[0]:06}_{key[1]:04}.npy")
    for a, i in enumerate(ids):
        assert np.array_equal(np.isfinite(depth[a]), amodal[key][i]), f"amodal depth {key} {i}"
print("orders")
