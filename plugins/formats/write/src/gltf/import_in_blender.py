#!/usr/bin/env python3
"""Imports a scene of the gltf writer into Blender with the light that the dataset has.

    blender --python import_in_blender.py -- 000003.glb [--view 0] [--white NITS]
    python3 import_in_blender.py --show 000003.glb

Blender's importer divides lights in lux and candela by 683 lm/W unless its lighting mode is `Unitless`, and leaves materials
that emit, in nits, as they are. It also drops the size of the sun, and glTF has no sky. This script imports with the right
mode, so that one unit of Blender's is a nit, a lux or a candela; gives suns their angular diameter; hangs up the sky from
the HDR file beside the scene; and gives the camera both focal lengths and the principal point of `K`. `--white` sets the exposure so that this luminance is white: `white_nits` of the
image's `exposure`. `--show` prints what is set, as JSON, without Blender.
"""

import argparse
import json
import math
import pathlib
import struct
import sys


def document(path):
    """The JSON of a binary glTF file."""
    with open(path, "rb") as file:
        magic, version, _, size, kind = struct.unpack("<4sIII4s", file.read(20))
        if (magic, version, kind) != (b"glTF", 2, b"JSON"):
            raise SystemExit(f"{path} is not a binary glTF 2.0 file")
        return json.loads(file.read(size))


def settings(path):
    """What the importer cannot know: suns by the name of their node, skies, cameras by the name of their node."""
    gltf = document(path)
    lights = gltf.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    suns, cameras = {}, {}
    for node in gltf["nodes"]:
        extras = node.get("extras", {})
        light = node.get("extensions", {}).get("KHR_lights_punctual", {}).get("light")
        if light is not None and lights[light]["type"] == "directional":
            # Blender's strength of a sun is its irradiance across its direction, whatever its angle.
            suns[node["name"]] = {
                "strength": lights[light]["intensity"],
                "color": lights[light].get("color", [1.0, 1.0, 1.0]),
                "angle": 2.0 * extras.get("half_angle", 0.0),
            }
        if "camera" in node:
            cameras[node["name"]] = camera(gltf["cameras"][node["camera"]]["extras"])
    skies = [
        # The importer leaves the dataset's axes as they are, z up. A map that turns counterclockwise is looked up in
        # directions that turn back.
        {"file": str(pathlib.Path(path).parent / sky["file"]), "lookup_rotation_z": -sky["rotation_rad"], "strength": 1.0}
        for sky in gltf["scenes"][0].get("extras", {}).get("environments", [])
    ]
    return {"lighting_mode": "COMPAT", "suns": suns, "skies": skies, "cameras": cameras}


def camera(extras):
    """What a camera of Blender's needs beside its vertical field of view, which the importer has from the file.

    The two focal lengths differ by the aspect of the pixels, whose sides Blender wants to be one or more. A shift is in
    image heights, to the right and up.
    """
    (fx, _, cx), (_, fy, cy), _ = extras["K"]
    width, height = extras["width"], extras["height"]
    return {
        "view": extras["view"],
        "size": [width, height],
        "pixel_aspect": [max(fy / fx, 1.0), max(fx / fy, 1.0)],
        "shift": [(width / 2 - cx) * fy / (fx * height), (cy - height / 2) / height],
    }


def hang_up(world, skies):
    """Makes the sum of some environment maps the light of a world."""
    import bpy

    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    light = None
    for sky in skies:
        coordinates, mapping = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeMapping")
        image, background = nodes.new("ShaderNodeTexEnvironment"), nodes.new("ShaderNodeBackground")
        mapping.inputs["Rotation"].default_value[2] = sky["lookup_rotation_z"]
        image.image = bpy.data.images.load(sky["file"])
        background.inputs["Strength"].default_value = sky["strength"]
        links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
        links.new(mapping.outputs["Vector"], image.inputs["Vector"])
        links.new(image.outputs["Color"], background.inputs["Color"])
        shader = background.outputs["Background"]
        if light is not None:
            both = nodes.new("ShaderNodeAddShader")
            links.new(light, both.inputs[0])
            links.new(shader, both.inputs[1])
            shader = both.outputs["Shader"]
        light = shader
    if light is not None:
        links.new(light, nodes.new("ShaderNodeOutputWorld").inputs["Surface"])


def load(path, view=0, white=None):
    """Imports a file into the open Blender file, and looks through the camera of a view."""
    import bpy

    wanted = settings(path)
    bpy.ops.import_scene.gltf(filepath=str(path), export_import_convert_lighting_mode=wanted["lighting_mode"])
    for name, sun in wanted["suns"].items():
        light = bpy.data.objects[name].data
        light.energy, light.color, light.angle = sun["strength"], sun["color"], sun["angle"]
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("sky")
    hang_up(scene.world, wanted["skies"])
    for name, seen in wanted["cameras"].items():
        data = bpy.data.objects[name].data
        data.shift_x, data.shift_y = seen["shift"]
        if seen["view"] == view:
            scene.camera = bpy.data.objects[name]
            scene.render.resolution_x, scene.render.resolution_y = seen["size"]
            scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = seen["pixel_aspect"]
    scene.render.engine = "CYCLES"
    if white:
        scene.view_settings.exposure = -math.log2(white)


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=pathlib.Path)
    parser.add_argument("--view", type=int, default=0, help="the view whose camera is used")
    parser.add_argument("--white", type=float, help="luminance that is white, nits")
    parser.add_argument("--show", action="store_true", help="print what is set and import nothing")
    options = parser.parse_args(arguments)
    if options.show:
        print(json.dumps(settings(options.file), indent=2))
    else:
        load(options.file, options.view, options.white)


if __name__ == "__main__":
    # Blender's own arguments end at `--`.
    main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:])
