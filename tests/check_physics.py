#!/usr/bin/env python3
"""Checks how scenes come to rest, and whether they stay at rest in a second physics engine, MuJoCo.

    python3 tests/check_physics.py scenes RECIPE... [--scenes 200] [--continue 40] [--set KEY=VALUE]...
    python3 tests/check_physics.py poses FILE...
    python3 tests/check_physics.py fill [RECIPE] [--scenes 4]

`scenes` makes the scenes of a recipe with labels alone. It prints, over all scenes:
  objects     objects per scene that stay, and the fraction of placed objects that stay
  penetration the deepest penetration of two bodies, mm
  speed       the largest residual speed, mm/s
  respawned   respawns per scene
  upright     fraction of the objects whose up axis is within 10 degrees of the axis that pointed up when they were put
              down; only with --upright, for recipes that put all objects down with `arrange`
  MuJoCo      fraction of the objects that move less than 5 mm and turn less than 5 degrees while MuJoCo simulates
              one second, with the same convex parts, masses and friction
`poses` compares the stable poses of meshes, as `syntable check --asset` prints them, with the poses of trimesh. Poses of
both that are at most 12 degrees apart are one group. It prints the largest difference of the probabilities of a group.

`fill` pours 60 household objects of 0.7 times their size into a tote, on one thread. It prints the processor seconds per
scene of the program and of PyBullet, which starts the same objects at the same places and times, with the same convex
parts, masses, friction and time step, and ends when no object is faster than 1 cm/s.

The program is `--program`, by default target/release/syntable.
"""

import argparse
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile
import time

import numpy as np

# Limits of "stays" in the second engine.
MAX_SHIFT_M, MAX_TURN_DEG = 0.005, 5.0
# An object that leans more is not upright.
UPRIGHT_DEG = 10.0
# The scenes as the placers leave them.
NO_PHYSICS = ["--set", 'settle={ kind = "none" }']


def sets(options):
    return [argument for value in options.set for argument in ("--set", value)]


def records_of(recipe, options, include, *more):
    """Products of the scenes of a recipe, made with labels alone, and the seconds of each stage."""
    with tempfile.TemporaryDirectory() as folder:
        derived, out = pathlib.Path(folder) / "labels.toml", pathlib.Path(folder) / "dataset"
        plan = subprocess.run([options.program, "plan", recipe] + sets(options), check=True, capture_output=True, text=True)
        writers = sorted(set(re.findall(r"\bwrite\.\w+", plan.stdout)))
        derived.write_text(
            f"extends = {json.dumps(str(pathlib.Path(recipe).resolve()))}\nremove = {json.dumps(writers)}\n"
            f'[write.scenes]\nkind = "jsonl"\ninclude = {json.dumps(include)}\nper = "scene"\n')
        subprocess.run(
            [options.program, "run", derived, "--out", out, "--set", f"dataset.scenes={options.scenes}", "--views", "1",
             *more] + sets(options), check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        stages = json.loads((out / ".syntable/times.jsonl").read_text().splitlines()[0])["stages"]
        records = [json.loads(line) for line in (out / "scenes.jsonl").read_text().splitlines()]
        return records, {name: stage["seconds"] for name, stage in stages.items()}


def rotation_angle(matrix):
    return math.degrees(math.acos(max(-1.0, min(1.0, (np.trace(matrix) - 1) / 2))))


def quaternion(matrix):
    import mujoco
    found = np.zeros(4)
    mujoco.mju_mat2Quat(found, np.ascontiguousarray(matrix).reshape(9))
    return found


def model_of(shapes):
    """The MuJoCo model of a scene, and the bodies that move, by id."""
    import mujoco
    spec = mujoco.MjSpec()
    spec.memory = 1 << 29
    spec.option.timestep = 0.002
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.noslip_iterations = 5
    spec.option.impratio = 10
    moving = []
    for shape in shapes:
        pose = np.array(shape["world_from_body"])
        body = spec.worldbody
        if shape["is_dynamic"]:
            body = spec.worldbody.add_body(pos=pose[:3, 3], quat=quaternion(pose[:3, :3]), name=f"b{shape['id']}")
            body.add_freejoint()
            inertia = np.array(shape["inertia_body_kg_m2"])
            body.explicitinertial = True
            body.mass = shape["mass_kg"]
            body.ipos = shape["center_of_mass_body_m"]
            # Bodies are at least a millimeter thick, as in the program.
            least = shape["mass_kg"] * 1e-6 / 6
            body.fullinertia = [inertia[0, 0] + least, inertia[1, 1] + least, inertia[2, 2] + least,
                                inertia[0, 1], inertia[0, 2], inertia[1, 2]]
            moving.append(shape["id"])
        for number, part in enumerate(shape["parts_body_m"]):
            points = np.array(part)
            if not shape["is_dynamic"]:
                points = points @ pose[:3, :3].T + pose[:3, 3]
            name = f"m{shape['id']}_{number}"
            spec.add_mesh(name=name, uservert=points.flatten(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, friction=[shape["friction"], 0.005, 0.0001],
                          condim=4, solref=[0.005, 1], mass=0)
        for plane in shape["half_spaces_world"]:
            normal = np.array(plane["normal"])
            side = np.cross(normal, [1, 0, 0] if abs(normal[0]) < 0.5 else [0, 1, 0])
            side /= np.linalg.norm(side)
            turn = np.column_stack([side, np.cross(normal, side), normal])
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, pos=plane["point_m"], quat=quaternion(turn),
                                    size=[0, 0, 1], friction=[shape["friction"], 0.005, 0.0001], condim=4)
    return spec.compile(), moving


def stays(shapes, seconds=1.0):
    """Number of moving bodies, and of those that stay while MuJoCo simulates."""
    import mujoco
    model, moving = model_of(shapes)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    before = {id: (data.body(f"b{id}").xpos.copy(), data.body(f"b{id}").xmat.reshape(3, 3).copy()) for id in moving}
    for _ in range(int(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
    kept = 0
    for id, (place, turn) in before.items():
        body = data.body(f"b{id}")
        angle = rotation_angle(turn.T @ body.xmat.reshape(3, 3))
        kept += np.linalg.norm(body.xpos - place) < MAX_SHIFT_M and angle < MAX_TURN_DEG
    return len(moving), kept


def upright(before, after):
    """Number of objects, and of those that are still as upright as they were put down."""
    count = still = 0
    for first, last in zip(before, after):
        objects = [[np.array(body["world_from_body"])[2, :3] for body in record["bodies"] if body["role"] == "object"]
                   for record in (first, last)]
        if len(objects[0]) != len(objects[1]):
            raise SystemExit("objects were removed, so that the scenes cannot be compared")
        count += len(objects[0])
        still += sum(np.dot(a, b) > math.cos(math.radians(UPRIGHT_DEG)) for a, b in zip(*objects))
    return count, still


def check_scenes(options):
    print(f"{'':28} {'objects':>8} {'kept':>7} {'penetration':>12} {'speed':>9} {'respawned':>10} {'upright':>8} {'MuJoCo':>8}")
    for recipe in options.paths:
        records, _ = records_of(recipe, options, ["settle_report", "collision_shapes", "bodies"])
        reports = [record["settle_report"] for record in records]
        kept = sum(report["objects"] for report in reports)
        placed = kept + sum(len(report["removed"]) for report in reports)
        depth = max(report["deepest_penetration_m"] for report in reports)
        speed = max(report["residual_speed_m_s"] for report in reports)
        respawned = sum(report["respawned"] for report in reports)
        counts = [stays(record["collision_shapes"]) for record in records[:options.continued]]
        all_bodies, still = (sum(count) for count in zip(*counts)) if counts else (0, 0)
        stand = "       -"
        if options.upright:
            standing, upright_still = upright(records_of(recipe, options, ["bodies"], *NO_PHYSICS)[0], records)
            stand = f"{upright_still / standing:8.4f}"
        share = f"{still / all_bodies:8.3f}" if all_bodies else "       -"
        print(f"{recipe.stem:28} {kept / len(reports):8.1f} {kept / placed:7.4f} {depth * 1e3:9.2f} mm {speed * 1e3:4.1f} mm/s"
              f" {respawned / len(reports):10.2f} {stand} {share}", flush=True)


def poured(shapes):
    """Processor seconds of PyBullet for the bodies of a scene, number of steps, and the deepest penetration, m."""
    import pybullet
    from scipy.spatial import ConvexHull

    def shape_of(parts):
        if len(parts) == 1:
            return pybullet.createCollisionShape(pybullet.GEOM_MESH, vertices=parts[0].tolist())
        # Each object of the file becomes a convex part.
        with tempfile.NamedTemporaryFile("w", suffix=".obj") as file:
            first = 1
            for number, points in enumerate(parts):
                file.write(f"o part{number}\n")
                file.writelines("v %.7f %.7f %.7f\n" % tuple(point) for point in points)
                file.writelines("f %d %d %d\n" % tuple(face + first) for face in ConvexHull(points).simplices)
                first += len(points)
            file.flush()
            return pybullet.createCollisionShape(pybullet.GEOM_MESH, fileName=file.name)

    def add(mass, shape, friction, place=(0, 0, 0), turn=(0, 0, 0, 1)):
        body = pybullet.createMultiBody(mass, shape, basePosition=place, baseOrientation=turn)
        pybullet.changeDynamics(body, -1, lateralFriction=friction)
        return body

    def top(x, y):
        boxes = [pybullet.getAABB(body) for body in bodies]
        below = [high[2] for low, high in boxes if abs(low[0] + high[0] - 2 * x) < high[0] - low[0] + 0.16
                 and abs(low[1] + high[1] - 2 * y) < high[1] - low[1] + 0.16]
        return max(below, default=0.9)

    pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0, 0, -9.81)
    pybullet.setTimeStep(1 / 240)
    bodies, steps, start = [], 0, time.process_time()
    for shape in shapes:
        pose = np.array(shape["world_from_body"])
        if not shape["is_dynamic"]:
            for part in shape["parts_body_m"]:
                add(0, shape_of([np.array(part) @ pose[:3, :3].T + pose[:3, 3]]), shape["friction"])
            for half_space in shape["half_spaces_world"]:
                plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, planeNormal=half_space["normal"])
                add(0, plane, shape["friction"], half_space["point_m"])
    for shape in filter(lambda shape: shape["is_dynamic"], shapes):
        pose, center = np.array(shape["world_from_body"]), np.array(shape["center_of_mass_body_m"])
        parts = [np.array(part) - center for part in shape["parts_body_m"]]
        x, y, _ = pose[:3, :3] @ center + pose[:3, 3]
        w, *turn = quaternion(pose[:3, :3])
        bodies.append(add(shape["mass_kg"], shape_of(parts), shape["friction"], [x, y, top(x, y) + 0.1], [*turn, w]))
        for _ in range(24):
            pybullet.stepSimulation()
            steps += 1
    for _ in range(1200):
        pybullet.stepSimulation()
        steps += 1
        if steps % 24 == 0 and max(np.linalg.norm(pybullet.getBaseVelocity(body)[0]) for body in bodies) < 0.01:
            break
    seconds = time.process_time() - start
    deepest = max((-contact[8] for contact in pybullet.getContactPoints()), default=0.0)
    pybullet.disconnect()
    return seconds, steps, deepest


def check_fill(options):
    recipe = options.paths[0] if options.paths else pathlib.Path(__file__).parents[1] / "recipes/bin-picking.toml"
    options.set = [
        'assets.bins.families=["tote"]', "assets.bins.height_m=0.3", "place.objects.count=60", "place.objects.fill_level=3.0",
        'assets.objects.families=["apple","ball","banana","block","box","can","cup","jar","mug","sponge","tape","tube"]',
        "assets.objects.scale=0.7",
    ] + options.set
    records, seconds = records_of(recipe, options, ["settle_report"], "--threads", "1")
    reports = [record["settle_report"] for record in records]
    deepest = max(report["deepest_penetration_m"] for report in reports)
    print(f"syntable  {seconds['settle'] / len(reports):6.2f} s per scene of {reports[0]['objects']} objects, "
          f"deepest penetration {deepest * 1e3:.1f} mm", flush=True)
    starts, _ = records_of(recipe, options, ["collision_shapes"], *NO_PHYSICS)
    results = [poured(record["collision_shapes"]) for record in starts]
    print(f"PyBullet  {sum(result[0] for result in results) / len(results):6.2f} s per scene, "
          f"{sum(result[1] for result in results) / len(results):.0f} steps, "
          f"deepest penetration {max(result[2] for result in results) * 1e3:.1f} mm")


def clusters(poses, degrees=12.0):
    """Groups of poses (direction, probability, whose) that are connected by steps of at most some degrees."""
    ups = np.array([pose[0] for pose in poses])
    near = ups @ ups.T > math.cos(math.radians(degrees))
    group = -np.ones(len(poses), dtype=int)
    for first in range(len(poses)):
        if group[first] < 0:
            waiting = [first]
            while waiting:
                at = waiting.pop()
                if group[at] < 0:
                    group[at] = first
                    waiting.extend(np.flatnonzero(near[at] & (group < 0)))
    return [[poses[i] for i in np.flatnonzero(group == number)] for number in sorted(set(group))]


def check_poses(options):
    import trimesh
    worst_of_all = 0.0
    for path in options.paths:
        said = subprocess.run([options.program, "check", "--asset", path], check=True, capture_output=True, text=True).stdout
        line = next(line for line in said.splitlines() if "stable poses" in line)
        number = r"(-?[\d.]+)"
        ours = [(np.array([float(x) for x in match[1:]]), float(match[0]), "ours")
                for match in re.findall(rf"{number} with \({number}, {number}, {number}\) up", line)]
        loaded = trimesh.load(path, force="mesh", process=True)
        center = re.search(rf"center at \({number}, {number}, {number}\)", said)
        transforms, probabilities = trimesh.poses.compute_stable_poses(
            loaded, center_mass=[float(x) for x in center.groups()], threshold=0.0)
        theirs = [(transform[:3, :3].T @ [0, 0, 1], probability, "theirs")
                  for transform, probability in zip(transforms, probabilities)]
        groups = clusters(ours + theirs)
        total = lambda group, whose: sum(probability for _, probability, who in group if who == whose)
        worst = max(abs(total(group, "ours") - total(group, "theirs")) for group in groups)
        worst_of_all = max(worst_of_all, worst)
        name = next((part for part in reversed(path.parts[:-1]) if part not in ("meshes", "google_16k")), path.name)
        print(f"{name[:44]:46} {len(ours):3} and {len(theirs):3} poses in {len(groups):2} groups, "
              f"largest difference {worst:.3f}", flush=True)
    print(f"largest difference of all: {worst_of_all:.3f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("of", choices=["scenes", "poses", "fill"])
    parser.add_argument("paths", nargs="*", type=pathlib.Path)
    parser.add_argument("--scenes", type=int, help="200 by default; 4 for `fill`")
    parser.add_argument("--continue", type=int, default=40, dest="continued", help="scenes that MuJoCo continues")
    parser.add_argument("--upright", action="store_true", help="compare with the scenes before physics")
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("--program", default="target/release/syntable")
    options = parser.parse_intermixed_args()
    options.scenes = options.scenes or (4 if options.of == "fill" else 200)
    {"scenes": check_scenes, "poses": check_poses, "fill": check_fill}[options.of](options)


if __name__ == "__main__":
    sys.exit(main())
