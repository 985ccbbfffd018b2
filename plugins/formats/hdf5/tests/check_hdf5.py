"""Reads an HDF5 file with h5py and compares it with the arrays that it was made from.

usage: check_hdf5.py FOLDER
"""

import json
import pathlib
import sys

import h5py
import numpy as np

ROOT = pathlib.Path(sys.argv[1])
SHAPE = (301, 520)


def raw(name, dtype, *rest):
    return np.frombuffer((ROOT / f"{name}.raw").read_bytes(), dtype).reshape(*SHAPE, *rest)


def same(got, want, what):
    assert got.dtype == want.dtype and got.shape == want.shape, f"{what}: {got.dtype} {got.shape}"
    assert np.array_equal(got, want, equal_nan=got.dtype.kind == "f"), what


depth, ids = raw("depth", "<f4"), raw("instance", "<u2")
assert set(np.unique(ids)) == {0, 1, 2, 300} and np.isinf(depth).any()
categories = np.select([ids == 1, ids == 2], [3, 1], 0).astype(np.uint8)
normals = raw("normal", "<f4", 3) * np.float32([1, -1, -1]) * np.float32(0.5) + np.float32(0.5)
with np.errstate(invalid="ignore"):
    distance = (depth.astype(float) * raw("rays", "<f8")).astype(np.float32)
assert (distance[np.isfinite(depth)] >= depth[np.isfinite(depth)]).all() and (distance > depth * 1.1).any()
arrays = {
    "colors": raw("rgb", "u1", 3),
    "depth": depth,
    "distance": distance,
    "normals": normals,
    "instance_segmaps": ids,
    "category_id_segmaps": categories,
    "half": raw("half", "<f2", 2),
    "flag": raw("flag", "?"),
    "wide": raw("wide", "<i8"),
    "visible_mask": np.stack([ids == 1, ids == 2]),
    "visible_mask_ids": np.uint16([1, 2]),
    "amodal_mask": np.zeros((0, *SHAPE), bool),
    "amodal_mask_ids": np.zeros(0, np.uint16),
    "occlusion_rate": np.array([0.25, 1 / 3]),
    "occlusion_rate_ids": np.uint16([1, 2]),
}
name = lambda n: f"pöol/{n}"
bodies = [
    {"idx": 1, "category_id": 3, "name": name("mug_1"), "category": "mug", "role": "object"},
    {"idx": 2, "category_id": 1, "name": name("thing"), "category": "gadget", "role": "object"},
    {"idx": 300, "category_id": 0, "name": name("table"), "category": "mug", "role": "support"},
]
texts = {
    "instance_attribute_maps": bodies,
    "note": "späte Tasse",
    "object_info": {"1": {"name": "mug_1"}, "2": {"name": "mug_2"}},
}
with h5py.File(ROOT / "h5/000004_0002.hdf5") as file:
    assert set(file) == set(arrays) | set(texts), set(file) ^ (set(arrays) | set(texts))
    for key, want in arrays.items():
        same(file[key][()], want, key)
        # Part of an array is read from its chunks.
        if want.ndim > 1 and len(want):
            same(file[key][1:, 3:7], want[1:, 3:7], key)
            assert file[key].compression == "gzip" and file[key].id.get_storage_size() > 0, key
    for key, want in texts.items():
        # As BlenderProc's users read it.
        assert file[key].shape == () and json.loads(np.array(file[key]).tobytes()) == want, (key, file[key][()])
    assert file["normals"].chunks[0] < SHAPE[0] and file["flag"].id.get_storage_size() < 20000
print(f"hdf5: {len(arrays)} arrays, {len(texts)} texts")
