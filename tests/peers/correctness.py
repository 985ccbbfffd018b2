"""Mean radiance by region: our renderer against Mitsuba."""

from pathlib import Path

import numpy as np
from PIL import Image

import assets
import cycles_peer
import glb
import measures
import ours
from mitsuba_peer import Peer

HERE = Path(__file__).parent
BOUNCES = 12
# Smaller regions are left out.
PIXELS = 60

# The scenes: whether their materials are translated by gltf_bsdf.py rather than to Mitsuba's own, and the largest
# difference of regions. At home, surfaces of another model there light all others.
SCENES = {"lights": (False, 0.01), "sky": (False, 0.01), "home": (True, 0.02)}

# What is another model there, so that such regions need not agree.
OTHER = {
    "¹": "Rough metal: what Mitsuba loses of the light that microfacets scatter more than once, we keep.",
    "²": "Bumps: ours are filtered over the pixel, Mitsuba's are not.",
    "³": "A clear coat, which gltf_bsdf.py does not have.",
    "⁴": "Glass that absorbs, which Mitsuba's `dielectric` does not.",
}


def compare(binary: Path, work: Path, views: int, samples: int) -> tuple[str, Image.Image, bool]:
    """The tables, the images side by side, and whether all regions agree."""
    assets.write(work / "assets")
    lines, rows, agree = [], [], True
    for name, (exact, tolerance) in SCENES.items():
        settings = [f"dataset.views_per_scene={views}", f"render.samples_per_pixel={samples}"]
        settings += [f"render.max_bounces={BOUNCES}"]
        run = ours.run(binary, HERE / f"{name}.toml", work / name, settings, {"PEERS": work / "assets"})
        scene, mine = run.scene(), run.images()
        peer = Peer(scene, BOUNCES, exact)
        theirs = np.stack([peer.render(samples, seed)[0] for seed in range(views)])
        masks = list(_bodies(scene, run.instances(), theirs, exact))
        if not exact:
            masks += _cells(run.instances())
        regions = [measures.region(name, mask, mine, theirs) for name, mask in masks]
        agree &= all(r.agrees(tolerance) for r in regions if r.name[-1] not in OTHER)
        third = _cycles(run.folder, scene, samples, max(views // 3, 2), work)
        thirds = [measures.region(name, mask, mine, third) for name, mask in masks] if third is not None else []
        lines += _table(f"`{name}.toml`, {views * samples} samples per pixel:", regions, thirds)
        lines += _whole(mine, theirs)
        rows.append(_side_by_side(mine.mean(0), theirs.mean(0)))
    lines += [f"{mark} {text}\n" for mark, text in OTHER.items()]
    return "\n".join(lines), Image.fromarray(np.vstack(rows)), agree


def _cycles(folder: Path, scene: glb.Scene, samples: int, images: int, work: Path) -> np.ndarray | None:
    """Images of Cycles, if it is there; glTF has no environment maps for it."""
    if scene.environments or not cycles_peer.is_there():
        return None
    size = scene.camera.width, scene.camera.height
    peer = cycles_peer.Peer(folder / "gltf" / "000000.glb", size, BOUNCES, work)
    made = [peer.render(samples, seed, denoise=False)[0] for seed in range(images)]
    peer.close()
    return np.stack(made)


def _bodies(scene: glb.Scene, instances: np.ndarray, theirs: np.ndarray, exact: bool):
    """Every body and the background, unless small or dark."""
    bodies = {body.instance: body for body in scene.bodies if body.instance is not None}
    for instance in np.unique(instances):
        mask = instances == instance
        if mask.sum() < PIXELS or theirs[:, mask].mean() < 0.02 * theirs.mean():
            continue
        name = "background"
        if body := bodies.get(instance):
            name = body.name.split("/", 1)[1].replace("_", " ")
            marks = sorted({_other(part.material, exact) for part in body.parts} - {""})
            name += f" {''.join(marks)}" if marks else ""
        yield name, mask


def _other(material: dict, exact: bool) -> str:
    """The mark of what is another model in Mitsuba."""
    extensions, pbr = material.get("extensions", {}), material["pbrMetallicRoughness"]
    if "normalTexture" in material:
        return "²"
    if "KHR_materials_clearcoat" in extensions:
        return "³"
    if "attenuationDistance" in extensions.get("KHR_materials_volume", {}):
        return "⁴"
    metal = pbr.get("metallicFactor", 1.0) == 1 and pbr.get("roughnessFactor", 1.0) > 0.2
    return "¹" if metal and not exact else ""


def _cells(instances: np.ndarray):
    """The image in twelve, without the background."""
    height, width = instances.shape
    y, x = np.mgrid[0:height, 0:width]
    for row in range(3):
        for column in range(4):
            mask = (y * 3 // height == row) & (x * 4 // width == column) & (instances > 0)
            if mask.sum() > 1000:
                yield f"row {row + 1}, column {column + 1}", mask


def _table(title: str, regions: list[measures.Region], thirds: list[measures.Region]) -> list[str]:
    """Differences with their standard errors; those from Cycles are not judged."""
    head = ["region", "pixels", "ours, nits", "Mitsuba, nits", "difference"] + (["from Cycles"] if thirds else [])
    lines = [title, "", f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for i, r in enumerate(regions):
        cells = [r.name, f"{r.pixels}", f"{r.ours:.2f}", f"{r.theirs:.2f}", _difference(r)]
        cells += [_difference(thirds[i])] if thirds else []
        lines.append(f"| {' | '.join(cells)} |")
    return [*lines, ""]


def _difference(r: measures.Region) -> str:
    return f"{100 * r.difference():+.2f} % ± {100 * r.sigma / r.theirs:.2f}"


def _whole(mine: np.ndarray, theirs: np.ndarray) -> list[str]:
    """Errors of the whole image."""
    a, b = mine.mean(0), theirs.mean(0)
    noise = (_variance(mine) + _variance(theirs)) / (b**2 + (0.01 * b.mean()) ** 2)
    flip = measures.flip(a, b)
    suffix = f"; mean FLIP {flip:.4f}" if flip is not None else ""
    return [f"Ours and Mitsuba's: relMSE {measures.rel_mse(a, b):.5f}, of which noise {noise.mean():.5f}{suffix}.", ""]


def _variance(images: np.ndarray) -> np.ndarray:
    """Of the mean of independent images."""
    return images.var(0, ddof=1) / len(images)


def _side_by_side(mine: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """Ours, theirs, and the relative difference of blocks of 4 × 4 pixels: gray is none, in white and black ours is
    10 % brighter and darker.
    """
    a, b = (_blocks(image @ measures.LUMINANCE) for image in (mine, theirs))
    gray = np.repeat(np.clip(0.5 + 5 * (a - b) / (b + 0.01 * theirs.mean()), 0, 1)[..., None], 3, -1)
    panels = [measures.developed(mine, theirs), measures.developed(theirs, theirs), gray]
    return np.uint8(np.round(255 * np.hstack(panels)))


def _blocks(plane: np.ndarray, edge: int = 4) -> np.ndarray:
    """Every pixel replaced by the mean of its block."""
    height, width = plane.shape
    means = plane.reshape(height // edge, edge, width // edge, edge).mean((1, 3))
    return means.repeat(edge, 0).repeat(edge, 1)
