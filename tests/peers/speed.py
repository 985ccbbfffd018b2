"""Times and errors of images of few samples."""

import subprocess
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

import cycles_peer
import measures
import oidn_peer
import ours
from mitsuba_peer import VARIANT, Peer

RECIPE = Path(__file__).parent / "room.toml"
BOUNCES = 8
# Samples per pixel: without denoiser, with one, and in Cycles, whose samples take longest.
PLAIN, DENOISED, SLOW = (1, 2, 4, 8, 16, 32, 64), (1, 2, 4, 8, 16), (1, 2, 4, 8)
REPEATS = 2
# Views of our runs whose time is measured.
VIEWS = 4
AIMS = (35.0, 39.0)
# Samples of the albedo and the normals that Mitsuba gives to the denoiser; their time counts.
GUIDE_SAMPLES = 8
# Mitsuba holds all samples of a pass in memory: the processor's, or the card's.
PASS = 64 if "cuda" in VARIANT else 16


@dataclass
class Row:
    """One line of the table."""

    how: str
    samples: int
    seconds: float
    psnr: float
    rel_mse: float


def compare(binary: Path, work: Path, assets: Path | None, patience: float, kind: str) -> str:
    """The table of times and errors, and the times at which the aims are reached. `patience` is how many seconds a
    converged image may take, `kind` our renderer.
    """
    settings = [f"assets.objects={{ kind = 'google_scanned_objects', root = '{assets / 'gso'}' }}"] if assets else []
    settings.append(f"render.kind='{kind}'")
    run = _Ours(binary, work, settings)
    scene = run.scene()
    rows, floors = list(run.rows(patience)), [("ours", run.floor)]
    mitsuba = _Mitsuba(Peer(scene, BOUNCES), patience)
    rows += mitsuba.rows()
    floors.append((mitsuba.name, mitsuba.reference.floor()))
    if cycles_peer.is_there():
        size = scene.camera.width, scene.camera.height
        cycles = _Cycles(cycles_peer.Peer(work / "room" / "gltf" / "000000.glb", size, BOUNCES, work), patience)
        rows += cycles.rows()
        floors.append((cycles.name, cycles.reference.floor()))
    objects = "scanned" if assets else "embedded"
    lines = [f"20 {objects} objects, {scene.triangles():,} triangles, 640 × 480, {BOUNCES} bounces:", ""]
    labels = f"All labels of a view (depth, ids, masks with their runs, occlusion order), ours: {run.labels():.3f} s."
    frames = [""] + run.annotated(rows)
    return "\n".join(lines + _table(rows) + [""] + _aims(rows) + ["", labels] + frames + [""] + _floors(floors))


def _table(rows: list[Row]) -> list[str]:
    lines = ["| renderer | samples | seconds | PSNR, dB | relMSE |", "|---|---|---|---|---|"]
    numbers = lambda r: f"| {r.how} | {r.samples} | {r.seconds:.3g} | {r.psnr:.1f} | {r.rel_mse:.4f} |"
    return lines + [numbers(row) for row in rows]


def _aims(rows: list[Row]) -> list[str]:
    head = " | ".join(f"{aim:.0f} dB after" for aim in AIMS)
    lines = [f"| renderer | {head} |", "|---|" + "---|" * len(AIMS)]
    for how, group in groupby(rows, key=lambda row: row.how):
        group = list(group)
        lines.append(f"| {how} | " + " | ".join(reached(group, aim) for aim in AIMS) + " |")
    return lines


def reached(rows: list[Row], aim: float) -> str:
    """When an image reaches a quality, between the rows in proportion to the logarithm of time."""
    if rows[0].psnr >= aim:
        return f"at most {rows[0].seconds:.3g} s"
    for low, high in zip(rows, rows[1:]):
        if high.psnr >= aim:
            part = (aim - low.psnr) / (high.psnr - low.psnr)
            return f"{low.seconds * (high.seconds / low.seconds) ** part:.3g} s"
    return f"more than {rows[-1].seconds:.3g} s"


def _floors(floors: list[tuple[str, float]]) -> list[str]:
    listed = ", ".join(f"{name} {floor:.1f} dB" for name, floor in floors)
    return [f"Noise left in the converged images, subtracted from the errors: {listed}."]


def _row(how: str, samples: int, reference: measures.Reference, images: list, seconds: float) -> Row:
    """Errors are means over repetitions."""
    psnr = float(np.mean([reference.psnr(image) for image in images]))
    error = float(np.mean([reference.rel_mse(image) for image in images]))
    return Row(how, samples, seconds, psnr, error)


def _fastest(how: str, samples: int, reference: measures.Reference, made: list[tuple[np.ndarray, float]]) -> Row:
    """The row of images that were made one by one, with the least of their times."""
    images, seconds = zip(*made)
    return _row(how, samples, reference, list(images), min(seconds))


class _Ours:
    """Our renderer, through the program."""

    def __init__(self, binary: Path, work: Path, settings: list[str]):
        self._binary, self._out = binary, work / "room"
        self._settings = [*settings, f"render.max_bounces={BOUNCES}"]
        self.floor = 0.0

    def _run(self, views: int, *settings: str) -> ours.Run:
        settings = [*self._settings, f"dataset.views_per_scene={views}", *settings]
        return ours.run(self._binary, RECIPE, self._out, settings, {})

    def _timed(self, *settings: str) -> tuple[ours.Run, float]:
        """A run, and the seconds that a view takes, with all that the program does for it: the difference to a run of one
        view, which loads and settles the same scene. Views are rendered and denoised at the same time, so the time
        from one image's end to the next is no image's time.
        """
        one = self._run(1, *settings)
        run = self._run(1 + VIEWS, *settings)
        return run, (run.seconds - one.seconds) / VIEWS

    def scene(self):
        """The scene as it goes to the others."""
        return self._run(1, "render.samples_per_pixel=1").scene()

    def labels(self) -> float:
        """Seconds for all labels of a view, without an image."""
        arrays, masks = ["depth", "instance", "occlusion_order"], ["visible_mask", "amodal_mask", "occlusion_mask"]
        _, seconds = self._timed(f"write.npy.include={arrays}", f"write.jsonl.include={masks + ['occlusion_rate']}")
        return seconds

    def annotated(self, rows: list[Row]) -> list[str]:
        """Seconds for whole annotated frames: images that reach the first aim, and everything of the `syntable` writer."""
        lines = []
        for how, denoise in self._denoisers().items():
            enough = [row for row in rows if row.how == how and row.psnr >= AIMS[0]]
            if enough:
                n = enough[0].samples
                _, seconds = self._timed(f"render.samples_per_pixel={n}", *denoise, "write.syntable={}")
                lines.append(f"{how}, {n} samples, {enough[0].psnr:.1f} dB: {seconds:.2f} s")
        every = "depth, masks of all kinds with their runs, occlusion order and JSON written"
        return [f"A whole annotated frame, image, {every}: {'; '.join(lines)}."] if lines else []

    def _denoisers(self) -> dict[str, list[str]]:
        listed = subprocess.run([self._binary, "list"], capture_output=True, text=True, check=True).stdout
        kinds = {line.split()[1] for line in listed.splitlines() if line.startswith("denoise ")}
        found, library = {"ours": []}, oidn_peer.library()
        if "guided" in kinds:
            found["ours, guided"] = ["denoise.kind='guided'"]
        if "oidn" in kinds and library:
            found["ours + OIDN"] = ["denoise.kind='oidn'", f"denoise.library='{library}'"]
        return found

    def rows(self, patience: float):
        half = f"render.time_s={patience / 2}"
        reference = measures.Reference(tuple(self._run(2, "render.samples_per_pixel=65536", half).images()))
        self.floor = reference.floor()
        for how, denoise in self._denoisers().items():
            for n in DENOISED if denoise else PLAIN:
                run, seconds = self._timed(f"render.samples_per_pixel={n}", *denoise)
                yield _row(how, n, reference, list(run.images()), seconds)


class _Mitsuba:
    """Mitsuba, with and without Open Image Denoise."""

    def __init__(self, peer: Peer, patience: float):
        self._peer, self.name = peer, peer.name
        halves, spent, seed = [[], []], 0.0, 1 << 20
        peer.render(PASS, seed)
        while spent < patience or not halves[1]:
            image, seconds = peer.render(PASS, seed + 1)
            halves[seed % 2].append(image)
            seed, spent = seed + 1, spent + seconds
        self.reference = measures.Reference(tuple(np.mean(half, 0) for half in halves))

    def _render(self, samples: int, seed: int) -> tuple[np.ndarray, float]:
        passes = [self._peer.render(min(samples, PASS), 64 * seed + i) for i in range(max(samples // PASS, 1))]
        return np.mean([image for image, _ in passes], 0), sum(seconds for _, seconds in passes)

    def rows(self) -> list[Row]:
        plain, denoised = [], []
        path = oidn_peer.library()
        denoiser = oidn_peer.Denoiser(path, *self.reference.mean().shape[:2]) if path else None
        self._peer.guides(GUIDE_SAMPLES, 0)
        for n in PLAIN:
            # The first one compiles.
            made = [self._render(n, seed) for seed in range(REPEATS + 1)][1:]
            plain.append(_fastest(self.name, n, self.reference, made))
            if denoiser and n in DENOISED:
                made = [self._denoise(denoiser, image, seconds) for image, seconds in made]
                denoised.append(_fastest(f"{self.name} + OIDN", n, self.reference, made))
        return plain + denoised

    def _denoise(self, denoiser, image: np.ndarray, seconds: float) -> tuple[np.ndarray, float]:
        guides, more = self._peer.guides(GUIDE_SAMPLES, 1)
        result, own = denoiser.denoise(image, guides)
        return result, seconds + more + own


class _Cycles:
    """Cycles, with and without its own use of Open Image Denoise."""

    def __init__(self, peer: cycles_peer.Peer, patience: float):
        self._peer, self.name = peer, peer.name
        peer.render(1, 0, denoise=True)
        _, seconds = peer.render(4, 0, denoise=False)
        samples = max(int(4 * patience / 2 / seconds), 4)
        self.reference = measures.Reference(tuple(peer.render(samples, seed, False)[0] for seed in (101, 102)))

    def rows(self) -> list[Row]:
        rows = []
        for how, denoise in ((self.name, False), (f"{self.name} + OIDN", True)):
            for n in SLOW:
                made = [self._peer.render(n, seed, denoise) for seed in range(1, REPEATS + 1)]
                rows.append(_fastest(how, n, self.reference, made))
        self._peer.close()
        return rows
