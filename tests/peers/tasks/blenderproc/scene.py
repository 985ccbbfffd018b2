"""Scanned objects fall on a table in a room, and random cameras look at them: the scene of all tasks of BlenderProc."""

import glob
import os

import blenderproc as bproc
import numpy as np


def build(folder: str, seed: int = 0, count: int = 23, views: int = 4) -> list:
    """Builds the scene from a folder of Google Scanned Objects, and returns the objects on the table."""
    np.random.seed(seed)

    floor = bproc.object.create_primitive("PLANE", scale=[3, 3, 1])
    walls = [
        bproc.object.create_primitive("PLANE", scale=[3, 3, 1], location=[x, y, 3], rotation=[a, b, 0])
        for x, y, a, b in [(0, 3, np.pi / 2, 0), (0, -3, -np.pi / 2, 0), (3, 0, 0, -np.pi / 2), (-3, 0, 0, np.pi / 2)]
    ]
    table = bproc.object.create_primitive("CUBE", scale=[0.7, 0.4, 0.02], location=[0, 0, 0.73])
    for body in [floor, *walls, table]:
        material = bproc.material.create("plain")
        material.set_principled_shader_value("Base Color", [*np.random.uniform(0.2, 0.7, 3), 1])
        body.replace_materials(material)
        body.set_cp("category_id", 0)

    objects = []
    files = sorted(glob.glob(f"{folder}/*/meshes/model.obj"))
    for number in np.random.choice(len(files), count):
        body = bproc.loader.load_obj(files[number])[0]
        texture = os.path.join(os.path.dirname(files[number]), "../materials/textures/texture.png")
        body.replace_materials(bproc.material.create_material_from_texture(texture, "scan"))
        body.set_cp("category_id", int(number) + 1)
        objects.append(body)

    def pose(body):
        body.set_location(np.random.uniform([-0.3, -0.18, 0.95], [0.3, 0.18, 1.8]))
        body.set_rotation_euler(bproc.sampler.uniformSO3())

    bproc.object.sample_poses(objects, pose)
    for body in objects:
        body.enable_rigidbody(True, collision_shape="CONVEX_HULL")
    for body in [floor, table]:
        body.enable_rigidbody(False, collision_shape="BOX")
    bproc.object.simulate_physics_and_fix_final_poses(
        min_simulation_time=2, max_simulation_time=6, check_object_interval=1
    )
    for body in objects:
        if body.get_location()[2] < 0.7:
            body.delete()
    objects = [body for body in objects if body.is_valid()]

    light = bproc.types.Light("AREA")
    light.set_location([0, 0, 2.9])
    light.set_energy(80)
    bproc.camera.set_resolution(640, 480)
    center = np.array([0, 0, 0.78])
    for _ in range(views):
        place = bproc.sampler.shell(center, radius_min=0.8, radius_max=1.3, elevation_min=20, elevation_max=80)
        rotation = bproc.camera.rotation_from_forward_vec(center - place)
        bproc.camera.add_camera_pose(bproc.math.build_transformation_mat(place, rotation))
    bproc.renderer.set_max_amount_of_samples(16)
    bproc.renderer.set_denoiser("INTEL")
    return objects
