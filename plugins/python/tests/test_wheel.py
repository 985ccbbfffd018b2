"""The installed wheel makes the files of the Rust program."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import syntable as st

PROGRAM = os.environ.get("SYNTABLE_PROGRAM")
"""The Rust program. Set by `.ci/python`."""

SETTINGS = [] if os.environ.get("SYNTABLE_WHOLE") else ["--set", "render.samples_per_pixel=2"]
"""With few samples the four images take seconds. `.ci/nightly` makes the whole quickstart."""


def files(folder: Path) -> dict[str, bytes]:
    """Every file by its path, without the times of the run."""
    found = {str(path.relative_to(folder)): path for path in sorted(folder.rglob("*")) if path.is_file()}
    return {name: path.read_bytes() for name, path in found.items() if not name.endswith(("times.jsonl", "lock"))}


@pytest.mark.skipif(PROGRAM is None, reason="SYNTABLE_PROGRAM does not name the Rust program")
def test_the_command_of_the_wheel_makes_the_files_of_the_program(tmp_path):
    assert PROGRAM is not None
    command = Path(sys.executable).with_name("syntable")
    for name, program in [("wheel", [str(command)]), ("program", [PROGRAM])]:
        subprocess.run([*program, "run", "--out", str(tmp_path / name), *SETTINGS], check=True)
    made, expected = files(tmp_path / "wheel"), files(tmp_path / "program")
    assert made.keys() == expected.keys() and len([name for name in made if name.endswith(".png")]) >= 4
    assert [name for name in made if made[name] != expected[name]] == []
    assert len(st.open(tmp_path / "wheel")) == 4


def test_the_import_needs_numpy_alone():
    code = "import sys, syntable; print(*sorted({name.split('.')[0] for name in sys.modules} - set(sys.stdlib_module_names)))"
    said = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    others = {name for name in said.split() if not name.startswith("_")} - {"syntable", "numpy", "sitecustomize"}
    assert others <= {"cython_runtime"}, others
