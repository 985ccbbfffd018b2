"""Recipes, runs, samples in memory, datasets: each against another way to the same thing."""

from __future__ import annotations

import pickle
import subprocess
import sys

import numpy as np
import pytest

import syntable as st
from conftest import small_recipe


def command(*arguments, **more):
    return subprocess.run(
        [sys.executable, "-m", "syntable", *map(str, arguments)], capture_output=True, text=True, timeout=120, **more
    )


def files(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and ".syntable" not in path.parts and path.name != "report.json"
    }


def test_a_recipe_is_the_same_from_file_text_and_dicts(tmp_path):
    dataset = {"scenes": 7, "name": 'quoted "name"'}
    tables = {"extends": "builtin:quickstart", "dataset": dataset, "camera": {"resolution": (64, 48)}}
    made = st.Recipe.from_dict(tables)
    path = tmp_path / "recipe.toml"
    path.write_text(made._raw.text, encoding="utf-8")
    assert str(made) == str(st.Recipe(path)) == str(st.Recipe.from_toml(made._raw.text))
    assert (made.scenes, made.views_per_scene) == (7, st.recipe("quickstart").views_per_scene)
    changed = made.set("dataset.scenes", np.int64(3))
    assert (changed.scenes, made.scenes) == (3, 7), "a recipe never changes"
    several = {"dataset.scenes": 3, "camera.resolution": [32, 24]}
    assert str(made.set(several)) == str(changed.set("camera.resolution", [32, 24]))
    assert str(pickle.loads(pickle.dumps(changed))) == str(changed)
    assert "quickstart" in st.recipes()


def test_all_mistakes_come_at_once(tmp_path):
    path = tmp_path / "wrong.toml"
    path.write_text('extends = "builtin:quickstart"\n[dataset]\nscens = 3\n[render]\nkind = "fast"\n', encoding="utf-8")
    with pytest.raises(st.RecipeError) as caught:
        st.Recipe(path).set("camera.resolution", "wide").check()
    found = caught.value.diagnostics
    lines = {one.line for one in found if one.file and one.file.endswith("wrong.toml")}
    assert len(found) >= 3 and {3, 5} <= lines, found
    assert all(one.code.startswith("D") and one.message for one in found)
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value) and again.code == caught.value.code


def test_run_and_the_command_write_the_same_bytes(small, data, tmp_path):
    path = tmp_path / "recipe.toml"
    path.write_text(str(small), encoding="utf-8")
    done = command("run", path, "--out", tmp_path / "data", "--threads", 1)
    assert done.returncode == 0, done.stderr
    mine, theirs = files(data), files(tmp_path / "data")
    assert list(mine) == list(theirs)
    images = [name for name in mine if name.endswith((".png", ".npy"))]
    assert len(images) >= 6 and all(mine[name] == theirs[name] for name in images)


def test_generate_gives_what_a_run_writes(small, dataset):
    made = list(st.generate(small, threads=2))
    assert [(one.scene, one.view) for one in made] == [(scene, view) for scene in range(3) for view in range(2)]
    for one, read in zip(made, dataset, strict=True):
        assert np.array_equal(one.rgb, read.rgb) and one.rgb.dtype == np.uint8
        assert np.array_equal(one.ids, read.ids)
        assert np.array_equal(one.amodal_masks, read.amodal_masks)
        assert np.array_equal(one.visible_masks, read.visible_masks)
        assert np.array_equal(one.occlusion_order, read.occlusion_order)
        assert np.allclose(one.camera.K, read.camera.K)
        assert [object.name for object in one.objects] == [object.name for object in read.objects]


def test_arrays_are_writable_contiguous_and_their_own(small):
    sample = next(st.generate(small, ["rgb", "depth", "visible_mask"]))
    for name, dtype in (("rgb", np.uint8), ("depth", np.float32)):
        array = sample[name]
        assert array.flags.c_contiguous and array.flags["W"] and array.dtype == dtype
        array[:] = 0
    assert sample.rgb.max() == 0
    masks = sample.visible_masks
    assert masks.flags.c_contiguous and masks.flags["W"] and masks.dtype == bool
    mask = next(iter(sample["visible_mask"].values()))
    assert mask == st.Mask(mask.array()) == st.Mask.from_rle(mask.rle())
    assert mask.area == mask.array().sum() and mask.shape == (48, 64)


def test_some_scenes_alone_are_the_same(small, dataset):
    with st.generate(small, ["rgb"], scenes=range(1, 3)) as samples:
        first = next(samples)
    assert (first.scene, first.view) == (1, 0) and np.array_equal(first.rgb, dataset[2].rgb)
    assert list(samples) == []


def test_a_dataset_reads_by_place_and_converts(dataset, tmp_path):
    assert len(dataset) == 6 and len(dataset[1:3]) == 2 and dataset[-1].name == dataset[5].name
    coco = dataset.to_coco(tmp_path / "coco")
    assert coco.format == "coco" and len(coco) == len(dataset)
    for one, other in zip(dataset, coco, strict=True):
        assert np.array_equal(one.rgb, other.rgb)
        assert sorted(mask.sum() for mask in one.visible_masks if mask.any()) == sorted(
            mask.sum() for mask in other.visible_masks if mask.any()
        )
    again = pickle.loads(pickle.dumps(coco))
    assert repr(again) == repr(coco)


def test_validate_is_sound_and_names_faults(dataset, data, tmp_path):
    found = st.validate(dataset)
    assert found and found.sound and found.images == 6 and found.checks
    import shutil

    broken = tmp_path / "broken"
    shutil.copytree(data, broken)
    next(broken.rglob("rgb/0_0.png")).unlink()
    found = st.validate(broken)
    assert not found and not found.sound and any("0_0" in fault.place + fault.message for fault in found.faults)


def test_a_run_continues_and_repairs(data, small, tmp_path):
    out = tmp_path / "data"
    part = st.run(small, out, scenes=range(0, 1))
    assert part.scenes == 1 and part.images == 2
    whole = st.run(small, out)
    assert whole.complete and whole.scenes == 3
    assert files(out) == files(data)


def test_errors_name_arguments_of_functions(data, small):
    with pytest.raises(st.SyntableError, match="`overwrite`") as caught:
        st.run(small.set("camera.resolution", [80, 60]), data)
    assert "options." not in f"{caught.value} {caught.value.message} {caught.value.help}"


def test_images_need_nothing(dataset, tmp_path):
    sample = dataset[0]
    assert sample._repr_png_().startswith(b"\x89PNG")
    sample.save(tmp_path / "sample.png")
    assert (tmp_path / "sample.png").read_bytes() == sample._repr_png_()
    assert "quickstart" in repr(st.recipe("quickstart")) and "<pre>" in small_recipe()._repr_html_()
