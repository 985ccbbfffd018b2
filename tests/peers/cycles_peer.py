"""The same scene in Blender's Cycles, which reads the exported file itself.

Blender's Python module and Mitsuba bring libraries that do not go together: [`Peer`] starts this file as a program of
its own, which takes jobs as JSON lines and answers each with the seconds that it took.
"""

import importlib.util
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np


def is_there() -> bool:
    """Whether Blender's Python module is installed."""
    return importlib.util.find_spec("bpy") is not None


class Peer:
    """A scene loaded into Cycles."""

    def __init__(self, file: Path, size: tuple[int, int], bounces: int, work: Path):
        job = [sys.executable, __file__, file, *map(str, size), str(bounces)]
        self._process = subprocess.Popen(job, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self._file, self._size = work / "cycles.npy", size
        self.name = f"Cycles {self._answer()['version']}"

    def render(self, samples: int, seed: int, denoise: bool) -> tuple[np.ndarray, float]:
        """Radiance `[height, width, 3]` and the seconds that it took."""
        job = {"samples": samples, "seed": seed, "denoise": denoise, "to": str(self._file)}
        print(json.dumps(job), file=self._process.stdin, flush=True)
        seconds = self._answer()["seconds"]
        return np.load(self._file), seconds

    def close(self) -> None:
        """Ends the program."""
        self._process.stdin.close()
        self._process.wait()

    def _answer(self) -> dict:
        for line in self._process.stdout:
            # Blender talks on the same channel.
            if line.startswith("{"):
                return json.loads(line)
        raise RuntimeError("Blender ended before it answered")


def serve(file: str, width: int, height: int, bounces: int) -> None:
    """Loads a scene and renders each request until the input ends."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=file)
    scene = bpy.context.scene
    scene.camera = next(item for item in scene.objects if item.type == "CAMERA")
    scene.render.engine, scene.render.use_persistent_data = "CYCLES", True
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    cycles = scene.cycles
    cycles.device, cycles.use_adaptive_sampling, cycles.pixel_filter_type = "CPU", False, "BOX"
    for kind in ("max", "diffuse", "glossy", "transmission", "transparent_max"):
        setattr(cycles, f"{kind}_bounces", bounces)
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0
    cycles.denoiser, cycles.denoising_input_passes = "OPENIMAGEDENOISE", "RGB_ALBEDO_NORMAL"
    print(json.dumps({"version": bpy.app.version_string}), flush=True)
    for line in sys.stdin:
        job = json.loads(line)
        cycles.samples, cycles.seed, cycles.use_denoising = job["samples"], job["seed"], job["denoise"]
        start = time.perf_counter()
        bpy.ops.render.render()
        seconds = time.perf_counter() - start
        path = str(Path(job["to"]).with_suffix(".exr"))
        bpy.data.images["Render Result"].save_render(path)
        image = bpy.data.images.load(path)
        texels = np.empty(4 * width * height, np.float32)
        image.pixels.foreach_get(texels)
        bpy.data.images.remove(image)
        # Blender's rows go upwards.
        np.save(job["to"], texels.reshape(height, width, 4)[::-1, :, :3])
        print(json.dumps({"seconds": seconds}), flush=True)


if __name__ == "__main__":
    serve(sys.argv[1], *map(int, sys.argv[2:]))
