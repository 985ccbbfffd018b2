"""Scanned objects fall on a table in a room, and random cameras look at them: the scene of all tasks of Kubric.

Kubric reads OBJ with an operator that Blender 4 removed, and its simulator reads only URDF. `convert` therefore writes
each mesh as GLB and URDF. Kubric's materials fail with Blender 4, so the room is gray.
"""

import glob
import os

import kubric as kb
import numpy as np
import trimesh
from kubric.renderer.blender import Blender
from kubric.simulator.pybullet import PyBullet
from PIL import Image

URDF = """<robot name="object"><link name="base">
<inertial><mass value="0.3"/><inertia ixx="3e-4" iyy="3e-4" izz="3e-4" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><mesh filename="collision.obj"/></geometry></collision>
</link></robot>"""


def convert(file: str, scratch: str) -> dict:
    """Writes a mesh as GLB and URDF, and returns the arguments of its object."""
    out = os.path.join(scratch, file.split("/")[-3])
    if not os.path.exists(out):
        os.makedirs(out)
        mesh = trimesh.load(file, process=False, force="mesh")
        texture = Image.open(os.path.join(os.path.dirname(file), "../materials/textures/texture.png"))
        mesh.visual = trimesh.visual.TextureVisuals(uv=mesh.visual.uv, image=texture)
        mesh.apply_translation(-mesh.bounds.mean(axis=0))
        mesh.export(f"{out}/visual.glb")
        mesh.convex_hull.export(f"{out}/collision.obj")
        with open(f"{out}/object.urdf", "w") as urdf:
            urdf.write(URDF)
    low, high = trimesh.load(f"{out}/collision.obj").bounds
    return {
        "asset_id": os.path.basename(out),
        "render_filename": f"{out}/visual.glb",
        "simulation_filename": f"{out}/object.urdf",
        "bounds": (tuple(low), tuple(high)),
    }


def build(folder: str, scratch: str, seed: int = 0, count: int = 23, views: int = 4) -> tuple:
    """Builds the scene from a folder of Google Scanned Objects, and returns it with its renderer and objects."""
    rng = np.random.RandomState(seed)
    scene = kb.Scene(resolution=(640, 480), frame_start=1, frame_end=views)
    renderer, simulator = Blender(scene, samples_per_pixel=16), PyBullet(scene)

    boxes = [((3, 3, 0.05), (0, 0, -0.05)), ((0.7, 0.4, 0.02), (0, 0, 0.73))]
    boxes += [((3, 0.05, 1.5), (0, y, 1.5)) for y in (-3, 3)] + [((0.05, 3, 1.5), (x, 0, 1.5)) for x in (-3, 3)]
    for scale, position in boxes:
        scene += kb.Cube(scale=scale, position=position, static=True, background=True)

    files = sorted(glob.glob(f"{folder}/*/meshes/model.obj"))
    objects, region = [], [(-0.45, -0.3, 0.8), (0.45, 0.3, 2.2)]
    for number in rng.choice(len(files), count):
        body = kb.FileBasedObject(**convert(files[number], scratch))
        scene += body
        kb.move_until_no_overlap(body, simulator, spawn_region=region, rng=rng)
        objects.append(body)
    simulator.run(frame_start=-96, frame_end=0)
    objects = [body for body in objects if body.position[2] > 0.7]

    scene += kb.RectAreaLight(position=(0, 0, 2.9), look_at=(0, 0, 0), width=1, height=1, intensity=80)
    scene.camera = kb.PerspectiveCamera(focal_length=35, sensor_width=32)
    for frame in range(1, views + 1):
        scene.camera.position = kb.sample_point_in_half_sphere_shell(0.8, 1.3, 0.3, rng=rng) + np.array([0, 0, 0.78])
        scene.camera.look_at((0, 0, 0.78))
        scene.camera.keyframe_insert("position", frame)
        scene.camera.keyframe_insert("quaternion", frame)
    return scene, renderer, objects
