"""Runs of our own renderer."""

import json
import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import glb


@dataclass
class Run:
    """What a run made of one scene."""

    folder: Path
    #: From the start of the program to the end of the last image, s.
    seconds: float

    def scene(self) -> glb.Scene:
        """The exported scene."""
        return glb.read(self.folder / "gltf" / "000000.glb")

    def images(self) -> np.ndarray:
        """Radiance of all views, `[views, height, width, 3]`."""
        return np.stack([np.load(path) for path in sorted((self.folder / "npy" / "radiance").glob("*.npy"))])

    def instances(self) -> np.ndarray:
        """Instance ids of the first view."""
        return np.load(self.folder / "npy" / "instance" / "000000_0000.npy")


def run(binary: Path, recipe: Path, out: Path, settings: list[str], folders: dict[str, Path]) -> Run:
    """Runs a recipe."""
    command = [binary, "--log-format", "json", "run", recipe, "--out", out, "--overwrite"]
    for setting in settings:
        command += ["--set", setting]
    environment = os.environ | {name: str(path) for name, path in folders.items()}
    done = subprocess.run(command, env=environment, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    # Drivers may print lines of their own.
    events = [json.loads(line) for line in done.stderr.splitlines() if line.startswith("{")]
    if done.returncode:
        raise SystemExit("\n".join(event.get("message", str(event)) for event in events))
    ends = [event["elapsed_s"] for event in events if event.get("event") == "image"]
    return Run(out, max(ends))
