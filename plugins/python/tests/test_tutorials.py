"""The tutorials: each script runs in an empty folder and gives the right result; the notebook runs, its page agrees."""

from __future__ import annotations

import importlib.util
import json
import os
import pathlib
import re
import struct
import subprocess
import sys
import textwrap
import zlib

import numpy as np
import pytest

import syntable as st

ROOT = pathlib.Path(__file__).resolve().parents[3]
EXAMPLES = ROOT / "plugins" / "python" / "examples"
PAGE = (ROOT / "book" / "src" / "tutorials.md").read_text(encoding="utf-8")
SIZE = ["--size", "96", "72"]


def run(script: str, folder: pathlib.Path, *arguments: object) -> str:
    """What a script prints in a folder of the user."""
    command = [sys.executable, str(EXAMPLES / script), *map(str, arguments)]
    # The package is found from any folder, also where PYTHONPATH has a relative path.
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path), "PYTHONUTF8": "1"}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, encoding="utf-8", timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


def module(path: pathlib.Path):
    """A script as a module, without its `main`."""
    spec = importlib.util.spec_from_file_location(f"tutorial_{path.stem}", path)
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def masked(text: str) -> str:
    """A text without what depends on pixels: numbers, names of assets, widths of columns."""
    return re.sub(r" +", " ", re.sub(r"\w+_\d{4}|\d+(\.\d+)?", "#", text))


def check_page(script: str, printed: str) -> None:
    """The book shows lines that the script prints, with other numbers."""
    (shown,) = re.findall(rf"^\$ python {script}\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    lines = [line for line in masked(shown).splitlines() if line not in ("", "…")]
    assert lines and not set(lines) - set(masked(printed).splitlines()), script


def pixels(png: bytes) -> np.ndarray:
    """Pixels of a PNG file of three channels without filters, as the package writes it."""
    assert png.startswith(b"\x89PNG\r\n\x1a\n")
    (width, height), data, place = struct.unpack(">II", png[16:24]), b"", 8
    while place < len(png):
        (length,) = struct.unpack(">I", png[place : place + 4])
        data += png[place + 8 : place + 8 + length] if png[place + 4 : place + 8] == b"IDAT" else b""
        place += 12 + length
    rows = np.frombuffer(zlib.decompress(data), np.uint8).reshape(height, 1 + 3 * width)
    assert not rows[:, 0].any()
    return rows[:, 1:].reshape(height, width, 3)


def test_a_first_dataset(tmp_path):
    printed = run("first_dataset.py", tmp_path, "--scenes", 1, *SIZE)
    check_page("first_dataset.py", printed)
    assert [path.name for path in tmp_path.iterdir()] == ["first"]
    dataset = st.open(tmp_path / "first" / "data")
    assert "`pinhole` has no option `size`" in printed and "2 images of 1 scenes, complete: True" in printed
    for sample in dataset:
        assert f"{sample.name}: {len(sample.ids)} objects" in printed
        hidden = 1 - sample.visible_masks.sum(axis=(1, 2)) / sample.amodal_masks.sum(axis=(1, 2))
        assert f"most occluded: {sample.objects[hidden.argmax()].name}, {hidden.max():.0%} hidden" in printed
    sheet = pixels((tmp_path / "first" / "sample.png").read_bytes())
    assert np.array_equal(sheet[:, :96], dataset[0].rgb) and sheet.shape == (72, 192, 3)
    assert (tmp_path / "first" / "preview.png").stat().st_size > 1000
    assert (tmp_path / "first" / "report" / "index.html").exists()
    coco = st.open(tmp_path / "first" / "coco")
    assert coco.format == "coco" and "sound: True" in printed
    assert np.array_equal(coco[1].amodal_masks, dataset[1].amodal_masks)
    # The script continues its dataset.
    assert run("first_dataset.py", tmp_path, "--scenes", 1, *SIZE) == printed


def contrasts(sample: st.Sample, width: int) -> dict[int, float]:
    """The contrast of all objects, by distances between all pixels."""
    place = np.stack(np.mgrid[: sample.shape[0], : sample.shape[1]], axis=-1).reshape(-1, 2)
    color = sample.rgb.reshape(-1, 3).astype(float) / 255
    found = {}
    for id, mask in zip(sample.ids.tolist(), sample.visible_masks.reshape(len(sample.ids), -1)):
        if mask.any():
            far = np.abs(place[:, None] - place[mask][None]).max(axis=2).min(axis=1)
            ring = (far > 0) & (far <= width)
            found[id] = float(np.sqrt(np.mean((color[mask].mean(axis=0) - color[ring].mean(axis=0)) ** 2)))
    return found


def test_an_own_annotator(tmp_path):
    printed = run("own_annotator.py", tmp_path, "--scenes", 1, *SIZE)
    check_page("own_annotator.py", printed)
    samples = list(st.open(tmp_path / "contrast"))
    wanted = [contrasts(sample, 3) for sample in samples]
    labels = json.loads((tmp_path / "contrast" / "coco" / "annotations" / "instances_train.json").read_text())
    images = sorted(one["id"] for one in labels["images"])
    for image, of_image in zip(images, wanted, strict=True):
        written = [one["contrast"] for one in labels["annotations"] if one["image_id"] == image and "contrast" in one]
        assert written == pytest.approx(list(of_image.values())) and written
        assert f"contrast {min(written):.3f} to {max(written):.3f}, median {np.median(written):.3f}" in printed
    least = min(value for of_image in wanted for value in of_image.values())
    assert f"{least:.3f} " in printed.partition("least contrast:\n")[2].splitlines()[0]


def test_a_net_learns_on_the_fly(tmp_path, capsys, monkeypatch):
    pytest.importorskip("torch")
    training = module(EXAMPLES / "train_on_the_fly.py")
    recipe = training.small_recipe([48, 36]).set("dataset.views_per_scene", 4).set("place[2].count", 4)
    recipe = recipe.set("render.samples_per_pixel", 1).set("settle.duration_s", 1.0).set("denoise.kind", "none")
    few = {"small_recipe": lambda size: recipe, "VIEWS": 8, "REUSE": 24, "BATCH": 4, "HELD_OUT": 2}
    for name, value in few.items():
        monkeypatch.setattr(training, name, value)

    def printed(folder, rounds):
        training.main(tmp_path / folder, rounds, [48, 36])
        return capsys.readouterr().out

    straight = printed("straight", 2)
    check_page("train_on_the_fly.py", straight)
    scores = [float(one) for one in re.findall(r"IoU ([\d.]+)", straight)]
    assert len(scores) == 3 and scores[2] > scores[0] + 0.1, straight
    # A stop after the first round changes nothing.
    first, second = printed("stopped", 1), printed("stopped", 2)
    assert first + "".join(second.splitlines(keepends=True)[1:]) == straight
    checkpoints = [(tmp_path / folder / "checkpoint.pt").read_bytes() for folder in ("straight", "stopped")]
    assert checkpoints[0] == checkpoints[1]


def test_a_detector_is_evaluated(tmp_path):
    printed = run("evaluate_detector.py", tmp_path, "--scenes", 1, "--size", 128, 96)
    check_page("evaluate_detector.py", printed)
    data, predictions = tmp_path / "detector" / "data", tmp_path / "detector" / "predictions.json"
    dataset, results = st.open(data), json.loads(predictions.read_text())
    assert "the same from detector/predictions.json: True" in printed.replace("\\", "/")
    # Overlap by hand: labels are found by their best prediction.
    shares = []
    for sample in dataset:
        masks = [st.Mask.from_rle(one["segmentation"]).array() for one in results if one["image_id"] == sample.name]
        assert masks and not np.any(np.sum(masks, axis=0) > 1)
        predicted, labeled = np.any(masks, axis=0), sample.visible_masks.any(axis=0)
        shares.append((predicted & labeled).sum() / (predicted | labeled).sum())
    assert np.mean(shares) > 0.6, "the pixels of objects above the table"
    found = re.search(r"visible F ([\d.]+), visible AP ([\d.]+), (\d+) predictions", printed)
    assert float(found[1]) > 60 and int(found[3]) == len(results)
    assert (tmp_path / "detector" / "report" / "index.html").exists()


def test_components_are_those_of_a_search_by_hand():
    detector = module(EXAMPLES / "evaluate_detector.py")
    # Two planes with a step between them, and a wall of outside pixels with a gap.
    depth = np.full((20, 30), 1.0)
    depth[:, 15:] = 1.2
    inside = np.ones(depth.shape, bool)
    inside[10, :] = False
    inside[10, 20] = True
    label = detector.components(inside, depth, 0.002)
    assert label[0, 0] != label[0, 20] and label[0, 0] != label[19, 0] and label[0, 20] == label[19, 20]
    assert len(np.unique(label)) == 4 and not label[~inside].any()
    tilted = 1 / np.add.outer(np.linspace(0.5, 0.9, 20), np.linspace(0.2, 0.6, 30))
    assert len(np.unique(detector.components(np.ones(depth.shape, bool), tilted, 0.002))) == 1


def test_failures_are_found_and_explained(tmp_path, data, dataset):
    # Perfect predictions, except: small objects have none, and two images have none at all.
    damaged = {1, 4}
    areas = np.concatenate([sample.visible_masks.sum(axis=(1, 2)) for sample in dataset])
    least = np.median(areas[areas > 0])
    results, missed = [], 0
    for place, sample in enumerate(dataset):
        for mask in sample.visible_masks:
            if mask.sum() >= least and place not in damaged:
                results.append({"image_id": sample.name, "score": 1.0, "segmentation": st.Mask(mask).rle()})
            elif mask.any():
                missed += 1
    (tmp_path / "results.json").write_text(json.dumps(results))
    printed = run("look_at_failures.py", tmp_path, "--data", data, "--predictions", "results.json", "--worst", 2)
    check_page("look_at_failures.py", printed)
    worst = re.findall(r"^    (.+): [\d.]+, \d+ objects missed$", printed, re.MULTILINE)
    assert sorted(worst) == sorted(dataset[place].name for place in damaged)
    assert f"{missed} of {(areas > 0).sum()} visible objects missed" in printed
    assert "explains most misses: low visible area, px" in printed
    sheet = pixels((tmp_path / "failures" / "worst.png").read_bytes())
    height, width = dataset[0].shape
    assert sheet.shape == (2 * height, 3 * width, 3)
    for row, name in enumerate(worst):
        sample = next(one for one in dataset if one.name == name)
        part = sheet[row * height : (row + 1) * height]
        assert np.array_equal(part[:, :width], sample.rgb)
        # Without predictions, all edges are red, and the last part has no edges.
        assert (part[:, width : 2 * width] == (255, 50, 50)).all(axis=2).any()
        assert not (part[:, width:] == (60, 220, 90)).all(axis=2).any()
        assert np.array_equal(part[:, 2 * width :], (sample.rgb * 0.5).astype(np.uint8))


# --- the book


def test_the_page_quotes_the_scripts():
    sections = re.split(r"^## ", PAGE, flags=re.MULTILINE)[1:]
    seen = set()
    for section in sections:
        for name in re.findall(r"\[(\w+\.py)\]\(", section):
            source = (EXAMPLES / name).read_text(encoding="utf-8")
            for block in re.findall(r"^```python.*?\n(.*?)^```$", section, re.MULTILINE | re.DOTALL):
                seen.add(name)
                for part in block.split("# …\n"):
                    lines = textwrap.dedent(part).rstrip("\n")
                    assert any(lines in textwrap.dedent(one) for one in levels(source)), f"{name} lacks\n{part}"
    assert len(seen) == 5, seen


def levels(source: str) -> list[str]:
    """A source, without the indentation of its functions."""
    return [re.sub(rf"^ {{{depth}}}", "", source, flags=re.MULTILINE) for depth in (0, 4, 8, 12)]


def test_the_notebook_runs_and_its_page_agrees():
    tool = module(ROOT / "book" / "notebook.py")
    notebook = json.loads(tool.NOTEBOOK.read_text(encoding="utf-8"))
    assert not tool.differences(notebook), "run python3 book/notebook.py"

    def form(outputs):
        """Kinds and masked texts of outputs."""
        text = ["".join(one.get("text") or one["data"]["text/plain"]) for one in outputs]
        kinds = [sorted(one.get("data", {})) for one in outputs]
        return kinds, [re.sub(r"#(, #)+", "#", masked(one)) for one in text]

    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert len(code) >= 7 and sum("image/png" in one.get("data", {}) for cell in code for one in cell["outputs"]) == 2
    for cell, outputs in zip(code, tool.run(code), strict=True):
        assert form(cell["outputs"]) == form(outputs)
    # A changed cell is noticed.
    code[1]["source"].append("# more")
    assert tool.differences(notebook) == [tool.PAGE]
