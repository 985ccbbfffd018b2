"""Compares the masks of a BOP dataset with bop_toolkit's renderer at the dataset's own poses.

    python3 tests/peers/check_recorded.py DATASET BOP_TOOLKIT

DATASET is a folder with `camera.json`, `models` and one split in the scenewise layout. Needs numpy, pillow, vispy and a
software or hardware OpenGL. Prints the share of mask pixels that differ, and of these the share away from outlines.
"""

import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image


def inner(mask):
    """The mask without pixels beside its outline, and the pixels outside that are not beside it."""
    grown, shrunk = mask.copy(), mask.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            moved = np.roll(mask, step, axis)
            grown |= moved
            shrunk &= moved
    return shrunk | ~grown


def main(dataset, toolkit):
    sys.path.insert(0, str(toolkit))
    from bop_toolkit_lib.rendering import renderer

    info = dataset / "dataset_info.json"
    centers = json.loads(info.read_text()).get("pixel_centers") if info.is_file() else None
    # The renderer of bop_toolkit has its pixel centers at half-integers.
    shift = 0.0 if centers == "half_integers" else 0.5
    models = json.loads((dataset / "models/models_info.json").read_text())
    scenes = sorted(path.parent for path in dataset.glob("*/*/scene_gt.json"))
    made, pixels, differ, deep, masks = None, 0, 0, 0, 0
    for scene in scenes:
        cameras = json.loads((scene / "scene_camera.json").read_text())
        for number, objects in json.loads((scene / "scene_gt.json").read_text()).items():
            k = cameras[number]["cam_K"]
            for index, entry in enumerate(objects):
                path = scene / f"mask/{int(number):06}_{index:06}.png"
                mask = np.asarray(Image.open(path)) > 0
                if made is None:
                    height, width = mask.shape
                    made = renderer.create_renderer(width, height, "vispy", mode="depth")
                    for model in models:
                        made.add_object(int(model), str(dataset / f"models/obj_{int(model):06}.ply"))
                pose = np.reshape(entry["cam_R_m2c"], (3, 3)), np.reshape(entry["cam_t_m2c"], (3, 1))
                depth = made.render_object(entry["obj_id"], *pose, k[0], k[4], k[2] + shift, k[5] + shift)["depth"]
                apart = (depth > 0) != mask
                pixels += int(mask.sum())
                differ += int(apart.sum())
                deep += int((apart & inner(mask)).sum())
                masks += 1
    print(f"{masks} masks of {len(scenes)} scenes, {pixels} pixels")
    print(f"differ: {differ} ({100 * differ / pixels:.3f} %), away from outlines: {deep} ({100 * deep / pixels:.4f} %)")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
