"""Scenes from seeds, each in a process: `08_repeat_and_continue.py FOLDER_OF_MESHES OUT`.

The second call skips finished scenes.
"""

import pathlib
import shutil
import subprocess
import sys

for seed in range(2):
    out = pathlib.Path(sys.argv[2]) / str(seed)
    if not (out / "coco_annotations.json").exists():
        shutil.rmtree(out, ignore_errors=True)
        script = pathlib.Path(__file__).parent / "01_first_images.py"
        subprocess.run([sys.executable, script, sys.argv[1], out, str(seed)], check=True)
