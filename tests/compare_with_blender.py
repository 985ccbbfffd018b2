"""Renders an exported scene with Blender's Cycles and compares it, body by body, with the program's own radiance.

Not part of CI: it needs `pip install bpy==5.0.1` (Python 3.11). Imports with the script that the gltf writer ships. A
dataset to compare with:

    [write.gltf]
    [write.npy]
    include = ["radiance", "instance"]

    python tests/compare_with_blender.py DATASET [--scene 0] [--samples 128] [--filter-glossy 0]

Prints the mean luminance of every body that covers at least 60 pixels of the first view, and of the whole image: ours,
theirs, the difference with its standard error, and that of the medians, which a few pixels that mirror the sun cannot
move. Fails if Blender sees the bodies elsewhere than the camera's `K` says.
"""

import argparse
import pathlib
import sys
import tempfile

import bpy
import bpy_extras
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "plugins/formats/write/src/gltf"))
import import_in_blender


LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
# Independent images, whose differences are the noise.
IMAGES = 4


def load(path, width, height, filter_glossy=0.0):
    """Opens the first view for path tracing without clamping or denoising, with a box filter."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    import_in_blender.load(path)
    scene = bpy.context.scene
    cycles = scene.cycles
    cycles.use_denoising, cycles.use_adaptive_sampling = False, False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    # Rougher gloss after a bounce, which loses light between glossy walls.
    cycles.blur_glossy = filter_glossy
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 8
    cycles.pixel_filter_type = "BOX"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"


def image(samples, seed=0):
    """Radiance of what is open, by Cycles."""
    scene = bpy.context.scene
    scene.cycles.samples, scene.cycles.seed = samples, seed
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = f"{folder}/image.exr"
        bpy.ops.render.render(write_still=True)
        made = bpy.data.images.load(scene.render.filepath)
        width, height = made.size
        radiance = np.array(made.pixels[:]).reshape(height, width, 4)[::-1, :, :3].copy()
        bpy.data.images.remove(made)
        return radiance


def camera_error(document):
    """Largest distance, in pixels, between where Blender and `K` see the origins of bodies."""
    scene = bpy.context.scene
    extras = document["cameras"][0]["extras"]
    size = np.array([extras["width"], extras["height"]])
    bpy.context.view_layer.update()
    # A camera of Blender's looks along its -z with y up.
    camera_from_world = np.diag([1, -1, -1, 1]) @ np.linalg.inv(np.array(scene.camera.matrix_world))
    errors = []
    for node in document["nodes"]:
        if "instance_id" in node.get("extras", {}):
            at = bpy.data.objects[node["name"]].matrix_world.translation
            x, y, z = (camera_from_world @ [*at, 1.0])[:3]
            if z > 0:
                seen = bpy_extras.object_utils.world_to_camera_view(scene, scene.camera, at)
                u, v, w = np.array(extras["K"]) @ [x, y, z]
                errors.append(np.abs(np.array([seen.x, 1 - seen.y]) * size - [u / w, v / w]).max())
    return max(errors, default=0.0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=pathlib.Path)
    parser.add_argument("--scene", type=int, default=0)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--filter-glossy", type=float, default=0.0, help="Blender's own default is 1")
    options = parser.parse_args()
    glb = options.dataset / "gltf" / f"{options.scene:06}.glb"
    name = f"{options.scene:06}_0000.npy"
    ours = np.load(options.dataset / "npy/radiance" / name) @ LUMINANCE
    instance = np.load(options.dataset / "npy/instance" / name)
    height, width = instance.shape
    load(glb, width, height, options.filter_glossy)
    document = import_in_blender.document(glb)
    off = camera_error(document)
    images = [image(max(options.samples // IMAGES, 1), seed) @ LUMINANCE for seed in range(IMAGES)]
    theirs = np.mean(images, 0)
    names = {node["extras"]["instance_id"]: node["name"] for node in document["nodes"]
             if "instance_id" in node.get("extras", {})}

    def line(name, mask):
        a, b = ours[mask].mean(), theirs[mask].mean()
        error = np.std([one[mask].mean() for one in images], ddof=1) / np.sqrt(IMAGES)
        medians = np.median(theirs[mask]) / np.median(ours[mask]) - 1
        print(f"{name:32} {mask.sum():7} px {a:10.2f} {b:10.2f} nits {100 * (b / a - 1):+7.2f} ± {100 * error / a:5.2f} %"
              f"  medians {100 * medians:+7.2f} %")

    for body in np.unique(instance):
        mask = instance == body
        if mask.sum() >= 60:
            line(names.get(body, "background"), mask)
    line("all", np.full(instance.shape, True))
    print(f"camera: bodies are at most {off:.4f} px from where `K` has them")
    return 0 if off < 0.01 else 1


if __name__ == "__main__":
    sys.exit(main())
