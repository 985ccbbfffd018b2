"""Datasets on a Ray cluster: three nodes on this machine, and the bytes of one process."""

from __future__ import annotations

import json
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import syntable as st
from conftest import small_recipe
from test_api import files

ray = pytest.importorskip("ray")
pytest.importorskip("ray.data")

import syntable.ray as on_ray  # noqa: E402
from ray.cluster_utils import Cluster  # noqa: E402
from syntable.samples import _Held  # noqa: E402
from syntable.ray import _nodes, _running  # noqa: E402
from syntable.ray._source import row  # noqa: E402

TESTS = pathlib.Path(__file__).parent
NODE = {"num_cpus": 1, "object_store_memory": 100 * 2**20}

#: A worker that is lost costs this time, s.
LEASE = 3.0


@pytest.fixture(scope="module")
def cluster():
    """Three nodes with a processor each."""
    # Workers import what tests import.
    os.environ["PYTHONPATH"] = os.pathsep.join(path for path in [str(TESTS), *sys.path] if path)
    made = Cluster(initialize_head=True, head_node_args={**NODE, "include_dashboard": False})
    made.add_node(**NODE)
    made.add_node(**NODE)
    ray.init(address=made.address, log_to_driver=False)
    yield made
    ray.shutdown()
    made.shutdown()


@pytest.fixture(scope="module")
def recipe():
    """A recipe of 24 scenes with two views."""
    return small_recipe(**{"dataset.scenes": 24})


@pytest.fixture(scope="module")
def whole(recipe, tmp_path_factory):
    """The files of its dataset, made by one process."""
    folder = tmp_path_factory.mktemp("whole") / "data"
    assert st.run(recipe, folder).complete
    return files(folder)


def workers() -> list[int]:
    """Processes of this machine that make scenes."""
    return processes(b"ray::syntable")


def processes(name: bytes) -> list[int]:
    """Processes of this machine by the beginning of their names."""
    found = []
    for folder in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            text = (folder / "cmdline").read_bytes()
        except OSError:
            continue
        if text.startswith(name):
            found.append(int(folder.name))
    return found


def wait_until(is_so, seconds=30.0):
    end = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.05)


def claims(folder) -> list[str]:
    return [path.name for path in folder.glob(".syntable/claims/*")]


def test_ray_is_not_imported():
    code = "import sys, syntable; sys.exit('ray' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0


def test_a_missing_ray_is_named():
    code = "import sys; sys.modules['ray'] = None; import syntable.ray"
    ended = subprocess.run([sys.executable, "-c", code], timeout=60, capture_output=True, text=True)
    assert 'pip install "ray[data]"' in ended.stderr.splitlines()[-1]


def test_a_cluster_makes_the_files_of_one_run(cluster, recipe, whole, tmp_path):
    events = []
    outcome = on_ray.run(recipe, tmp_path / "data", lease=LEASE, progress=events.append)
    assert outcome.complete and outcome.scenes == 24 and outcome.path == str(tmp_path / "data")
    assert files(tmp_path / "data") == whole
    assert not claims(tmp_path / "data") and [path.name for path in tmp_path.iterdir()] == ["data"]
    kinds = [event["event"] for event in events]
    assert kinds.count("started") == 1 and kinds[-2:] == ["stages", "finished"]
    images = sorted((event["scene"], event["view"]) for event in events if event["event"] == "image")
    assert images == [(scene, view) for scene in range(24) for view in range(2)]
    assert events[-1]["made"] == 48 and events[-2]["stages"]["render"]["calls"] >= 48
    # The same call finds the whole dataset.
    assert on_ray.run(recipe, tmp_path / "data").complete


def test_a_lost_node_costs_no_scene(cluster, recipe, whole, tmp_path):
    lost = cluster.add_node(**NODE)
    seen = threading.Event()
    events = []

    def heard(event):
        events.append(event)
        if event["event"] == "scene" and not seen.is_set():
            seen.set()
            cluster.remove_node(lost, allow_graceful=False)

    outcome = on_ray.run(recipe, tmp_path / "data", lease=LEASE, workers=4, progress=heard)
    assert outcome.complete and files(tmp_path / "data") == whole
    warned = [event["message"] for event in events if event["event"] == "message"]
    assert any("its node is gone" in text for text in warned), warned


def test_a_killed_worker_starts_again(cluster, recipe, whole, tmp_path):
    events = []

    def heard(event):
        events.append(event)
        if len([one for one in events if one["event"] == "scene"]) == 2 and event["event"] == "scene":
            os.kill(workers()[0], signal.SIGKILL)

    outcome = on_ray.run(recipe, tmp_path / "data", lease=LEASE, progress=heard)
    assert outcome.complete and files(tmp_path / "data") == whole
    warned = [event["message"] for event in events if event["event"] == "message"]
    assert len(warned) == 1 and "starts again in 1 s: a worker is lost" in warned[0] and "node" in warned[0]


def test_mistakes_end_the_run_at_once(cluster, recipe, tmp_path):
    start = time.monotonic()
    with pytest.raises(st.RecipeError, match="dataset.scens") as raised:
        on_ray.run(recipe.set("dataset.scens", 3), tmp_path / "data")
    assert raised.value.diagnostics and not (tmp_path / "data").exists()
    # Only a node finds that its assets are missing.
    mine = recipe.set("assets.mine", {"kind": "mesh_folder", "root": "nowhere", "license": "CC0-1.0"})
    with pytest.raises(st.RecipeError, match="nowhere does not exist") as raised:
        on_ray.run(mine, tmp_path / "data")
    assert raised.value.code == "D0011"
    with pytest.raises(ValueError, match="claim is True"):
        on_ray.run(recipe, tmp_path / "data", claim=False)
    with pytest.raises(TypeError, match="list of files"):
        on_ray.run(recipe, tmp_path / "data", plugins="mine.py")
    assert time.monotonic() - start < 20 and not workers()
    assert list(tmp_path.iterdir()) == []


def test_a_worker_that_always_fails_is_given_up(cluster, recipe, tmp_path, monkeypatch):
    monkeypatch.setattr(_running, "PAUSE_S", 0.05)
    folder = tmp_path / "data"
    folder.mkdir()
    (folder / "mine.txt").write_text("not a dataset")
    events = []
    with pytest.raises(st.SyntableError, match="data"):
        on_ray.run(recipe, folder, workers=2, progress=events.append)
    warned = [event["message"] for event in events if event["event"] == "message"]
    # No retry mends the folder, and the remedy names the function that has the argument.
    assert len(warned) == 2 and all("is given up:" in text for text in warned)


def test_only_failures_that_may_pass_are_tried_again():
    events = []
    team = _running.Team.__new__(_running.Team)
    team._waiting, team._heard = [], events.append
    full, refused = _running.Worker(0), _running.Worker(1)
    for failure in range(1, 5):
        team._failed(full, st.SyntableError("disk full", temporary=True), "here")
        assert team._waiting == [full] * min(failure, 3)
    team._failed(refused, st.SyntableError("refused"), "there")
    assert refused not in team._waiting
    warned = [event["message"] for event in events]
    assert sum("starts again" in text for text in warned) == 3 and "after 4 failures: disk full" in warned[3]
    assert warned[4] == "worker 1 on there is given up: refused"
    mistake = st.Diagnostic("D0003", "error", "wrong", None, None, None)
    with pytest.raises(st.RecipeError):
        team._failed(refused, st.RecipeError("wrong", diagnostics=[mistake]), "there")


def test_advice_names_the_function_of_an_argument():
    text = "replace it with `overwrite=True`, or keep `claim` and `scenes`"
    error = _running.worded(st.SyntableError(f"a: {text}", message="run once without `claim`", help=text, temporary=True))
    assert "`overwrite=True` of `st.run`, or keep `claim` and `scenes`" in str(error)
    assert error.help == "replace it with `overwrite=True` of `st.run`, or keep `claim` and `scenes`"
    assert error.message == "run once without `claim`, by `st.run`" and error.temporary
    assert pickle.loads(pickle.dumps(error)).temporary


def test_workers_fill_the_nodes():
    reserved = _running.Reserved(None, 0, None)
    nodes = [(0, 0), (16, 0), (9, 2)]
    assert reserved.threads_of(nodes) == 9 and reserved.room(nodes, 9) == 2 and reserved.room(nodes, 4) == 6
    cards = _running.Reserved(None, 2, None)
    assert cards.threads_of(nodes) == 9 and cards.room(nodes, 9) == 1 and cards.room(nodes, 2) == 1
    assert _running.Reserved(None, 1, None).threads_of(nodes) == 4
    with pytest.raises(st.SyntableError, match="no node with 4 graphics cards"):
        _running.Reserved(None, 4, None).threads_of(nodes)
    assert _running.Reserved(3, 4, None).threads_of(nodes) == 3


def test_a_lost_mailbox_starts_again(cluster, recipe, whole, tmp_path):
    seen = []

    def heard(event):
        if event["event"] == "scene" and not seen:
            seen.extend(processes(b"ray::Mailbox"))
            os.kill(seen[0], signal.SIGKILL)

    assert on_ray.run(recipe, tmp_path / "data", lease=LEASE, progress=heard).complete
    assert files(tmp_path / "data") == whole and seen


def test_folders_that_nodes_do_not_share_are_refused(cluster, recipe, tmp_path, monkeypatch):
    # This node alone writes the file.
    monkeypatch.setattr(_nodes, "SEEN_AFTER_S", 0.1)
    probe = _nodes.Probe.new(str(tmp_path / "data"))
    probe.check()
    probe.delete()
    with pytest.raises(st.SyntableError, match="does not share this folder with the driver"):
        probe.check()
    assert _nodes.Probe.new("s3://bucket/data").path is None
    # A killed driver left a file.
    old = tmp_path / ".data.ray-old"
    old.touch()
    os.utime(old, (0, 0))
    _nodes.Probe.new(str(tmp_path / "data")).delete()
    assert list(tmp_path.iterdir()) == []


def test_other_versions_are_refused(cluster, recipe):
    job = _nodes.Job.of(recipe, [])
    with pytest.raises(_nodes.Unfit, match="the driver has 0.0.0"), _other(job, version="0.0.0").at_node():
        pass


def _other(job, **changes):
    import dataclasses

    return dataclasses.replace(job, **changes)


def test_a_recipe_reaches_nodes_without_its_files(cluster, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINE", "here")
    small = small_recipe()
    (tmp_path / "base.toml").write_text(small.to_toml())
    (tmp_path / "recipe.toml").write_text('extends = "base.toml"\n[dataset]\nseed = 5\n')
    recipe = st.Recipe("recipe.toml").set("dataset.name", "elsewhere")
    job = _nodes.Job.of(recipe, [])
    with job.at_node() as there:
        assert there.to_toml() == recipe.to_toml() and there._raw.changes
    for file in tmp_path.glob("*.toml"):
        file.unlink()
    with job.at_node() as there:
        assert there.to_toml() == job.resolved and not there._raw.changes
    outcome = on_ray.run(there, "data", workers=1)
    assert outcome.complete and outcome.path == str(tmp_path / "data")


STAGE = """
import syntable as st

@st.annotator(reads=["rgb"], provides={"dark_of_ray": st.Value(float, doc="Share of dark pixels.")})
def dark_of_ray(view):
    "Share of dark pixels."
    return float((view.rgb.mean(axis=-1) < 60).mean())
"""


def test_a_node_without_a_file_of_stages_gets_its_text():
    _nodes.Plugin("/nowhere/text_of_ray.py", STAGE.replace("dark_of_ray", "text_of_ray")).load()
    sample = next(st.generate(small_recipe(), ["text_of_ray"]))
    assert 0 <= sample["text_of_ray"] <= 1


def test_stages_of_a_file_reach_the_workers(cluster, tmp_path):
    plugin = tmp_path / "dark_of_ray.py"
    plugin.write_text(STAGE)
    recipe = small_recipe(**{"dataset.scenes": 2, "write.npz": {"include": ["dark_of_ray"]}})
    assert on_ray.run(recipe, tmp_path / "data", plugins=[plugin], workers=2).complete
    rows = on_ray.dataset(recipe, ["dark_of_ray"], plugins=[plugin], blocks=2).take_all()
    assert len(rows) == 4 and all(0 <= json.loads(one["dark_of_ray"]) <= 1 for one in rows)


@pytest.mark.parametrize("moment", ["start", "middle"])
def test_an_interrupted_run_continues(cluster, recipe, whole, tmp_path, moment):
    folder = tmp_path / "data"

    def heard(event):
        if event["event"] == "scene" and moment == "middle":
            raise KeyboardInterrupt

    if moment == "start":
        threading.Timer(0.3, os.kill, [os.getpid(), signal.SIGINT]).start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        on_ray.run(recipe, folder, lease=LEASE, progress=heard)
    assert time.monotonic() - start < 20
    wait_until(lambda: not workers(), 5)
    assert not claims(folder) and [path.name for path in tmp_path.iterdir() if path.name != "data"] == []
    if moment == "middle":
        assert 0 < st.status(folder).total.done < 24
    assert st.run(recipe, folder).complete and files(folder) == whole


PRODUCTS = ["rgb", "depth", "visible_mask", "amodal_box", "occlusion_rate", "occlusion_order", "camera", "object_name"]


@pytest.mark.parametrize("blocks", [1, 3])
def test_rows_are_the_samples_of_generate(cluster, blocks):
    recipe = small_recipe()
    made = {(one.scene, one.view): one for one in st.generate(recipe, PRODUCTS)}
    rows = on_ray.dataset(recipe, PRODUCTS, blocks=blocks).take_all()
    assert sorted((one["scene"], one["view"]) for one in rows) == sorted(made)
    for one in rows:
        sample = made[one["scene"], one["view"]]
        assert set(one) == {"scene", "view", "ids", "K", "world_from_camera", *PRODUCTS}
        assert one["rgb"].dtype == np.uint8 and np.array_equal(one["rgb"], sample.rgb)
        assert one["depth"].dtype == np.float32 and np.array_equal(one["depth"], sample.depth)
        assert one["visible_mask"].dtype == bool and np.array_equal(one["visible_mask"], sample.visible_masks)
        assert np.array_equal(one["amodal_box"], sample.amodal_boxes) and np.array_equal(one["ids"], sample.ids)
        assert np.array_equal(one["occlusion_rate"], sample.occlusion_rates, equal_nan=True)
        assert np.array_equal(one["occlusion_order"], sample.occlusion_order)
        assert np.array_equal(one["K"], sample.camera.K) and json.loads(one["camera"])["width"] == 64
        assert list(one["object_name"]) == [object.name for object in sample.objects]


def test_batches_have_views_with_different_objects(cluster):
    # Objects fall off the table, so that views differ.
    recipe = small_recipe(**{"dataset.scenes": 6, "place[2].width_factor": 0.5})
    views = on_ray.dataset(recipe, ["rgb", "visible_masks", "visible_boxes"], scenes=range(1, 5), blocks=2)
    batches = list(views.iter_batches(batch_size=4, batch_format="numpy"))
    assert [len(batch["scene"]) for batch in batches] == [4, 4]
    assert sorted(set(np.concatenate([batch["scene"] for batch in batches]))) == [1, 2, 3, 4]
    for batch in batches:
        assert batch["rgb"].shape == (4, 48, 64, 3)
        for masks, boxes, ids in zip(batch["visible_mask"], batch["visible_box"], batch["ids"]):
            assert masks.shape == (len(ids), 48, 64) and boxes.shape == (len(ids), 4)
    mean = views.map_batches(lambda batch: {"mean": batch["rgb"].mean(axis=(1, 2, 3))}).mean("mean")
    assert 0 < mean < 255


def test_the_size_is_known_before(cluster):
    views = on_ray.dataset(small_recipe(), ["rgb", "depth"], blocks=2)
    assert views.count() == 6
    made = views.materialize()
    guess = 6 * 64 * 48 * 7
    assert guess / 2 < made.size_bytes() < guess * 2


def test_a_view_without_objects_has_columns():
    values = {"visible_mask": {}, "amodal_box": {}, "occlusion_rate": {}, "object_info": {}, "object_name": {}}
    held = _Held(0, 0, "0_0", {"rgb": np.zeros((48, 64, 3), np.uint8), **values}, [])
    made = row(st.Sample(held), list(values))
    assert made["visible_mask"].shape == (0, 48, 64) and made["amodal_box"].shape == (0, 4)
    assert made["occlusion_rate"].shape == (0,) and made["object_info"] == "{}" and made["object_name"] == []


def test_a_node_that_joins_gets_workers(cluster, recipe, whole, tmp_path, monkeypatch):
    monkeypatch.setattr(_running, "NODES_S", 0.2)
    joined, most = [], 0

    def heard(event):
        nonlocal most
        if event["event"] == "scene":
            if not joined:
                joined.append(cluster.add_node(**NODE))
            most = max(most, len(workers()))

    outcome = on_ray.run(recipe.set("dataset.scenes", 60), tmp_path / "data", lease=LEASE, progress=heard)
    cluster.remove_node(joined[0])
    assert outcome.complete and most == 4


def test_a_working_folder_brings_assets(cluster, tmp_path, monkeypatch):
    here, elsewhere = tmp_path / "here", tmp_path / "elsewhere"
    (here / "objects/box").mkdir(parents=True)
    corners = ["v 0 0 0", "v 0.1 0 0", "v 0 0.1 0", "v 0 0 0.1"]
    (here / "objects/box/box.obj").write_text("\n".join([*corners, "f 1 3 2", "f 1 2 4", "f 2 3 4", "f 3 1 4"]) + "\n")
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    recipe = small_recipe(
        **{
            "dataset.scenes": 1,
            "assets.mine": {"kind": "mesh_folder", "root": "objects", "license": "CC0-1.0"},
            "place[2].from": "mine",
        }
    )
    with pytest.raises(st.RecipeError, match="objects does not exist"):
        on_ray.run(recipe, tmp_path / "data")
    # A program that has not called ray.init.
    code = """
import pickle, sys, syntable.ray
recipe, out, folder = pickle.load(open(sys.argv[1], "rb"))
outcome = syntable.ray.run(recipe, out, runtime_env={"working_dir": folder}, progress=True)
sys.exit(not (outcome.scenes == 1 and outcome.failed == 0))
"""
    (tmp_path / "call").write_bytes(pickle.dumps((recipe, str(tmp_path / "data"), str(here))))
    environment = {**os.environ, "RAY_ADDRESS": cluster.address}
    command = [sys.executable, "-c", code, str(tmp_path / "call")]
    ended = subprocess.run(command, env=environment, timeout=120, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert "2 of 2 images" in ended.stderr
