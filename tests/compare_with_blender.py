"""Renders an exported scene with Blender's Cycles and compares it, body by body, with the program's own radiance.

Not part of CI: it needs `pip install bpy==5.0.1` (Python 3.11). Imports with the script that the gltf writer ships. A
dataset to compare with:

    [write.gltf]
    [write.npy]
    include = ["radiance", "instance"]

    python tests/compare_with_blender.py DATASET [--scene 0] [--samples 128]

Prints the mean luminance of every body that covers at least 60 pixels of the first view, and of the whole image.
"""

import argparse
import pathlib
import sys
import tempfile

import bpy
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "plugins/write/src/gltf"))
import import_in_blender


def render(path, width, height, samples):
    """Radiance of the first view by Cycles: path tracing without clamping or denoising, box filter."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    import_in_blender.load(path)
    scene = bpy.context.scene
    cycles = scene.cycles
    cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling = samples, False, False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 8
    cycles.pixel_filter_type = "BOX"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = f"{folder}/image.exr"
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        return np.array(image.pixels[:]).reshape(height, width, 4)[::-1, :, :3]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=pathlib.Path)
    parser.add_argument("--scene", type=int, default=0)
    parser.add_argument("--samples", type=int, default=128)
    options = parser.parse_args()
    glb = options.dataset / "gltf" / f"{options.scene:06}.glb"
    name = f"{options.scene:06}_0000.npy"
    ours = np.load(options.dataset / "npy/radiance" / name)
    instance = np.load(options.dataset / "npy/instance" / name)
    height, width = instance.shape
    theirs = render(glb, width, height, options.samples)
    weights = np.array([0.2126, 0.7152, 0.0722])
    names = {node["extras"]["instance_id"]: node["name"] for node in import_in_blender.document(glb)["nodes"]
             if "instance_id" in node.get("extras", {})}
    for body in np.unique(instance):
        mask = instance == body
        if mask.sum() >= 60:
            a, b = (ours[mask] @ weights).mean(), (theirs[mask] @ weights).mean()
            print(f"{names.get(body, 'background'):32} {mask.sum():7} px {a:10.2f} {b:10.2f} nits {100 * (b / a - 1):+6.2f} %")
    a, b = (ours @ weights).mean(), (theirs @ weights).mean()
    print(f"{'all':32} {instance.size:7} px {a:10.2f} {b:10.2f} nits {100 * (b / a - 1):+6.2f} %")


if __name__ == "__main__":
    main()
