"""The ten tasks of the book's comparison run, on small images."""

import pathlib
import shutil
import subprocess
import sys

import pytest

TASKS = pathlib.Path(__file__).resolve().parents[3] / "tests" / "peers" / "tasks" / "syntable"
SMALL = """
import functools, runpy, sys
import syntable as st
whole = st.recipe
small = {"camera.resolution": [96, 72], "render.samples_per_pixel": 1, "place[2].count": 6}
st.recipe = lambda name: functools.reduce(lambda recipe, change: recipe.set(*change), small.items(), whole(name))
sys.argv.pop(0)
runpy.run_path(sys.argv[0], run_name="__main__")
"""
BOX = "".join(f"v {x} {y} {z}\n" for x in (0, 0.1) for y in (0, 0.1) for z in (0, 0.1)) + (
    "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
)


def task(name, *arguments):
    (script,) = TASKS.glob(f"{name}_*.py")
    run = subprocess.run([sys.executable, "-c", SMALL, script, *arguments], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return run.stdout


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    out = tmp_path_factory.mktemp("first") / "data"
    task("01", out)
    return out


def test_first_images_and_amodal_masks(dataset):
    assert len(list(dataset.glob("data/mono/rgb/*.png"))) == 4
    assert task("02", dataset).count("occlusion rate") == 4


def test_own_objects(tmp_path):
    (tmp_path / "scans/box/meshes").mkdir(parents=True)
    (tmp_path / "scans/box/meshes/model.obj").write_text(BOX)
    task("03", tmp_path / "scans", tmp_path / "out")
    assert '"objects/box"' in (tmp_path / "out/annotation_final.json").read_text()


def test_formats(tmp_path):
    task("04", tmp_path / "out")
    assert (tmp_path / "out/coco").is_dir() and (tmp_path / "out/bop").is_dir()


def test_depth(tmp_path):
    assert task("05", tmp_path / "out").count("error in m") == 4


def test_training_loop():
    pytest.importorskip("torch")
    assert task("06").count("'amodal_masks'") == 2


def test_own_annotation(tmp_path):
    task("07", tmp_path / "out")
    (labels,) = (tmp_path / "out/coco").rglob("*.json")
    assert '"darkness"' in labels.read_text()


def test_the_same_again(tmp_path):
    def files(name):
        task("08", tmp_path / name)
        paths = [it for it in (tmp_path / name).rglob("*") if it.is_file() and ".syntable" not in it.parts]
        return {it.relative_to(tmp_path / name): it.read_bytes() for it in paths}

    assert files("one") == files("two")


def test_wrong_labels(dataset, tmp_path):
    wrong = shutil.copytree(dataset, tmp_path / "wrong")
    labels = wrong / "annotation_final.json"
    labels.write_text(labels.read_text().replace('"occluded_rate":0.0,', '"occluded_rate":0.9,', 1))
    assert "rate_is_ratio_of_areas" not in task("09", dataset)
    assert "rate_is_ratio_of_areas" in task("09", wrong)


def test_scores(dataset):
    assert "amodal AP" in task("10", dataset)
