"""Mistakes: each is a clear exception. Nothing crashes, and nothing hangs."""

from __future__ import annotations

import os
import pathlib
import pickle
import shutil
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest

import syntable as st

CODE = {"exec": {"include": ["rgb"], "program": {"file": sys.executable}}}
RLE = {"size": [4, 4], "counts": [4, 12]}


def script(text, *arguments, interrupt_after=None, folder=None, limit=60):
    """Runs a script in a process of its own. With `interrupt_after`, sends SIGINT when it has printed this line."""
    child = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(text), *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    try:
        printed = []
        if interrupt_after is not None:
            for line in child.stdout:
                printed.append(line)
                if line.strip() == interrupt_after:
                    break
            time.sleep(0.3)
            child.send_signal(signal.SIGINT)
        out, errors = child.communicate(timeout=limit)
    finally:
        child.kill()
    return child.returncode, "".join(printed) + out, errors


# Each is a call, the class of its exception and words of it.
CALLS = [
    (lambda s, d, t: st.Recipe(3), TypeError, "path is a path"),
    (lambda s, d, t: st.Recipe(t / "missing.toml"), st.SyntableError, "missing.toml"),
    (lambda s, d, t: st.Recipe(t), st.SyntableError, "folder"),
    (lambda s, d, t: st.recipe("nonsense"), st.SyntableError, "nonsense"),
    (lambda s, d, t: st.recipe("my.toml"), ValueError, r"st.Recipe\('my.toml'\)"),
    (lambda s, d, t: st.recipe(t / "my.toml"), TypeError, r"st.Recipe\('.*my.toml'\)"),
    (lambda s, d, t: st.recipe(3), TypeError, r"st.Recipe\('my.toml'\)"),
    (lambda s, d, t: st.Recipe(""), ValueError, "path is an empty path"),
    (lambda s, d, t: st.Recipe.from_dict({"dataset": {"scenes": None}}), TypeError, "None"),
    (lambda s, d, t: st.Recipe.from_dict({"dataset": {"scenes": object()}}), TypeError, "dataset.scenes"),
    (lambda s, d, t: st.Recipe.from_dict({3: 4}), TypeError, "3"),
    (lambda s, d, t: st.Recipe.from_toml("[dataset\n").check(), st.RecipeError, "dataset"),
    (lambda s, d, t: s.set(3, 4), TypeError, "key"),
    (lambda s, d, t: s.set("dataset.scenes", {1, 2}), TypeError, "dataset.scenes"),
    (lambda s, d, t: s.set("dataset.scenes"), TypeError, "a key and a value"),
    (lambda s, d, t: s.set("dataset.scens", 3).check(), st.RecipeError, "scens"),
    (lambda s, d, t: str(s.set("render.kind", "fast")), st.RecipeError, "fast"),
    (lambda s, d, t: st.run(s, t, threads=0), ValueError, "threads"),
    (lambda s, d, t: st.run(s, t, threads="2"), TypeError, "threads"),
    (lambda s, d, t: st.run(s, t, threads=True), TypeError, "threads"),
    (lambda s, d, t: st.run(s, t / "x", scenes=range(2, 2)), ValueError, "scenes"),
    (lambda s, d, t: st.run(s, t / "x", scenes=range(0, 4, 2)), ValueError, "steps"),
    (lambda s, d, t: st.run(s, t / "x", scenes=range(2, 9)), st.SyntableError, "0..3"),
    (lambda s, d, t: st.run(s, t / "x", progress=3), TypeError, "progress"),
    (lambda s, d, t: st.run(s, 3), TypeError, "out is a path"),
    (lambda s, d, t: st.run(s, ""), ValueError, "out is an empty path"),
    (lambda s, d, t: st.run("", t / "x"), ValueError, "path is an empty path"),
    (lambda s, d, t: st.run([1], t / "x"), TypeError, "recipe"),
    (lambda s, d, t: st.run(3, t / "x"), TypeError, "recipe"),
    (lambda s, d, t: st.generate(s, "rgb"), TypeError, "list of names"),
    (lambda s, d, t: st.generate(s, [3]), TypeError, "named by text"),
    (lambda s, d, t: next(st.generate(s, ["nonsense"])), st.SyntableError, "nonsense"),
    (lambda s, d, t: st.generate(s, ["rbg"]), st.RecipeError, r"mean `rgb`\? `syntable list products` lists all\n"),
    (lambda s, d, t: st.Views(s, ["rbg"])[0], st.RecipeError, "did you mean `rgb`"),
    (lambda s, d, t: st.open(t / "nowhere"), st.SyntableError, "nowhere"),
    (lambda s, d, t: st.open(d, format="nonsense"), st.SyntableError, "nonsense"),
    (lambda s, d, t: st.open(""), ValueError, "path is an empty path"),
    (lambda s, d, t: st.open(d, image_folder=""), ValueError, "image_folder is an empty path"),
    (lambda s, d, t: st.open(d)[6], IndexError, "image 6 of"),
    (lambda s, d, t: st.open(d)["first"], TypeError, "integer"),
    (lambda s, d, t: st.open(d)[0]["nonsense"], KeyError, "nonsense"),
    (lambda s, d, t: st.open(d)[0].nonsense, AttributeError, "nonsense"),
    (lambda s, d, t: st.run(s, t, shard=3), TypeError, "'3/10' or 'auto'"),
    (lambda s, d, t: st.run(s, t, shard=(3, 3)), ValueError, "numbered from 0"),
    (lambda s, d, t: st.run(s, t, shard="auto"), st.SyntableError, "SLURM_ARRAY_TASK_ID"),
    (lambda s, d, t: st.run(s, t, claim=0.5), TypeError, "claim is an integer"),
    (lambda s, d, t: st.run(s, t, claim=True, lease=0), ValueError, "between 0.001 and 86400"),
    (lambda s, d, t: st.run(s, t, claim=True, overwrite=True), st.SyntableError, "exclude each other"),
    (lambda s, d, t: st.run(s, "ftp://host/x"), st.SyntableError, "`ftp` name no store"),
    (lambda s, d, t: st.open("ftp://host/x"), st.SyntableError, "scheme `ftp` name no store.*path of a folder"),
    (lambda s, d, t: st.status(pathlib.Path("s3://bucket/x")), st.SyntableError, "lost a `/` as a path"),
    (lambda s, d, t: st.status(t), st.SyntableError, "no dataset"),
    (lambda s, d, t: st.status(), TypeError, "status\\('data/mine'\\)"),
    (lambda s, d, t: st.open(d)[0]["rbg"], KeyError, "has no `rbg`: did you mean `rgb`"),
    (lambda s, d, t: next(st.generate(s, ["rgb"]))["amodal_box"], KeyError, "has no `amodal_box`, only camera"),
    (lambda s, d, t: st.open(d)[0].rbg, AttributeError, "has no `rbg`: did you mean `rgb`"),
    (lambda s, d, t: st.open(d)[0][0], TypeError, r"named by text, such as sample\['rgb'\], not 0"),
    (lambda s, d, t: list(st.open(d)[0]), TypeError, "a sample is not iterable: sample.products"),
    (lambda s, d, t: dict(st.open(d)[0]), TypeError, "a sample is not iterable: sample.products"),
    (lambda s, d, t: len(st.open(d)[0]), TypeError, "no len"),
    (lambda s, d, t: st.open(d)[0].read("nonsense"), KeyError, "nonsense"),
    (lambda s, d, t: st.open(d)._raw.sample(6), IndexError, "6 images"),
    (lambda s, d, t: st.open(d)._raw.sample(-1), OverflowError, "negative"),
    (lambda s, d, t: st.open(d)[0]._raw.masks("rgb", [1]), st.SyntableError, "not a mask"),
    (lambda s, d, t: st.convert(d, t / "x"), TypeError, "formats"),
    (lambda s, d, t: st.convert(d, t / "x", "nonsense"), st.SyntableError, "nonsense"),
    (lambda s, d, t: st.convert(d, t / "x", "coco", coco={"nonsense": 1}), st.SyntableError, "nonsense"),
    (lambda s, d, t: st.convert(3, t / "x", "coco"), TypeError, "dataset"),
    (lambda s, d, t: st.convert(d, "", "coco"), ValueError, "out is an empty path"),
    (lambda s, d, t: st.report(d, ""), ValueError, "out is an empty path"),
    (lambda s, d, t: st.validate(t), st.SyntableError, "dataset"),
    (lambda s, d, t: st.stats(d, edges="none"), ValueError, "edges"),
    (lambda s, d, t: st.stats(d, duplicate_levels=300), ValueError, "duplicate_levels"),
    (lambda s, d, t: st.compare(), TypeError, "datasets"),
    (lambda s, d, t: st.plan(s, measured=0), ValueError, "measured"),
    (lambda s, d, t: st.merge([], t / "x"), st.SyntableError, "no part"),
    (lambda s, d, t: st.merge([""], t / "x"), ValueError, r"parts\[0\] is an empty path"),
    (lambda s, d, t: st.verify(t), st.SyntableError, "no dataset"),
    (lambda s, d, t: st.verify(""), ValueError, "dataset is an empty path"),
    (lambda s, d, t: st.validate(""), ValueError, "dataset is an empty path"),
    (lambda s, d, t: st.evaluate(d, ""), ValueError, "predictions is an empty path"),
    (lambda s, d, t: st.view(d, port=70000), ValueError, "port"),
    (lambda s, d, t: st.view(t / "nowhere"), st.SyntableError, "nowhere"),
    (lambda s, d, t: st.preview(s, width=1), ValueError, "width"),
    (lambda s, d, t: st.preview(s.set("render.kind", "fast")), st.RecipeError, "fast"),
    (lambda s, d, t: st.preview(s.set("write", CODE)), st.SyntableError, "brings code of its own.*`allow_code=True`"),
    (lambda s, d, t: next(st.generate(s.set("write", CODE))), st.SyntableError, "`allow_code=True`"),
    (lambda s, d, t: st.Mask(np.zeros((2, 2, 2), bool)), TypeError, "shape .2, 2, 2."),
    (lambda s, d, t: st.Mask(np.zeros((2, 2))), TypeError, "float64"),
    (lambda s, d, t: st.Mask([[True]]), TypeError, "list"),
    (lambda s, d, t: st.Mask.from_rle({"size": [2, 2]}), ValueError, "counts"),
    (lambda s, d, t: st.Mask.from_rle({"size": [2], "counts": "4"}), ValueError, "height and width"),
    (lambda s, d, t: st.Mask.from_rle({"size": [2, 2], "counts": "\x00"}), st.SyntableError, "alphabet"),
    (lambda s, d, t: st.Mask.from_rle({"size": [2, 2], "counts": [9]}), st.SyntableError, "add up to 9"),
    (lambda s, d, t: st.Mask.from_rle({"size": [-1, 2], "counts": [9]}), ValueError, "height and width"),
    (lambda s, d, t: st.Mask.from_rle({"size": [2**31, 2**31], "counts": [1]}), st.SyntableError, "add up to 1"),
]


@pytest.mark.parametrize("number", range(len(CALLS)))
def test_a_wrong_call_is_a_clear_exception(number, small, data, tmp_path, monkeypatch):
    # An empty path must not mean the current folder.
    monkeypatch.chdir(tmp_path)
    call, kind, words = CALLS[number]
    with pytest.raises(kind, match=words) as caught:
        call(small, data, tmp_path)
    assert str(caught.value).strip()
    assert sorted(os.listdir(tmp_path)) == [], "nothing is written"


def test_an_exception_of_a_callback_ends_the_work_and_comes_out(small, data, tmp_path):
    def wrong(event):
        raise ZeroDivisionError(event["event"])

    for work in (
        lambda: st.run(small, tmp_path / "out", progress=wrong),
        lambda: list(st.generate(small, ["rgb"], progress=wrong)),
        lambda: st.preview(small, scenes=0, width=32, progress=wrong),
        lambda: st.Views(small, ["rgb"], progress=wrong)[0],
        lambda: list(st.Stream(small, ["rgb"], progress=wrong)),
    ):
        with pytest.raises(ZeroDivisionError):
            work()
    assert st.run(small, tmp_path / "out").complete


def test_a_closed_generator_is_at_its_end(small):
    samples = st.generate(small, ["rgb"])
    next(samples)
    samples.close()
    samples.close()
    assert list(samples) == [] and samples.failed == []
    forgotten = st.generate(small, ["rgb"])
    next(forgotten)
    del forgotten


def test_threads_share_a_generator(small):
    recipe = small.set("dataset.scenes", 6)
    samples, found = st.generate(recipe, ["rgb"]), []

    def take():
        for sample in samples:
            found.append((sample.scene, sample.view))

    threads = [threading.Thread(target=take) for _ in range(4)]
    [thread.start() for thread in threads]
    [thread.join(60) for thread in threads]
    assert sorted(found) == [(scene, view) for scene in range(6) for view in range(2)]


def test_another_thread_closes_a_generator_that_waits(small):
    slow = small.set("camera.resolution", [640, 480]).set("render.samples_per_pixel", 64)
    samples, ended = st.generate(slow, ["rgb"], threads=1), []

    def take():
        ended.append(list(samples))

    thread = threading.Thread(target=take)
    thread.start()
    time.sleep(0.3)
    samples.close()
    thread.join(30)
    assert not thread.is_alive() and ended == [[]]


def test_pickle_works_or_says_why(small, dataset):
    for one in (small, dataset, st.Views(small), st.Stream(small), st.stats(dataset), st.plan(small)):
        assert repr(pickle.loads(pickle.dumps(one))) == repr(one)
    mask = next(iter(dataset[0]["visible_mask"].values()))
    assert pickle.loads(pickle.dumps(mask)) == mask
    with st.view(dataset) as view, st.generate(small, ["rgb"]) as samples, st.Buffer([1], 1) as buffer:
        stream = iter(st.Stream(small, ["rgb"]))
        for one in (view, samples, buffer, stream):
            with pytest.raises(TypeError, match="cannot be pickled"):
                pickle.dumps(one)
        stream.close()


def test_an_error_says_whether_the_same_call_may_succeed_later(small, data, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "mine.txt").touch()
    shutil.copytree(data, tmp_path / "copy")
    opened = st.open(tmp_path / "copy")
    shutil.rmtree(tmp_path / "copy")
    for call, temporary in [
        (lambda: st.Recipe(tmp_path / "missing.toml"), False),
        (lambda: st.run(small.set("dataset.scens", 3), tmp_path / "new"), False),
        (lambda: st.run(small, tmp_path / "mine"), False),
        # A disk with the folder may be mounted again.
        (lambda: opened[0].rgb, True),
    ]:
        with pytest.raises(st.SyntableError) as raised:
            call()
        assert raised.value.temporary == temporary, raised.value
        assert pickle.loads(pickle.dumps(raised.value)).temporary == temporary


def test_a_sample_keeps_what_it_read_when_the_folder_is_gone(data, tmp_path):
    shutil.copytree(data, tmp_path / "copy")
    opened = st.open(tmp_path / "copy")
    held = opened[0]
    shape = held.rgb.shape
    shutil.rmtree(tmp_path / "copy")
    assert held.rgb.shape == shape and len(opened) == 6
    with pytest.raises(st.SyntableError, match="no such file"):
        opened[1].rgb


def test_a_fork_after_work_is_refused_and_before_it_works(data):
    code, out, errors = script(
        """
        import os, sys
        import syntable as st
        recipe = st.recipe("quickstart").set("camera.resolution", [32, 24]).set("dataset.scenes", 1)
        views, stream = st.Views(recipe, ["rgb"]), st.Stream(recipe, ["rgb"])
        loop = None
        for round in range(2):
            child = os.fork()
            if child == 0:
                try:
                    views[0].rgb
                    next(loop if loop else iter(stream))
                    print("made", flush=True)
                except st.SyntableError as error:
                    print("refused" if "spawn" in str(error) else error, flush=True)
                    samples.close(), views.close(), loop.close(), view.close()
                    del samples, views, loop, view, stream
                    print("closed", flush=True)
                os._exit(0)
            os.waitpid(child, 0)
            views[0].rgb
            loop = iter(stream)
            next(loop)
            samples = st.generate(recipe, ["rgb"])
            next(samples)
            view = st.view(sys.argv[1], threads=1)
        print("end")
        """,
        data,
    )
    assert (code, out.split()) == (0, ["made", "refused", "closed", "end"]), errors


@pytest.mark.parametrize(
    "work",
    [
        "st.run(recipe, 'data')",
        "list(st.generate(recipe, ['rgb']))",
        "st.Views(recipe, ['rgb'])[0]",
        "list(st.Stream(recipe, ['rgb']))",
        "st.Buffer(st.Stream(recipe, ['rgb']), 8, start=8).batch(1)",
        "st.preview(recipe, width=2000, samples=200)",
        "st.plan(recipe, time=True, measured=100)",
    ],
)
def test_ctrl_c_ends_the_work(work, tmp_path):
    started = time.monotonic()
    code, out, errors = script(
        f"""
        import syntable as st
        recipe = st.recipe("quickstart").set("dataset.scenes", 1000).set("render.samples_per_pixel", 200)
        print("begun", flush=True)
        try:
            {work}
        except KeyboardInterrupt:
            print("interrupted", flush=True)
        """,
        interrupt_after="begun",
        folder=tmp_path,
    )
    assert (code, out.split()) == (0, ["begun", "interrupted"]), errors
    assert time.monotonic() - started < 30


def test_python_ends_while_threads_work(tmp_path):
    code, out, errors = script(
        """
        import syntable as st
        recipe = st.recipe("quickstart").set("dataset.scenes", 100).set("place[2].count", 3)
        samples = st.generate(recipe, ["rgb"], threads=1)
        stream = iter(st.Stream(recipe.set("camera.resolution", [32, 24]), ["rgb"]))
        next(stream)
        buffer = st.Buffer(st.Stream(recipe, ["rgb"]), 8)
        views = st.Views(recipe.set("camera.resolution", [32, 24]), ["rgb"])
        views[0]
        print("end")
        """
    )
    assert (code, out.split()) == (0, ["end"]), errors


def test_a_second_interpreter_is_refused():
    interpreters = pytest.importorskip("_xxsubinterpreters")
    here = repr(os.pathsep.join(sys.path))
    code, out, errors = script(
        f"""
        import _xxsubinterpreters as interpreters
        import syntable
        other = interpreters.create()
        try:
            interpreters.run_string(other, "import sys; sys.path[:] = {here}.split(':'); import syntable")
            print("works")
        except interpreters.RunFailedError as error:
            print("refused" if "ImportError" in str(error) else error)
        print("end")
        """
    )
    assert interpreters and code == 0 and out.split()[-1] == "end" and out.split()[0] in ("refused", "works"), errors


def test_cheap_calls_do_not_leak(small, dataset):
    resource = pytest.importorskip("resource")

    def peak():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    sample = dataset[0]
    mask = next(iter(sample["visible_mask"].values()))

    def calls(count):
        for _ in range(count):
            mask.area, mask.box, mask.shape, mask == mask
            dataset._raw.sample(0), sample._raw.names(), small.name
            st.Mask.from_rle(RLE)
            small.set("dataset.scenes", 3)

    calls(2_000)
    before = peak()
    calls(12_000)
    assert peak() - before < 4_000, "KiB more after 10⁵ calls"
