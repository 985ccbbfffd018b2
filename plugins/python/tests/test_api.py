"""Recipes, runs, samples in memory, datasets: each against another way to the same thing."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
import shutil
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

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
    assert "quickstart" in st.recipes() and str(st.recipe("builtin:quickstart")) == str(st.recipe("quickstart"))


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
    with pytest.raises(st.SyntableError, match="`overwrite=True`") as caught:
        st.run(small.set("camera.resolution", [80, 60]), data)
    assert "options." not in f"{caught.value} {caught.value.message} {caught.value.help}"


def same(one, other):
    """Whether two samples have the same products."""
    assert (one.scene, one.view, one.name, one.products) == (other.scene, other.view, other.name, other.products)
    for name in one.products:
        if isinstance(one[name], np.ndarray):
            assert one[name].dtype == other[name].dtype and np.array_equal(one[name], other[name]), name
        else:
            assert repr(one[name]) == repr(other[name]), name
    for name in ("ids", "visible_masks", "amodal_masks", "occlusion_masks", "amodal_boxes", "occlusion_rates"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    assert one.shape == other.shape and [it.name for it in one.objects] == [it.name for it in other.objects]
    return True


COPIES = [copy.copy, copy.deepcopy, lambda it: pickle.loads(pickle.dumps(it))]


@pytest.mark.parametrize("number", range(3))
def test_samples_are_copied_and_pickled(number, small, dataset):
    again = COPIES[number]
    made = next(st.generate(small))
    few = next(st.generate(small, ["rgb", "visible_mask", "amodal_mask", "amodal_box", "occlusion_rate"]))
    for sample in (made, few, dataset[1]):
        fresh = again(sample)
        assert same(fresh, sample) and same(again(fresh), sample)
        with pytest.raises(KeyError, match="the sample has no `nonsense`, only"):
            fresh["nonsense"]
        with pytest.raises(st.SyntableError, match="mask per object"):
            fresh._raw.masks("rgb", [1])
    # What a caller changes is in the copy, and what the copy changes is not in the original.
    sample = dataset[0]
    sample.rgb[:] = 7
    fresh = again(sample)
    assert (fresh.rgb == 7).all()
    if again is not copy.copy:
        fresh.rgb[:] = 8
        assert (sample.rgb == 7).all()


def test_processes_return_samples_and_open_their_dataset_once(data, dataset, monkeypatch):
    from syntable import samples

    opened = []
    monkeypatch.setattr(samples, "_opened", counted(samples._opened, opened))
    samples._opened.cache_clear()
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        found = list(pool.map(without_reading, [str(data)] * 4, [0, 3, 5, 3]))
    assert [one.name for one in found] == [dataset[place].name for place in (0, 3, 5, 3)]
    assert all(same(one, dataset[place]) for one, place in zip(found, (0, 3, 5, 3), strict=True))
    assert samples._opened.cache_info().misses == 1 and len(set(opened)) == 1


def without_reading(path, place):
    return st.open(path)[place]


def counted(function, calls):
    def call(*arguments):
        calls.append(arguments)
        return function(*arguments)

    call.cache_clear, call.cache_info = function.cache_clear, function.cache_info
    return call


def test_a_pickled_sample_of_another_dataset_is_refused(data, tmp_path):
    shutil.copytree(data, tmp_path / "data")
    stored = pickle.dumps(st.open(tmp_path / "data")[5])
    shutil.rmtree(tmp_path / "data")
    with pytest.raises(st.SyntableError, match="no such folder"):
        pickle.loads(stored)
    st.run(small_recipe(**{"dataset.scenes": 1}), tmp_path / "data")
    with pytest.raises(st.SyntableError, match="image 5 is not `"):
        pickle.loads(stored)


def test_shards_are_merged(tmp_path, monkeypatch):
    recipe, out = small_recipe(**{"dataset.scenes": 3}), tmp_path / "data"
    whole = st.run(recipe, tmp_path / "whole", progress=False)
    first = st.run(recipe, out, shard=(0, 2), progress=False)
    assert first.path == str(tmp_path / "data.shards/0-of-2") and first.scenes == 2
    found = st.status(tmp_path / "data.shards")
    assert found.missing_shards == ["1/2"] and found.total.missing == 1 and found.total.scenes == 3
    assert [one.shard for one in found.datasets] == ["0/2"] and found.datasets[0].finished
    with pytest.raises(st.SyntableError, match="shard 1/2 is missing.*partial"):
        st.merge([tmp_path / "data.shards"], out, progress=False)
    monkeypatch.setenv("JOB_COMPLETION_INDEX", "1")
    assert st.run(recipe, out, shard="auto/2", progress=False).scenes == 1
    assert st.merge([tmp_path / "data.shards"], out, progress=False).images == whole.images
    for name in ("annotation_final.json", ".syntable/journal.jsonl"):
        assert (out / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_workers_share_a_dataset(tmp_path):
    recipe, out = small_recipe(**{"dataset.scenes": 3}), tmp_path / "data"
    whole = st.run(recipe, tmp_path / "whole", progress=False)
    with ThreadPoolExecutor(2) as pool:
        work = [pool.submit(st.run, recipe, out, claim=True, lease=5, threads=1, progress=False) for _ in range(2)]
        made = [one.result() for one in work]
    assert [(one.scenes, one.images, one.complete) for one in made] == [(3, whole.images, True)] * 2
    assert files(out) == files(tmp_path / "whole") and st.verify(out).whole


def test_a_pickled_sample_knows_its_folder(dataset, tmp_path, monkeypatch):
    monkeypatch.chdir(dataset.path)
    near = st.open(".")
    stored, opened = pickle.dumps(near[0]), pickle.dumps(near)
    monkeypatch.chdir(tmp_path)
    assert np.array_equal(pickle.loads(stored).rgb, dataset[0].rgb) and len(pickle.loads(opened)) == len(dataset)


def test_counts_of_numpy_are_integers(small, dataset):
    for scenes in (np.int64(1), np.array([1, 2]), (np.uint8(1), np.int32(2)), np.array(1)):
        samples = list(st.generate(small, ["rgb"], scenes=scenes, threads=np.int64(1)))
        assert [one.scene for one in samples] == [1, 1]
    assert dataset[np.uint8(5)].name == dataset[5].name
    for wrong in (np.bool_(True), 1.0, (0.5, 2), np.array([1.0, 2.0]), "1"):
        with pytest.raises(TypeError, match="scenes is a range"):
            st.generate(small, scenes=wrong)


def test_a_conversion_that_leaves_out_images_is_false(data, tmp_path):
    assert st.convert(data, tmp_path / "whole", "coco")
    damaged = tmp_path / "damaged"
    shutil.copytree(data, damaged)
    image = next(damaged.rglob("rgb/1_0.png"))
    image.write_bytes(image.read_bytes()[:100])
    found = st.convert(damaged, tmp_path / "part", "coco")
    assert found.left_out and not found and not found.complete
    assert command("convert", damaged, "--to", "coco", "--out", tmp_path / "other").returncode == 3


def test_images_need_nothing(dataset, tmp_path):
    sample = dataset[0]
    assert sample._repr_png_().startswith(b"\x89PNG")
    sample.save(tmp_path / "sample.png")
    assert (tmp_path / "sample.png").read_bytes() == sample._repr_png_()
    for name in ("sample.jpg", "sample", "png", "sample.png.gz"):
        with pytest.raises(ValueError, match="end its name in .png"):
            sample.save(tmp_path / name)
        assert not (tmp_path / name).exists()
    assert "quickstart" in repr(st.recipe("quickstart")) and "<pre>" in small_recipe()._repr_html_()
