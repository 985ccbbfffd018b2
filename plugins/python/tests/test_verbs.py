"""The verbs as functions, each against the command."""

from __future__ import annotations

import json
import shutil
import urllib.error
import urllib.request

import numpy as np
import pytest

import syntable as st
from test_api import command, files


def test_stats_are_those_of_the_command(data, dataset):
    found = st.stats(dataset)
    printed = json.loads(command("stats", data, "--json").stdout)
    assert found.to_dict() == printed["datasets"][0]
    assert found.images == 6 and found.scenes == 3
    shown = sum(int(mask.any()) for sample in dataset for mask in sample.visible_masks)
    assert found.instances == shown
    rates = [
        rate for sample in dataset for rate, mask in zip(sample.occlusion_rates, sample.visible_masks) if mask.any()
    ]
    assert found.mean_occlusion_rate == pytest.approx(np.mean(rates))
    assert found.csv.count("\n") == 7 and "instances" in repr(found) and len(str(found).splitlines()) > 10


def test_datasets_are_compared(data, tmp_path):
    coco = st.open(data).to_coco(tmp_path / "coco")
    found = st.compare(data, coco, labels_only=True)
    printed = json.loads(command("stats", data, tmp_path / "coco", "--json", "--labels-only").stdout)
    assert found.to_dict() == printed
    assert [one.format for one in found.datasets] == [st.open(data).format, "coco"] and found.distances


def test_a_plan_names_products_and_stages(small):
    plan = st.plan(small)
    assert (plan.scenes, plan.views_per_scene, plan.images) == (3, 2, 6) and plan.time is None
    names = [product.product for product in plan.products]
    assert "rgb" in names and "amodal_mask" in names
    assert plan.components[0].share == 1.0 and "rgb" in str(plan)
    timed = st.plan(small, time=True, measured=1, threads=2).time
    assert timed.measured == 1 and timed.threads == 2 and timed.total_s > 0 and timed.total_bytes > 0
    assert timed.limit in ("cores", "render device", "steps of a scene") and timed.stages_s


def test_parts_merge_into_the_whole(small, data, tmp_path):
    parts = [tmp_path / "a", tmp_path / "b"]
    st.run(small, parts[0], scenes=range(0, 1))
    st.run(small, parts[1], scenes=range(1, 3))
    merged = st.merge(parts, tmp_path / "all")
    assert merged.complete and merged.scenes == 3 and files(tmp_path / "all") == files(data)
    with pytest.raises(TypeError, match="list of folders"):
        st.merge(str(parts[0]), tmp_path / "all")


def test_verify_finds_what_changed(data, tmp_path):
    assert st.verify(data) and st.verify(data).whole
    broken = tmp_path / "broken"
    shutil.copytree(data, broken)
    image = next(broken.rglob("rgb/1_0.png"))
    image.write_bytes(image.read_bytes() + b"x")
    next(broken.rglob("rgb/2_1.png")).unlink()
    (broken / "mine.txt").write_text("a note")
    found = st.verify(broken)
    assert not found and not found.whole and found.bad_scenes == [1, 2]
    assert len(found.damaged) == len(found.missing) == 1 and found.foreign == ["mine.txt"]


def test_a_report_has_pages(data, tmp_path):
    made = st.report(data, tmp_path / "pages", images=2)
    assert made.images == 2 and made.all_images == 6 and made.left_out == []
    assert "<html" in open(made.index, encoding="utf-8").read()
    with pytest.raises(st.SyntableError):
        st.report(data, tmp_path / "pages")
    assert st.report(data, tmp_path / "pages", images=None, labels_only=True, overwrite=True).images == 6


def test_a_view_serves_until_it_is_closed(data):
    with st.view(data, threads=1) as view:
        assert view.is_open and view.url.startswith("http://")
        opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        assert b"<html" in opener.open(view.url, timeout=10).read()
    assert not view.is_open and "closed" in repr(view)
    with pytest.raises(urllib.error.URLError):
        opener.open(view.url, timeout=10)


def test_a_preview_is_an_array(small):
    sheet = st.preview(small, scenes=0, samples=1, width=48)
    wide = st.preview(small, scenes=range(0, 1), samples=1, width=48, labels=True)
    assert sheet.image.dtype == np.uint8 and sheet.image.ndim == 3 and sheet.failed == 0
    assert wide.image.shape[1] > sheet.image.shape[1] and sheet.image.flags["W"]
    assert sheet._repr_png_().startswith(b"\x89PNG") and np.asarray(sheet).shape == sheet.image.shape
    with pytest.raises(ValueError, match="end its name in .png, not 'sheet.jpg'"):
        sheet.save("sheet.jpg")


def test_what_cannot_be_read_is_a_warning(data, tmp_path):
    st.convert(data, tmp_path / "lines", "jsonl", jsonl={"include": ["camera", "visible_mask"]})
    lines = next((tmp_path / "lines").rglob("*.jsonl"))
    lines.write_bytes(lines.read_bytes()[:-40])
    with pytest.warns(st.SyntableWarning, match="left out: line 6: .*the line is not read"):
        opened = st.open(lines)
    assert len(opened) == 5 and len(opened.left_out) == 1
    with pytest.warns(st.SyntableWarning, match="left out: .*the line is not read"):
        found = st.stats(lines)
    assert found.left_out

    shutil.copytree(data, tmp_path / "damaged")
    image = tmp_path / "damaged/data/mono/rgb/0_1.png"
    image.write_bytes(image.read_bytes()[:200])
    opened = st.open(tmp_path / "damaged")
    assert opened.left_out == []
    with pytest.warns(st.SyntableWarning, match=r"left out: .*rgb/0_1\.png"):
        coco = opened.to_coco(tmp_path / "coco")
    assert len(coco) == 5
