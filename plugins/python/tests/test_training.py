"""Views by number, streams that resume, buffers that grow: all equal to `generate`."""

from __future__ import annotations

import json
import pickle
import sys
import threading

import numpy as np
import pytest

import syntable as st
from conftest import small_recipe

PRODUCTS = ["rgb", "visible_mask"]


@pytest.fixture(scope="module")
def made(small):
    """The samples of the small recipe, by scene and view."""
    return {(one.scene, one.view): one.rgb for one in st.generate(small, PRODUCTS)}


def place(sample):
    return (sample.scene, sample.view)


def tiny(recipe, scenes):
    """The recipe with one object, which is still falling, and with other scenes."""
    settings = {"place[2].count": 1, "camera.resolution": [32, 24], "settle.duration_s": 0.5, "dataset.scenes": scenes}
    for key, value in settings.items():
        recipe = recipe.set(key, value)
    return recipe


def all_equal(samples, made):
    return all(np.array_equal(sample.rgb, made[place(sample)]) for sample in samples)


def test_torch_is_not_imported():
    import subprocess

    code = "import sys, syntable; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0


def test_a_view_is_a_pure_function(small, made):
    views = st.Views(small, PRODUCTS)
    assert len(views) == 6 and views.views_per_scene == 2
    order = [5, 0, 3, -6, 5]
    assert all_equal([views[index] for index in order], made)
    assert [place(views[index]) for index in order] == [(2, 1), (0, 0), (1, 1), (0, 0), (2, 1)]
    assert [place(sample) for sample in views[1:4]] == [(0, 1), (1, 0), (1, 1)]
    views[0].rgb[:] = 0
    assert all_equal([views[0]], made), "samples do not share arrays"
    some = st.Views(small, PRODUCTS, scenes=range(1, 3))
    assert len(some) == 4 and place(some[0]) == (1, 0)


def test_views_keep_their_scenes(small, made):
    images = []
    views = st.Views(small, PRODUCTS, keep=1, progress=lambda event: images.append(event["event"] == "image"))
    for index in (0, 1, 0, 1):
        views[index]
    assert sum(images) == 2
    views[2], views[0]
    assert sum(images) == 6, "one scene is kept, so the first is made again"
    assert all_equal(views.__getitems__([5, 0, 2]), made), "more scenes at once than are kept"
    views.close()
    assert all_equal([views[3]], made)


def test_an_order_shuffles_scenes_and_keeps_them_together(small):
    views = st.Views(small.set("dataset.scenes", 20), PRODUCTS)
    order = views.order(1)
    assert sorted(order) == list(range(40)) and order == views.order(1) != views.order(2)
    scenes = [index // 2 for index in order]
    assert scenes[::2] == scenes[1::2] and scenes[::2] != sorted(scenes[::2])


def test_views_work_in_threads_and_after_pickle(small, made):
    views = pickle.loads(pickle.dumps(st.Views(small, PRODUCTS)))
    found: list = []
    threads = [threading.Thread(target=lambda k=k: found.append(views[k])) for k in range(6)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert len(found) == 6 and all_equal(found, made)


def test_a_stream_has_all_samples_in_passes(small, made):
    stream = st.Stream(small, PRODUCTS)
    for _ in range(2):
        samples = list(stream)
        assert [place(sample) for sample in samples] == sorted(made) and all_equal(samples, made)
        assert stream.state_dict() == {"next": 0}


def test_shards_are_disjoint_and_whole(small, made):
    recipe = tiny(small, 5)
    shards = [[place(sample) for sample in st.Stream(recipe, PRODUCTS, rank=rank, world=3)] for rank in range(3)]
    assert shards[0] == [(0, 0), (0, 1), (3, 0), (3, 1)] and shards[2] == [(2, 0), (2, 1)]
    assert sorted(sum(shards, [])) == [(scene, view) for scene in range(5) for view in range(2)]
    assert list(st.Stream(recipe, PRODUCTS, rank=6, world=7)) == []


@pytest.mark.parametrize(("world", "stops"), [(1, (1, 4)), (2, (2, 3))])
def test_a_stream_resumes_after_any_sample(small, world, stops):
    recipe = tiny(small, 4)
    whole = [place(sample) for sample in st.Stream(recipe, PRODUCTS, rank=0, world=world)]
    for stop in stops:
        first = st.Stream(recipe, PRODUCTS, rank=0, world=world)
        loop = iter(first)
        before = [place(next(loop)) for _ in range(stop)]
        second = pickle.loads(pickle.dumps(st.Stream(recipe, PRODUCTS, rank=0, world=world)))
        second.load_state_dict(first.state_dict())
        rest = [place(sample) for sample in second]
        assert before + rest == whole
        loop.close()


def test_a_broken_loop_goes_on_where_it_stopped(small):
    stream = st.Stream(small, PRODUCTS)
    for sample in stream:
        if place(sample) == (1, 0):
            break
    assert [place(sample) for sample in stream] == [(1, 1), (2, 0), (2, 1)]
    loops = iter(stream), iter(stream)
    next(loops[1])
    with pytest.raises(RuntimeError, match="another loop"):
        next(loops[0])


def test_an_endless_stream_begins_like_the_recipe_and_goes_on(small, made):
    stream = st.Stream(small, PRODUCTS, endless=True, threads=2)
    seen = []
    for sample in stream:
        seen.append(sample)
        if len(seen) == 8:
            break
    assert [place(sample) for sample in seen] == [(number // 2, number % 2) for number in range(8)]
    assert all_equal(seen[:6], made)
    stream.load_state_dict({"next": 20})
    assert place(next(iter(stream))) == (10, 0)


def test_a_buffer_draws_reproducibly(small):
    def drawn(threads):
        stream = st.Stream(tiny(small, 6), ["visible_ids"], threads=threads)
        with st.Buffer(stream, 4, start=2, reuse=2, seed=5, transform=place) as buffer:
            batches = [buffer.batch(2) for _ in range(12)]
            assert len(buffer) == 4 and buffer.taken == 12
        return batches

    batches = drawn(1)
    assert batches == drawn(2)
    assert len(set(sum(batches, []))) > 6
    # The buffer holds the latest samples.
    assert all(scene >= 3 for scene, _ in batches[-1])


@pytest.mark.parametrize("scenes", [6, None])
@pytest.mark.parametrize("stop", [0, 1, 5, 9])
def test_a_buffer_continues_from_its_state(small, stop, scenes):
    def buffer():
        recipe = tiny(small, scenes or 3)
        stream = st.Stream(recipe, ["visible_ids"], rank=1, world=2, endless=scenes is None)
        stream.load_state_dict({"next": 1})
        return st.Buffer(stream, 4, start=2, reuse=2, seed=5, transform=place)

    with buffer() as whole:
        batches = [whole.batch(2) for _ in range(12)]
    with buffer() as first:
        before = [first.batch(2) for _ in range(stop)]
        # What torch.save and JSON keep.
        state = json.loads(json.dumps(first.state_dict()))
    with buffer() as second:
        second.batch(3)
        second.load_state_dict(state)
        assert second.state_dict() == state and second.taken == first.taken
        assert before + [second.batch(2) for _ in range(12 - stop)] == batches


def test_states_of_buffers_are_checked(small):
    def buffer(size=2, **more):
        return st.Buffer(st.Stream(tiny(small, 4), ["visible_ids"], **more), size, transform=place)

    with buffer() as one:
        one.batch(2)
        one.batch(32)
        state = one.state_dict()
    assert len(state["held"]) == 2
    with pytest.raises(ValueError, match="closed"):
        one.state_dict()
    for make, wrong, kind, words in [
        (lambda: buffer(3), state, ValueError, "of a buffer of 2 samples, and this one holds 3"),
        (buffer, {"next": 3}, TypeError, "what its state_dict"),
        (buffer, state | {"held": [0]}, TypeError, "does not hold 1 samples"),
        (buffer, state | {"held": [3, 7]}, ValueError, "the stream has view 4 where it had view 7"),
        (lambda: buffer(rank=0, world=4), state | {"held": [1, 2]}, ValueError, "the stream ends where it had view 2"),
        (lambda: st.Buffer([1, 2], 2), state, TypeError, "only a buffer of a Stream has a state.*of a list"),
    ]:
        with make() as another:
            with pytest.raises(kind, match=words):
                another.load_state_dict(wrong)
            if kind is ValueError and "stream" in words:
                with pytest.raises(ValueError, match="the buffer is closed"):
                    another.batch(1)


def test_a_buffer_without_reuse_never_waits():
    with st.Buffer(iter(range(100)), 10, reuse=None, start=10) as buffer:
        assert sorted(buffer.batch(10)) == list(range(10)) or buffer.taken > 10
        assert len(buffer.batch(30)) == 30, "with repetition"
    with pytest.raises(ValueError, match="closed"):
        buffer.batch(1)


def test_a_buffer_passes_errors_on():
    def wrong():
        yield 1
        raise OSError("the disk is gone")

    with st.Buffer(wrong(), 10, start=5) as buffer, pytest.raises(OSError, match="disk is gone"):
        buffer.batch(1)
    with st.Buffer([], 10) as buffer, pytest.raises(ValueError, match="no sample"):
        buffer.batch(1)


def test_wrong_arguments_are_named(small):
    for make, kind, words in [
        (lambda: st.Views(small, "rgb"), TypeError, "list of names"),
        (lambda: st.Views(small, keep=0), ValueError, "keep"),
        (lambda: st.Views(small, scenes=range(2, 9)), ValueError, "3 scenes"),
        (lambda: st.Views(small)[6], IndexError, "view 6 of 6"),
        (lambda: st.Views(small)["0"], TypeError, "integer"),
        (lambda: st.Views(small.set("dataset.scens", 1)), st.RecipeError, "scens"),
        (lambda: st.Views(small, ["nonsense"])[0], st.SyntableError, "nonsense"),
        (lambda: st.Stream(small, rank=1), ValueError, "together"),
        (lambda: st.Stream(small, rank=2, world=2), ValueError, "below world"),
        (lambda: st.Stream(small, scenes=3, endless=True), ValueError, "endless"),
        (lambda: st.Stream(small).load_state_dict({"step": 1}), TypeError, "'next'"),
        (lambda: st.Stream(small).load_state_dict({"next": -1}), ValueError, "next"),
        (lambda: st.Buffer(small, 10), TypeError, "not iterable"),
        (lambda: st.Buffer([], 0), ValueError, "size"),
        (lambda: st.Buffer([], 2, start=3), ValueError, "start"),
        (lambda: st.Buffer([], 2, reuse=0), ValueError, "reuse"),
        (lambda: st.Buffer([], 2, transform=3), TypeError, "transform"),
    ]:
        with pytest.raises(kind, match=words):
            make()


def test_a_scene_that_fails_is_an_error_of_its_views():
    # After a twentieth of a second, everything is still falling, and moving objects are removed.
    recipe = small_recipe(
        **{
            "place[2].count": 1,
            "settle.on_violation": "remove",
            "settle.max_speed_m_s": 0.0001,
            "settle.duration_s": 0.05,
            "dataset.max_attempts": 2,
        }
    )
    views = st.Views(recipe, PRODUCTS)
    for index in (0, 3, 1):
        with pytest.raises(st.SyntableError, match=f"scene {index // 2} has no views: .*still moving"):
            views[index]
    assert list(st.Stream(recipe, PRODUCTS)) == []
