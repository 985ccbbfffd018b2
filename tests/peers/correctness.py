"""Mean radiance by region: our renderer against Mitsuba."""

from pathlib import Path

import numpy as np
from PIL import Image

import assets
import measures
import ours
from mitsuba_peer import Peer

HERE = Path(__file__).parent
SCENES = ("lamps", "sky")
BOUNCES = 12

# Rough metal is another model there: microfacets that scatter light more than once lose it in Mitsuba, not with us.
OTHER_MODEL = {"objects/copper_ball"}


def compare(binary: Path, work: Path, views: int, samples: int) -> tuple[str, Image.Image, bool]:
    """The table, the pictures side by side, and whether all regions agree."""
    assets.write(work / "assets")
    lines, rows, agree = [], [], True
    for name in SCENES:
        settings = [f"dataset.views_per_scene={views}", f"render.samples_per_pixel={samples}"]
        settings += [f"render.max_bounces={BOUNCES}"]
        run = ours.run(binary, HERE / f"{name}.toml", work / name, settings, {"PEERS": work / "assets"})
        peer = Peer(run.scene(), BOUNCES)
        theirs = np.stack([peer.render(samples, seed)[0] for seed in range(views)])
        mine = run.pictures()
        regions = list(_regions(run, mine, theirs))
        agree &= all(abs(r.difference()) <= r.allowed() for r in regions if r.name not in OTHER_MODEL)
        lines += _table(name, regions, mine, theirs, views * samples)
        rows.append(_side_by_side(mine.mean(0), theirs.mean(0)))
    return "\n".join(lines), Image.fromarray(np.vstack(rows)), agree


def _regions(run: ours.Run, mine: np.ndarray, theirs: np.ndarray):
    """Every body, what lies beyond the tray, and the picture in twelve."""
    instances, bodies = run.instances(), run.scene().bodies
    names = {body.instance: body.name.split(" ", 1)[1] for body in bodies if body.instance is not None}
    for instance in np.unique(instances):
        mask = instances == instance
        if theirs[:, mask].mean() > 0.01 * theirs.mean():
            yield measures.region(names.get(instance, "background"), mask, mine, theirs)
    height, width = instances.shape
    y, x = np.mgrid[0:height, 0:width]
    for row in range(3):
        for column in range(4):
            mask = (y * 3 // height == row) & (x * 4 // width == column) & np.isin(instances, list(names))
            if mask.sum() > 1000:
                yield measures.region(f"row {row + 1}, column {column + 1} of the tray", mask, mine, theirs)


def _table(name: str, regions: list[measures.Region], mine, theirs, samples: int) -> list[str]:
    a, b = mine.mean(0), theirs.mean(0)
    noise = (_variance(mine) + _variance(theirs)) / (b**2 + (0.01 * b.mean()) ** 2)
    flip = measures.flip(a, b)
    lines = [f"`{name}.toml`, {samples} samples a pixel:", ""]
    lines += ["| region | pixels | ours, nits | Mitsuba, nits | difference | standard error |", "|---|---|---|---|---|---|"]
    for r in regions:
        mark = " ¹" if r.name in OTHER_MODEL else ""
        lines.append(
            f"| {r.name.removeprefix('objects/').removeprefix('trays/').replace('_', ' ')}{mark} | {r.pixels} "
            f"| {r.ours:.2f} | {r.theirs:.2f} | {100 * r.difference():+.2f} % | {100 * r.sigma / r.theirs:.2f} % |"
        )
    lines += ["", f"relMSE {measures.rel_mse(a, b):.5f}, of which noise {noise.mean():.5f}"]
    lines[-1] += f"; mean FLIP {flip:.4f}.\n" if flip is not None else ".\n"
    return lines


def _variance(pictures: np.ndarray) -> np.ndarray:
    """Of the mean of independent pictures."""
    return pictures.var(0, ddof=1) / len(pictures)


def _side_by_side(mine: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """Ours, theirs, and the relative difference of blocks of 4 × 4 pixels: grey is none, in white and black ours is 10 %
    brighter and darker.
    """
    a, b = (_blocks(picture @ measures.LUMINANCE) for picture in (mine, theirs))
    grey = np.repeat(np.clip(0.5 + 5 * (a - b) / (b + 0.01 * theirs.mean()), 0, 1)[..., None], 3, -1)
    panels = [measures.developed(mine, theirs), measures.developed(theirs, theirs), grey]
    return np.uint8(np.round(255 * np.hstack(panels)))


def _blocks(plane: np.ndarray, edge: int = 4) -> np.ndarray:
    """Every pixel replaced by the mean of its block."""
    height, width = plane.shape
    means = plane.reshape(height // edge, edge, width // edge, edge).mean((1, 3))
    return means.repeat(edge, 0).repeat(edge, 1)
