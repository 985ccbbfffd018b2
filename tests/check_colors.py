#!/usr/bin/env python3
"""Compares the colors that files state, as found by hand, with what trimesh reads.

    check_colors.py CASES.json

Each case names a file beside the list and gives the linear color and the opacity of every corner of its faces. Where trimesh
reads something else, `DIFFERS` says why the value by hand counts; a file that trimesh starts to read right fails, too, so
that the list stays true.
"""

import json
import pathlib
import sys

import numpy as np
import trimesh

# What trimesh leaves out or reads in another way, by the name of the file.
DIFFERS = {
    "obj_bytes": "colors up to 255 are cut at 1",
    "obj_one_without": "colors of some vertices alone are not read",
    "obj_nan": "NaN becomes 0",
    "obj_alpha": "the seventh number of a vertex is not read",
    "obj_polypaint": "comments of ZBrush are not read",
    "mtl_black_map": "the texture is multiplied by a black `Kd`",
    "mtl_linear_map": "`-colorspace` becomes a part of the file name",
    "mtl_spectral": "another gray for a color that is not read",
    "mtl_kd_bytes": "`Kd` up to 255 is cut at 1",
    "mtl_without_usemtl": "faces without `usemtl` have no material",
    "mtl_dissolve": "`d` is not read",
    "ply_short_names": "`r`, `g`, `b` are not read",
    "ply_diffuse": "`diffuse_red` is not read",
    "ply_float_bytes": "floats up to 255 are cut at 1",
    "ply_nan": "NaN becomes 0",
    "ply_alpha_zero": "alpha 0 everywhere is invisible",
    "ply_red_alone": "no color has no value there",
    **{
        name: "packed `rgb` is not read"
        for name in (
            "ply_rgb_uint ply_rgb_double ply_rgb_float ply_rgb_filled ply_rgb_int ply_rgb_bits ply_rgb_bits_double ply_rgb_nan"
            " ply_rgba ply_rgb_face ply_rgb_float_little ply_rgb_uint_little ply_rgba_float_little"
            " ply_rgb_float_big ply_rgb_uint_big ply_rgba_float_big"
        ).split()
    },
    "ply_wedge": "colors of corners are not read",
    "ply_texnumber": "one texture is read",
    "stl_viscam": "colors of STL are not read",
    "stl_viscam_without": "colors of STL are not read",
    "stl_magics": "colors of STL are not read",
    "stl_magics_part": "colors of STL are not read",
    "stl_magics_zeros": "colors of STL are not read",
    "stl_magics_material": "colors of STL are not read",
    "stl_magics_alpha": "colors of STL are not read",
    "stl_text_part": "colors of STL are not read",
    "stl_text": "colors of STL are not read",
    "stl_plain": "no color has no value there",
    "stl_attributes": "no color has no value there",
    "gltf_float3": "COLOR_0 is not read beside a material",
    "gltf_float4": "COLOR_0 is not read beside a material",
    "gltf_factor_and_colors": "COLOR_0 is not read beside a material",
    "gltf_alpha_blend": "COLOR_0 is not read beside a material",
    "gltf_alpha_opaque": "COLOR_0 is not read beside a material",
    "gltf_nothing": "the default material of the standard has no value there",
    "gltf_u16": "16-bit words lose their high bits",
    "gltf_texture_transform": "KHR_texture_transform is not read",
}


# Color of a material without one, in trimesh.
GRAY = np.array([0.4, 0.4, 0.4, 1.0])


def linear(encoded):
    """Linear light of sRGB-encoded fractions (IEC 61966-2-1)."""
    encoded = np.asarray(encoded, dtype=float)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def texels(image, uv):
    """Nearest texels of an image as fractions, v up."""
    pixels = np.asarray(image.convert("RGBA"), dtype=float) / 255
    height, width = pixels.shape[:2]
    x = np.clip((uv[:, 0] * width).astype(int), 0, width - 1)
    y = np.clip(((1 - uv[:, 1]) * height).astype(int), 0, height - 1)
    return pixels[y, x]


def corners_of(mesh, is_gltf):
    """Linear colors and opacities [F, 3, 4] of the corners of a mesh; none if it states no color."""
    visual, faces = mesh.visual, mesh.faces
    # Numbers of glTF are linear, and so is `Kd`; images and colors of other files are display colors.
    decode = (lambda rgba: rgba) if is_gltf else (lambda rgba: np.c_[linear(rgba[:, :3]), rgba[:, 3]])
    by_vertex = None
    if visual.kind == "texture":
        material = visual.material
        image = getattr(material, "baseColorTexture", None) if is_gltf else getattr(material, "image", None)
        factor = getattr(material, "baseColorFactor", None) if is_gltf else getattr(material, "diffuse", None)
        factor = np.ones(4) if factor is None else np.asarray(factor, dtype=float) / 255
        if image is not None and not is_gltf and np.allclose(factor, GRAY):
            factor = np.ones(4)
        color = np.tile(factor, (len(mesh.vertices), 1))
        by_attribute = mesh.vertex_attributes.get("color")
        if image is not None and visual.uv is not None:
            texel = texels(image, visual.uv)
            color = color * np.c_[linear(texel[:, :3]), texel[:, 3]]
        elif by_attribute is not None:
            by_attribute = np.asarray(by_attribute, dtype=float)
            full = np.ones((len(by_attribute), 4 - by_attribute.shape[1]))
            color = decode(np.c_[by_attribute / (255 if by_attribute.max() > 1 else 1), full])
        by_vertex = color
    elif visual.kind == "vertex":
        by_vertex = decode(np.asarray(visual.vertex_colors, dtype=float) / 255)
    elif visual.kind == "face":
        by_face = decode(np.asarray(visual.face_colors, dtype=float) / 255)
        return np.repeat(by_face[:, None], 3, axis=1)
    return None if by_vertex is None else by_vertex[faces]


def read(path):
    """Positions [F, 3, 3] and colors [F, 3, 4] of all corners, as trimesh has them."""
    is_gltf = path.suffix == ".gltf"
    loaded = trimesh.load(path, process=False)
    meshes = loaded.dump() if isinstance(loaded, trimesh.Scene) else [loaded]
    positions, colors = [], []
    for mesh in meshes:
        found = corners_of(mesh, is_gltf)
        if found is None:
            return None
        positions.append(mesh.triangles)
        colors.append(found)
    return np.concatenate(positions), np.concatenate(colors)


def check(folder, case):
    """Nothing if trimesh reads a case as it is by hand, else what differs."""
    try:
        found = read(folder / case["file"])
    except Exception as error:  # trimesh raises all kinds
        return f"raises {type(error).__name__}: {error}"
    if found is None:
        return "no color"
    positions, colors = found
    vertices = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
    numbers = np.linalg.norm(positions[:, :, None] - vertices, axis=-1).argmin(axis=-1)
    known = {(frozenset(face.tolist()), int(v)): c for face, cs in zip(numbers, colors) for v, c in zip(face, cs)}
    for corner in case["corners"]:
        want = np.array(corner["color"])
        got = known.get((frozenset(corner["face"]), corner["vertex"]))
        # trimesh rounds factors to bytes.
        if got is None or np.abs(got - want).max() > 0.6 / 255:
            return f"{None if got is None else got.round(3).tolist()}, not {want.round(3).tolist()}"
    return None


cases_file = pathlib.Path(sys.argv[1])
cases = json.loads(cases_file.read_text())
wrong = []
equal = 0
for case in cases:
    said = check(cases_file.parent, case)
    differs = DIFFERS.get(case["file"].split(".")[0])
    if said is None and differs is None:
        equal += 1
    elif said is not None and differs is None:
        wrong.append(f"{case['file']}: trimesh {said}")
    elif said is None:
        wrong.append(f"{case['file']}: trimesh agrees, but is listed: {differs}")
unknown = set(DIFFERS) - {case["file"].split(".")[0] for case in cases}
assert not unknown, f"listed, but no case: {sorted(unknown)}"
assert not wrong, f"{len(wrong)} of {len(cases)} are wrong:\n" + "\n".join(wrong)
print(f"{equal} of {len(cases)} colors agree with trimesh {trimesh.__version__}; {len(DIFFERS)} by hand alone")
