"""Checks BOP's tar files: those of a dataset hold what its folders do, and a larger dataset has two of them.

usage: check_bop_web.py FOLDER
"""

import io
import json
import pathlib
import sys

import numpy as np
import webdataset
from PIL import Image
from pycocotools import mask as coco

ROOT = pathlib.Path(sys.argv[1])
FIELDS = ["gt.json", "rgb.png", "depth.png", "camera.json", "gt_info.json", "mask.json", "mask_visib.json"]


def same(got, want, what):
    assert got == want, f"{what}: {got}, not {want}"


def samples(folder):
    """All samples of the tar files of a folder, and the number of the file of each."""
    found = {}
    for number, path in enumerate(sorted(folder.glob("shard-*.tar"))):
        same(path.name, f"shard-{number:06}.tar", "shard")
        for sample in webdataset.WebDataset(str(path), shardshuffle=False):
            assert sample["__key__"] not in found
            found[sample["__key__"]] = (number, sample)
    return found


def pixels(rle):
    """An uncompressed mask, run by run."""
    height, width = rle["size"]
    runs = np.repeat(np.arange(len(rle["counts"])) % 2, rle["counts"])
    mask = runs.reshape(width, height).T
    assert np.array_equal(mask, coco.decode(coco.frPyObjects(rle, height, width)))
    return mask > 0


folders, web = ROOT / "bop", ROOT / "web/bop"
found = samples(web / "test_web")
same(json.loads((web / "test_web/key_to_shard.json").read_text()), {key: 0 for key in found}, "key_to_shard")
same(list(found), [f"{s:06}_{v:06}" for s in range(3) for v in range(2)], "keys")
assert not (web / "test").exists()
for name in ("camera.json", "dataset_info.json", "objects.json", "test_targets_bop19.json", "models/obj_000002.ply"):
    same((web / name).read_bytes(), (folders / name).read_bytes(), name)
counted = 0
for key, (_, sample) in found.items():
    scene, view = key.split("_")
    folder, number = folders / "test" / scene, str(int(view))
    assert set(FIELDS) < set(sample), sample.keys()
    for field, file in (("gt", "scene_gt"), ("gt_info", "scene_gt_info"), ("camera", "scene_camera")):
        same(json.loads(sample[f"{field}.json"]), json.loads((folder / f"{file}.json").read_text())[number], file)
    for field in ("rgb", "depth"):
        same(sample[f"{field}.png"], (folder / field / f"{view}.png").read_bytes(), field)
        assert Image.open(io.BytesIO(sample[f"{field}.png"])).size == (64, 48)
    for field in ("mask", "mask_visib"):
        masks = json.loads(sample[f"{field}.json"])
        same([int(k) for k in masks], list(range(len(json.loads(sample["gt.json"])))), field)
        for index, rle in masks.items():
            want = np.array(Image.open(folder / field / f"{view}_{int(index):06}.png")) == 255
            assert np.array_equal(pixels(rle), want), f"{key} {field} {index}"
            counted += want.any()
assert counted > 30, counted

large = ROOT / "large/bop/train_pbr_web"
found = samples(large)
keys = [f"000004_{v:06}" for v in range(998)] + [f"000007_{v:06}" for v in range(5)]
same(list(found), keys, "keys of two shards")
same([number for number, _ in found.values()], [0] * 1000 + [1] * 3, "shards")
same(json.loads((large / "key_to_shard.json").read_text()), {k: int(i >= 1000) for i, k in enumerate(keys)}, "shards")
for i, key in enumerate(keys):
    sample = found[key][1]
    same([len(json.loads(sample[f])) for f in ("gt.json", "gt_info.json", "mask.json")][1:],
         [len(json.loads(sample["gt.json"]))] * 2, key)
print(f"bop tar files: {counted} masks, {len(found)} images in two shards")
