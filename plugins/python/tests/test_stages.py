"""Annotators, sensors and writers in Python: in samples, runs, conversions, diagnostics and the command."""

from __future__ import annotations

import _thread
import csv
import dataclasses
import gc
import json
import pathlib
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field
from typing import Annotated, Literal, Optional

import numpy as np
import pytest

import syntable as st

EXAMPLE = pathlib.Path(__file__).parents[1] / "examples" / "my_stages.py"


def small(**changes):
    """The quickstart with one scene of two small images."""
    recipe = st.recipe("quickstart")
    settings = {
        "dataset__scenes": 1,
        "dataset__views_per_scene": 2,
        "camera__resolution": [64, 48],
        "render__samples_per_pixel": 1,
        "place[2]__count": {"integers": [2, 4]},
        "settle__duration_s": 1.0,
    }
    for key, value in (settings | changes).items():
        recipe = recipe.set(key.replace("__", "."), value)
    return recipe


def sample(*products, **changes):
    """The first sample of the small recipe, with these products."""
    with st.generate(small(**changes), products, threads=2) as samples:
        return next(samples)


@dataclass
class Threshold:
    threshold: Annotated[float, st.Range(0, 1)] = 0.2
    "Share of white below which a pixel is dark."


@st.annotator(
    reads=["rgb", "visible_mask"],
    provides={"test_darkness": st.PerObject(float, doc="Share of dark pixels.", unit="")},
    options=Threshold,
)
def test_darkness_of(view, options):
    "Share of dark pixels of each object. More text."
    dark = view.rgb.mean(-1) < 255 * options.threshold
    return {id: float(dark[mask].mean()) for id, mask in zip(view.ids, view.visible_masks) if mask.any()}


test_darkness_of.__test__ = False
KIND = "test_darkness_of"


@dataclass
class Nested:
    low: int = 1
    word: Literal["a", "b"] = "a"


@dataclass
class Everything:
    """Attributes:
    flag: A flag
        on two lines.
    """

    must: int
    flag: bool = True
    share: Annotated[float, "A share.", st.Range(0, 1)] = 0.5
    words: list[str] = field(default_factory=lambda: ["x"], metadata={"doc": "Some words."})
    pair: tuple[float, float] = (1.0, 2.0)
    limit: Optional[int] = None
    nested: Nested = field(default_factory=Nested)
    table: dict[str, float] = field(default_factory=dict)
    count: int = field(default=3, metadata={"range": st.Range(1, None)})


# --- annotators


def darkness_by_hand(it, threshold):
    dark = it.rgb.astype(float).mean(-1) < 255 * threshold
    return {i: dark[m].mean() for i, m in zip(it.ids.tolist(), it.visible_masks) if m.any()}


def test_generate_gives_what_numpy_gives():
    it = sample("rgb", "visible_mask", "test_darkness")
    assert it.test_darkness == pytest.approx(darkness_by_hand(it, 0.2)) and it.test_darkness
    it = sample("rgb", "visible_mask", "test_darkness", **{f"annotate__{KIND}": {"threshold": 0.6}})
    assert it.test_darkness == pytest.approx(darkness_by_hand(it, 0.6))


def test_samples_do_not_depend_on_threads():
    @st.annotator(reads=["depth"], provides={"test_noise": st.Image("float64")})
    def test_noisy(view):
        return view.rng.normal(size=view.shape) + view.depth

    def noise(threads, scenes):
        recipe = small(dataset__scenes=3)
        return {
            (it.scene, it.view): it.test_noise
            for it in st.generate(recipe, ["test_noise"], scenes=scenes, threads=threads)
        }

    one, two, last = noise(1, None), noise(4, None), noise(2, range(2, 3))
    assert list(one) == [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)] and list(last) == [(2, 0), (2, 1)]
    assert all(np.array_equal(one[at], two[at]) for at in one)
    assert all(np.array_equal(one[at], last[at]) for at in last)
    assert not np.array_equal(one[0, 0], one[0, 1]) and not np.array_equal(one[0, 0], one[1, 0])


PROVIDES = {
    "test_bool": (bool, lambda view: np.bool_(True), True),
    "test_int": (int, lambda view: np.int32(7), 7),
    "test_float": (st.Value(float, unit="m"), lambda view: 2, 2.0),
    "test_str": (str, lambda view: "ä", "ä"),
    "test_dict": (dict, lambda view: {"a": 1, "b": [1.5, "x"]}, {"a": 1, "b": [1.5, "x"]}),
    "test_list": (list, lambda view: np.arange(3), [0, 1, 2]),
    "test_texts": (list, lambda view: ["a", "b"], ["a", "b"]),
    "test_ragged": (list, lambda view: [[1], [2, 3]], [[1], [2, 3]]),
    "test_mixed": (list, lambda view: [1, "x", {"y": None}], [1, "x", {"y": None}]),
    "test_varied": (list, lambda view: [1, 2] if view.view else ["x"], lambda it: [1, 2] if it.view else ["x"]),
    "test_lists": (
        st.PerObject(list),
        lambda view: {id: [int(id), "x"] for id in view.ids},
        lambda it: {i: [i, "x"] for i in it.ids},
    ),
    "test_image": (
        st.Image("float32", channels=3),
        lambda view: np.ones((*view.shape, 3), "float32"),
        np.ones((48, 64, 3)),
    ),
    "test_flags": (st.Image("bool"), lambda view: view.depth > 1e9, np.zeros((48, 64))),
    "test_half": (st.Image("float16", channels=1), lambda view: np.ones((48, 64, 1), "f2"), np.ones((48, 64, 1))),
    "test_ids": (st.Image(np.uint16, meaning="label"), lambda view: np.full((48, 64), 9, "u2"), np.full((48, 64), 9)),
    "test_tensor": (
        st.Tensor("int64", shape=(None, 2)),
        lambda view: np.arange(6).reshape(3, 2),
        [[0, 1], [2, 3], [4, 5]],
    ),
    "test_empty": (st.Tensor("float64"), lambda view: np.zeros((0, 4)), np.zeros((0, 4))),
    "test_each": (
        st.PerObject(int),
        lambda view: {id: int(id) * 2 for id in view.ids},
        lambda it: {i: 2 * i for i in it.ids},
    ),
    "test_rows": (st.PerObject(float), lambda view: view.ids / 2, lambda it: {i: i / 2 for i in it.ids}),
    "test_none": (st.PerObject(str), lambda view: {}, {}),
    "test_yes": (st.PerObject(bool), lambda view: view.ids > 0, lambda it: {i: True for i in it.ids}),
    "test_text": (st.PerObject(str), lambda view: [f"o{i}" for i in view.ids], lambda it: {i: f"o{i}" for i in it.ids}),
    "test_record": (st.PerObject(dict), lambda view: {1: {"a": 1}}, {1: {"a": 1}}),
}


def test_every_type_comes_back():
    @st.annotator(reads=["depth", "visible_mask"], provides={name: it for name, (it, _, _) in PROVIDES.items()})
    def test_everything(view):
        return {name: make(view) for name, (_, make, _) in PROVIDES.items()}

    it = sample(*PROVIDES)
    for name, (declared, _, expected) in PROVIDES.items():
        got = it[name]
        expected = expected(it) if callable(expected) else expected
        if isinstance(declared, (st.Image, st.Tensor)):
            assert isinstance(got, np.ndarray) and got.dtype.name == declared.dtype, name
            assert np.array_equal(got, expected), name
        else:
            assert got == expected, name


STORED = {
    "npz": [name for name in PROVIDES if name not in ("test_none", "test_record")],
    "webdataset": list(PROVIDES),
    "hdf5": list(PROVIDES),
    "parquet": [name for name, (declared, *_) in PROVIDES.items() if not isinstance(declared, (st.Image, st.Tensor))],
}


@pytest.mark.parametrize("kind", STORED)
def test_own_products_come_back_from_files(kind, tmp_path):
    @st.annotator(reads=["depth", "visible_mask"], provides={name: it for name, (it, _, _) in PROVIDES.items()})
    def test_everything(view):
        return {name: make(view) for name, (_, make, _) in PROVIDES.items()}

    names = STORED[kind]
    writers = {"syntable": {}, kind: {"include": ["visible_mask", "normal"] if kind == "npz" else ["visible_mask"]}}
    writers[kind]["include"] = writers[kind]["include"] + names
    out = tmp_path / "data"
    st.run(small(write=writers), out, progress=False)
    with_images, alone = st.open(out), st.open(out / kind)
    assert with_images.format == "syntable" and alone.format == kind
    assert set(names) <= set(with_images.products) and set(names) <= set(alone.products)
    views = list(st.generate(small(dataset__scenes=1), names, threads=2))
    for stored, made in [(with_images[0], views[0]), (alone[0], views[0]), (with_images[1], views[1])]:
        for name in names:
            got, expected = stored[name], made[name]
            if isinstance(expected, np.ndarray):
                assert got.dtype == expected.dtype and np.array_equal(got, expected), name
            else:
                assert got == expected and type(got) is type(expected), name
    made = sample("rgb", "normal")
    assert np.array_equal(with_images[0].rgb, made.rgb)
    assert kind != "npz" or np.array_equal(with_images[0].normal, made.normal, equal_nan=True)


def test_a_damaged_companion_keeps_the_rest(tmp_path):
    out = tmp_path / "data"
    st.run(small(write={"syntable": {}, "npz": {"include": ["test_darkness"]}}), out, progress=False)
    declared = (out / "npz/products.json").read_text()
    dataset = st.open(out)
    assert dataset[0].test_darkness and not dataset.left_out
    sorted((out / "npz").rglob("*.npz"))[0].unlink()
    dataset = st.open(out)
    assert len(dataset.left_out) == 1 and "1 image lacks test_darkness" in dataset.left_out[0]
    (out / "npz/products.json").write_text(declared.replace("float per object", "no form"))
    dataset = st.open(out)
    it = dataset[0]
    assert "test_darkness" not in it and "rgb" in it.products and it.rgb.any() and not hasattr(it, "nope")
    assert len(dataset.left_out) == 1 and "products.json" in dataset.left_out[0]


def test_tensors_of_torch():
    torch = pytest.importorskip("torch")

    @st.annotator(reads=["depth"], provides={"test_torch": st.Image("float32"), "test_mean": float})
    def test_net(view):
        depth = torch.from_numpy(view.depth).requires_grad_()
        return {"test_torch": 2 * depth, "test_mean": depth.mean()}

    it = sample("depth", "test_torch", "test_mean")
    assert np.array_equal(it.test_torch, 2 * it.depth) and it.test_mean == pytest.approx(it.depth.mean())


def test_masks_of_objects():
    @st.annotator(reads=["visible_mask"], provides={"test_left_mask": st.PerObject(st.Mask, doc="The left half.")})
    def test_left(view):
        left = np.arange(view.shape[1]) < view.shape[1] // 2
        return view.visible_masks & left

    it = sample("visible_mask", "test_left_mask")
    assert all(isinstance(mask, st.Mask) for mask in it.test_left_mask.values())
    for id, mask in zip(it.ids, it.visible_masks):
        assert np.array_equal(it.test_left_mask[id].array()[:, :32], mask[:, :32])
        assert not it.test_left_mask[id].array()[:, 32:].any()


def test_an_annotator_of_the_scene_has_camera_and_bodies():
    @st.annotator(reads=["visible_mask"], provides={"test_seen": dict}, scene=True)
    def test_scene(view):
        objects = {o.id: o for o in view.objects}
        bodies = {b.id: b for b in view.bodies}
        for id, one in objects.items():
            assert np.allclose(bodies[id].world_from_body, one.world_from_object, atol=1e-6)
            assert bodies[id].role == "object" and bodies[id].world_from_body.shape == (4, 4)
            assert (bodies[id].bounds[0] < bodies[id].bounds[1]).all()
        return {"K": view.camera.K, "roles": sorted({b.role for b in bodies.values()}), "objects": len(objects)}

    it = sample("test_seen")
    assert np.allclose(it.test_seen["K"], it.camera.K) and {"object", "room"} <= set(it.test_seen["roles"])
    assert it.test_seen["objects"] == len(it.objects) > 0


def test_annotators_read_each_others_products():
    @st.annotator(reads=["depth"], provides={"test_far": float})
    def test_farthest(view):
        return view.depth.max()

    @st.annotator(reads=["test_far"], provides={"test_twice": float})
    def test_doubled(view):
        return 2 * view.test_far

    it = sample("depth", "test_twice")
    assert it.test_twice == 2 * float(it.depth.max())


def test_a_cell_that_runs_again_replaces_its_stage():
    for number in (1, 2):

        @st.annotator(reads=[], provides={"test_number": int})
        def test_cell(view):
            return number

        assert sample("test_number").test_number == number
    # Its product may have another type, too.

    @st.annotator(reads=[], provides={"test_number": str})
    def test_cell(view):
        return "three"

    assert sample("test_number").test_number == "three"


# --- options


def test_options_have_defaults_types_and_limits():
    seen = []

    @st.annotator(reads=[], provides={"test_options": int}, options=Everything)
    def test_optioned(view, options):
        seen.append(options)
        return 1

    recipe = small(
        annotate__test_optioned={"must": 4, "share": 1, "nested": {"low": 2}, "pair": [3, 4], "table": {"k": 5}}
    )
    with st.generate(recipe, ["test_options"]) as samples:
        next(samples)
    expected = Everything(4, share=1.0, nested=Nested(2), pair=(3.0, 4.0), table={"k": 5.0})
    assert seen[0] == expected and isinstance(seen[0].share, float) and isinstance(seen[0].pair, tuple)
    table = pytest.importorskip("tomllib").loads(str(recipe))["annotate"]["test_optioned"]
    assert table.pop("kind", "test_optioned") == "test_optioned"
    without_none = {name: value for name, value in dataclasses.asdict(expected).items() if value is not None}
    assert table == without_none | {"pair": [3.0, 4.0]}
    assert [it.code for it in st.Recipe.from_toml(str(recipe)).check()] == [it.code for it in recipe.check()]
    for table, says in [
        ({}, "must"),
        ({"must": 1, "share": 1.5}, "1"),
        ({"must": 1, "count": 0}, "count"),
        ({"must": 1.5}, "integer"),
        ({"must": 1, "nested": {"word": "c"}}, "c"),
        ({"must": 1, "pair": [1]}, "pair"),
        ({"must": 1, "shard": 0.5}, "share"),
    ]:
        with pytest.raises(st.RecipeError, match=says):
            small(annotate__test_optioned=table).check()


def test_unknown_keys_and_kinds_get_suggestions():
    with pytest.raises(st.RecipeError) as raised:
        small(**{f"annotate__{KIND}": {"thresholds": 0.5}}).check()
    assert "did you mean" in str(raised.value) and "threshold" in str(raised.value)
    with pytest.raises(st.RecipeError, match=KIND):
        small(annotate__test_darknes_of={}).check()
    with pytest.raises(st.RecipeError, match="test_darkness"):
        st.generate(small(), ["test_darknes"])


def test_a_dataclass_can_refuse_its_options():
    @dataclass
    class Ordered:
        low: float = 0
        high: float = 1

        def __post_init__(self):
            if self.low > self.high:
                raise ValueError(f"low = {self.low} is above high = {self.high}")

    @st.annotator(reads=[], provides={"test_ordered": int}, options=Ordered)
    def test_order(view, options):
        return 1

    with pytest.raises(st.RecipeError, match="low = 2.0 is above high = 1"):
        small(annotate__test_order={"low": 2}).check()


# --- mistakes


def endless():
    tree = {"name": "root"}
    tree["children"] = [{"parent": tree}]
    return tree


def nested(levels):
    value = []
    for _ in range(levels):
        value = [value]
    return value


MISTAKES = [
    (dict, lambda view: endless(), "nested more than 64 deep; does it contain itself"),
    (list, lambda view: nested(100_000), "nested more than 64 deep"),
    (st.PerObject(dict), lambda view: {1: endless()}, "object 1: its parts are nested more than 64 deep"),
    (int, lambda view: 2**63, "an int has 64 bits; found 9223372036854775808"),
    (dict, lambda view: {"a": [2**70]}, "an int has 64 bits"),
    (st.PerObject(str), lambda view: {1: "\ud800"}, "object 1: a text is valid Unicode; found '\\ud800'"),
    (float, lambda view: "x", "float is expected; found 'x', a str"),
    (float, lambda view: None, "does the function return its result"),
    (float, lambda view: np.zeros(2), "float is expected; found an array of float64 with shape (2,)"),
    (int, lambda view: 1.5, "int is expected; found 1.5"),
    (int, lambda view: True, "int is expected; found True"),
    (bool, lambda view: 1, "bool is expected"),
    (dict, lambda view: {1: 2}, "dict with text as keys is expected"),
    (str, lambda view: b"x", "str is expected"),
    (st.Image("float32"), lambda view: view.depth.astype("f8"), ".astype('float32')"),
    (
        st.Image("float32"),
        lambda view: view.depth.T,
        "shape (48, 64) is expected; found an array of float32 with shape (64, 48)",
    ),
    (st.Image("float32"), lambda view: 1.0, "an array of float32"),
    (st.Tensor("float32", shape=(None, 2)), lambda view: np.zeros((2, 3), "f4"), "shape (any, 2)"),
    (st.PerObject(float), lambda view: {999: 1.0}, "999 is no object of the view; its ids: 1, 2"),
    (st.PerObject(float), lambda view: {"1": 1.0}, "'1' is no object"),
    (st.PerObject(float), lambda view: {1: "x"}, "object 1: float is expected"),
    (st.PerObject(float), lambda view: [1.0] * 99, "a dict from ids, or a value for each of the"),
    (st.PerObject(st.Mask), lambda view: {1: np.zeros((3, 3), bool)}, "object 1: an array of bool with shape (48, 64)"),
    (st.PerObject(st.Mask), lambda view: {1: st.Mask(np.zeros((3, 3), bool))}, "object 1: a mask of shape (48, 64)"),
]


@pytest.mark.parametrize("number", range(len(MISTAKES)))
def test_a_wrong_value_names_stage_product_and_type(number):
    declared, function, says = MISTAKES[number]

    @st.annotator(reads=["depth", "visible_mask"], provides={"test_wrong": declared})
    def test_mistake(view):
        return function(view)

    with pytest.raises(st.SyntableError) as raised:
        sample("test_wrong")
    text = str(raised.value)
    assert says in text and "annotate.test_mistake" in text and "`test_wrong`" in text
    assert raised.value.file == __file__ and raised.value.line == test_mistake.__code__.co_firstlineno


def test_an_exception_has_its_traceback(tmp_path):
    def divide(by):
        return 1 / by

    @st.annotator(reads=[], provides={"test_broken": float})
    def test_failing(view):
        return divide(0)

    with pytest.raises(st.SyntableError) as raised:
        sample("test_broken")
    text = str(raised.value)
    assert "ZeroDivisionError: division by zero" in text and "return 1 / by" in text and "in test_failing" in text
    assert raised.value.file == __file__ and raised.value.line == divide.__code__.co_firstlineno + 1
    with pytest.raises(st.SyntableError, match="ZeroDivisionError"):
        st.run(small().set("write.npz", {"include": ["test_broken"]}), tmp_path / "data", progress=False)


def test_only_declared_products_can_be_read():
    @st.annotator(reads=["depth"], provides={"test_undeclared": float})
    def test_reader(view):
        return view.rgb.mean()

    with pytest.raises(
        st.SyntableError, match=r"the stage does not read `rgb`: add it to reads=\[…\], which has depth"
    ):
        sample("rgb", "test_undeclared")


def annotate(function=lambda view: 1, **changes):
    function.__name__ = "test_declaration"
    return st.annotator(**({"reads": [], "provides": {"test_x": float}} | changes))(function)


@pytest.mark.parametrize(
    ("changes", "error", "says"),
    [
        ({"reads": "rgb"}, TypeError, "reads is a list"),
        ({"reads": [1]}, TypeError, "named by text, not 1"),
        ({"reads": ["rbg"]}, ValueError, "no stage provides `rbg`: did you mean `rgb`?"),
        ({"provides": {}}, TypeError, "provides is a dict"),
        ({"provides": ["a"]}, TypeError, "provides is a dict"),
        ({"provides": {"A b": float}}, ValueError, "snake_case"),
        ({"provides": {"test_x": "float"}}, TypeError, "not 'float'"),
        ({"provides": {"test_x": st.Image}}, TypeError, "needs its type"),
        ({"provides": {"visible_box": float}}, ValueError, "a product of the library"),
        ({"options": dict}, TypeError, "options is a dataclass"),
        ({"name": "masks_and_boxes!"}, ValueError, "snake_case"),
        ({"function": lambda: 1}, TypeError, r"is called as test_declaration\(view\)"),
        (
            {"function": lambda view: 1, "options": Threshold},
            TypeError,
            r"is called as test_declaration\(view, options\)",
        ),
    ],
)
def test_mistakes_of_declarations(changes, error, says):
    with pytest.raises(error, match=says):
        annotate(**changes)


def test_mistakes_of_types():
    for make, error in [
        (lambda: st.Image("float128"), ValueError),
        (lambda: st.Image("float32", channels=5), ValueError),
        (lambda: st.Image("float32", meaning="heat"), ValueError),
        (lambda: st.Tensor("object"), ValueError),
        (lambda: st.PerObject(set), TypeError),
        (lambda: st.Value(complex), TypeError),
        (lambda: st.Range(1, 0), ValueError),
        (lambda: st.Range("a"), TypeError),
    ]:
        with pytest.raises(error):
            make()

    @dataclass
    class Odd:
        when: complex = 1j

    with pytest.raises(TypeError, match="Odd.when: a recipe has no complex"):
        annotate(lambda view, options: 1, options=Odd)


def test_a_stock_kind_is_not_replaced():
    with pytest.raises(ValueError, match="`coco` is a kind of `write` already"):

        @st.writer(reads=["rgb"], name="coco")
        class Mine:
            def write(self, view, out):
                pass


def test_views_of_a_stage_stay_valid_and_private():
    kept = []

    @st.annotator(reads=["depth"], provides={"test_kept": float})
    def test_keeper(view):
        view.depth[:] = -1
        kept.append(view)
        return 0.0

    it = sample("depth", "test_kept")
    gc.collect()
    assert it.depth.max() > 0 and (kept[0].depth == -1).all()
    with pytest.raises(AttributeError, match="does not read `rgb`"):
        kept[0].rgb
    with pytest.raises(TypeError, match="does not take the scene"):
        kept[0].bodies


@pytest.mark.parametrize("makes", ["generate", "run", "close"])
def test_an_interrupt_ends_a_stage(makes, tmp_path):
    started, ended = threading.Event(), []

    @st.annotator(reads=[], provides={"test_endless": float})
    def test_loop(view):
        started.set()
        try:
            while True:
                time.sleep(0.001)
        finally:
            ended.append(view)

    def interrupt():
        started.wait()
        _thread.interrupt_main()

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        if makes == "generate":
            next(st.generate(small(dataset__scenes=50), ["test_endless"], threads=2))
        elif makes == "close":
            with st.generate(small(dataset__scenes=50), ["test_endless"], threads=2):
                thread.join()
                time.sleep(10)
        else:
            recipe = small(dataset__scenes=50, write={"npz": {"include": ["test_endless"]}})
            st.run(recipe, tmp_path / "data", progress=False)
    thread.join()
    assert ended


def test_the_version_of_a_module_is_recorded(monkeypatch):
    monkeypatch.setitem(globals(), "__version__", "7")

    @st.annotator(reads=[], provides={"test_versioned": float})
    def test_version(view):
        return 0.0

    recipe = small(write={"npz": {"include": ["test_versioned"]}})
    assert f'{__name__} = "7"' in str(recipe)


CONTINUED = """
import syntable as st

@st.annotator(reads=["depth"], provides={"test_continued": float})
def test_continued(view):
    depth = view.depth.RULE()
    return float(depth)
"""


def test_changed_code_does_not_continue_a_dataset(tmp_path):
    plugin, recipe = tmp_path / "my_rules.py", tmp_path / "recipe.toml"
    recipe.write_text(str(small(write={"jsonl": {"include": ["camera"]}})))

    def run(rule, scenes, comment=""):
        plugin.write_text(CONTINUED.replace("RULE()", f"{rule}()  {comment}"))
        write = 'write.jsonl.include=["test_continued"]'
        settings = ["--set", write, "--set", f"dataset.scenes={scenes}", "--out", tmp_path / "data"]
        command = [sys.executable, "-m", "syntable", "--plugin", plugin, "run", recipe, *settings]
        return subprocess.run(command, capture_output=True, text=True, timeout=120)

    assert run("min", 1).returncode == 0
    changed = run("max", 2)
    assert changed.returncode == 2 and "my_rules.test_continued" in changed.stderr, changed.stderr
    same = run("min", 2, comment="# another comment")
    assert same.returncode == 0, same.stderr


BLOCKED = """
import os, signal, sys, threading, time
import syntable as st

def interrupts():
    begun.wait()
    for _ in range(2):
        time.sleep(0.5)
        os.kill(os.getpid(), signal.SIGINT)

begun = threading.Event()
# A shell may start a background process with the signal ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)

@st.annotator(reads=[], provides={"test_blocked": float})
def test_blocked(view):
    begun.set()
    time.sleep(100)
    return 0.0

def main():
    recipe = st.recipe("quickstart").set({"camera.resolution": [64, 48], "render.samples_per_pixel": 1})
    threading.Thread(target=interrupts, daemon=True).start()
    try:
        WORK
    except KeyboardInterrupt:
        print("interrupted", flush=True)

main()
"""


@pytest.mark.parametrize(
    "work",
    [
        'list(st.generate(recipe, ["test_blocked"]))',
        'st.run(recipe.set("write", {"jsonl": {"include": ["test_blocked"]}}), sys.argv[1])',
        'st.Views(recipe, ["test_blocked"])[0]',
        'next(iter(st.Stream(recipe, ["test_blocked"])))',
        'st.Buffer(st.Stream(recipe, ["test_blocked"]), 2).batch(1)',
    ],
)
def test_two_interrupts_end_a_blocked_stage(work, tmp_path):
    script = tmp_path / "blocked.py"
    script.write_text(BLOCKED.replace("WORK", work))
    start = time.monotonic()
    ended = subprocess.run([sys.executable, script, tmp_path / "data"], capture_output=True, text=True, timeout=60)
    assert "interrupted" in ended.stdout, ended.stderr
    assert ended.returncode >= 0 and time.monotonic() - start < 30


@pytest.mark.parametrize("lasts", ["time.sleep(0.05)", "while view: pass"])
def test_python_ends_while_a_stage_runs(lasts, tmp_path):
    script = tmp_path / "ends.py"
    script.write_text(
        "import sys, time\n"
        "import syntable as st\n"
        "running = []\n"
        "@st.annotator(reads=[], provides={'test_slow': float})\n"
        "def test_slow(view):\n"
        "    running.append(view)\n"
        f"    {lasts}\n"
        "    return 0.0\n"
        "recipe = st.recipe('quickstart').set('dataset.scenes', 1000).set('camera.resolution', [32, 24])\n"
        "recipe = recipe.set('render.samples_per_pixel', 1).set('settle.duration_s', 0.5).set('place[2].count', 2)\n"
        "sys.modules['keeps'] = st.generate(recipe, ['test_slow'])\n"
        "while not running:\n"
        "    time.sleep(0.01)\n"
        "print('ends', flush=True)\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout, done.stderr) == (0, "ends\n", "")


# --- sensors


def test_a_sensor_provides_and_replaces():
    @dataclass
    class Grain:
        sigma: float = 4.0

    color = st.Image("uint8", channels=3, meaning="color")

    @st.sensor(reads=["rgb"], provides={"test_grainy": color}, options=Grain)
    def test_grain(view, options):
        return (view.rgb + view.rng.normal(0, options.sigma, view.rgb.shape)).clip(0, 255).astype(np.uint8)

    @st.sensor(provides={"rgb": color}, replaces={"rgb": "rgb_upright"})
    def test_mirror(view):
        return view.rgb_upright[:, ::-1].copy()

    it = sample("rgb", "test_grainy")
    difference = it.test_grainy.astype(int) - it.rgb
    assert 3 < difference[(it.rgb > 20) & (it.rgb < 235)].std() < 5
    mirrored = sample("rgb", sensor__test_mirror={})
    assert np.array_equal(mirrored.rgb, it.rgb[:, ::-1])


# --- lights, placers, sources of assets


def test_lights():
    seen = []

    @dataclass
    class Bulb:
        nits: float = 500.0

    @st.light(options=Bulb)
    def test_bulb(scene, options):
        center = next(iter(scene.supports.values())).center
        seen.append((scene.camera.K.shape, len(scene.bodies), scene.rng.random()))
        return [
            {"type": "directional", "towards": (0, 0, 1), "half_angle": 0.05, "irradiance": 10},
            {
                "type": "sphere",
                "center": center + (0, 0, 1),
                "radius": 0.05,
                "radiance": (options.nits, options.nits, 0),
            },
            {"type": "rect", "center": center + (0, 0, 1), "half_u": (0.1, 0, 0), "half_v": (0, 0.1, 0), "radiance": 1},
            {"type": "disk", "center": center + (0, 0, 1), "normal": (0, 0, -2), "radius": 0.1, "radiance": 1},
        ]

    shares = []
    for nits in (0, 1e6):
        it = sample("radiance", lights=[{"kind": "test_bulb", "nits": nits}])
        red, _, blue = it.radiance.mean(axis=(0, 1))
        shares.append(blue / red)
    # The yellow light drowns the blue one.
    assert shares[1] < 0.1 * shares[0]
    assert seen[0][0] == (3, 3) and seen[0][1] > 5 and len({noise for _, _, noise in seen}) > 1

    for wrong, says in [
        ([{"type": "tube"}], "light 0: `type` is one of sphere, rect"),
        ([{"type": "sphere", "center": (0, 0), "radius": 1, "radiance": 1}], "`center` has the shape 3, not (2,)"),
        ([{"type": "sphere", "center": (0, 0, 1), "radius": -1, "radiance": 1}], "`radius` is between"),
        ([{"type": "sphere", "center": (0, 0, 1), "radiance": 1}], "`radius` is missing"),
        ([{"type": "sphere", "center": (0, 0, 1), "radius": 1, "radiance": -1}], "`radiance` is negative"),
        ([{"type": "sphere", "position": (0, 0, 1)}], "unknown key 'position'"),
        ({"type": "sphere"}, "a list of dicts is expected"),
    ]:

        @st.light(once_per_scene=True)
        def test_wrong_bulb(scene):
            assert scene.camera is None
            return wrong

        with pytest.raises(st.SyntableError) as raised:
            sample("rgb", lights=[{"kind": "test_wrong_bulb"}])
        assert says in str(raised.value) and "lights.test_wrong_bulb" in str(raised.value)


def test_a_placer_and_a_source_of_assets():
    @st.asset_source(license="CC0-1.0")
    class TestTents:
        "Pyramids."

        __test__ = False

        def names(self):
            return {"small": "tent", "large": "tent"}

        def load(self, name):
            size = 0.05 if name == "small" else 0.1
            corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 1)]
            faces = [(0, 2, 1), (0, 3, 2), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
            return {"vertices": size * np.array(corners), "faces": faces, "color": (1, 0, 0), "roughness": 1}

    @dataclass
    class Row:
        pool: st.ObjectPool = "tents"
        "The pool."
        count: int = 2

    drawn = []

    @st.placer(options=Row)
    def test_row(scene, options):
        table = scene.supports["table"]
        bodies = []
        for number in range(options.count):
            asset = scene.load(options.pool, "large") if number == 0 else scene.draw(options.pool)
            drawn.append(asset)
            pose = np.eye(4)
            pose[:3, 3] = table.center + (0.25 * number - 0.2, 0, 0.001 - asset.bounds[0, 2])
            bodies.append({"asset": asset, "pose": pose, "fixed": number == 0})
        return bodies

    room = {"kind": "room", "material": {"floor": "floors", "walls": "walls", "ceiling": "walls"}}
    steps = [room, {"kind": "table", "from": ["tables"]}, {"kind": "test_row", "id": "objects"}]
    recipe = small().set("place", steps).set("assets.tents", {"kind": "test_tents"})
    with st.generate(recipe, ["rgb", "visible_mask"], threads=2) as samples:
        it = next(samples)
    assert [one.category for one in it.objects] == ["tent", "tent"] and it.objects[0].name == "large"
    table = it.objects[0].world_from_object
    assert np.allclose(table[:3, :3], np.eye(3), atol=1e-6)
    assert it.visible_masks.any(axis=(1, 2)).all()
    assert (
        drawn[0].bounds.shape == (2, 3)
        and np.allclose(np.ptp(drawn[0].bounds, axis=0), (0.2, 0.2, 0.1))
        and drawn[0].mass > 0
    )
    reds = it.rgb[it.visible_masks.any(axis=0)].astype(float).mean(0)
    assert reds[0] > 2 * reds[1]
    with pytest.raises(st.RecipeError, match="tens"):
        recipe.set("place[2].pool", "tens").check()


def test_a_scene_that_fails_is_a_warning(tmp_path):
    @st.annotator(reads=[], provides={"test_luckless": float})
    def test_luckless(view):
        if view.scene == 0:
            raise st.Unlucky("no luck here")
        return 1.0

    recipe = small(dataset__scenes=2)
    with pytest.warns(st.SyntableWarning, match=r"scene 0 failed: (?s:.*)no luck here"):
        assert [it.scene for it in st.generate(recipe, ["test_luckless"])] == [1, 1]
    with pytest.warns(st.SyntableWarning, match=r"scene 0 failed: (?s:.*)no luck here"):
        outcome = st.run(recipe.set("write", {"jsonl": {"include": ["test_luckless"]}}), tmp_path / "data")
    assert outcome.failed == 1 and not outcome


PYRAMID = {
    "vertices": 0.05 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 1)]),
    "faces": [(0, 2, 1), (0, 3, 2), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)],
}


def with_source(names, **more):
    """A recipe with a fixed pyramid of a source that has these names."""

    @st.asset_source(name="test_pyramids")
    class Pyramids:
        def names(self):
            return names

        def load(self, name):
            return PYRAMID | more

    @st.placer()
    def test_first(scene):
        pose = np.eye(4)
        pose[:3, 3] = next(iter(scene.supports.values())).center + (0, 0, 0.3)
        return [{"asset": scene.draw("pyramids"), "pose": pose, "fixed": True}]

    steps = pytest.importorskip("tomllib").loads(str(small()))["place"]
    recipe = small(dataset__views_per_scene=1, dataset__max_attempts=1)
    return recipe.set({"assets.pyramids": {"kind": "test_pyramids"}, "place": [*steps, {"kind": "test_first"}]})


@pytest.mark.parametrize(
    ("names", "more", "says"),
    [
        (["../t"], {}, "names(): the name '../t' is no relative path, such as red or mugs/red"),
        (["/t"], {}, "the name '/t' is no relative path"),
        (["a//t"], {}, "the name 'a//t' is no relative path"),
        (["a\\t"], {}, "the name 'a\\\\t' is no relative path"),
        (["ü\n"], {}, "the name '\\xfc\\n' has a control character"),
        (["a" * 201], {}, "has 201 characters; at most 200 are allowed"),
        ({"a": "c\0"}, {}, "the category 'c\\x00' has a control character"),
        ({"a": "c" * 500}, {}, "has 500 characters"),
        (["a"], {"color": [255, -1, 3]}, "`color` is in [0, 1], linear Rec. 709, and has 255: divide by 255"),
        (["a"], {"color": [0, -1, 0]}, "`color` is in [0, 1], linear Rec. 709, and has -1"),
        (["a"], {"colors": np.full((5, 3), 1.5)}, "`colors` is in [0, 1], linear Rec. 709, and has 1.5"),
    ],
)
def test_mistakes_of_sources(names, more, says):
    with pytest.raises(st.SyntableError) as raised:
        next(st.generate(with_source(names, **more), ["depth"]))
    assert says in str(raised.value)


def test_names_of_assets_have_folders():
    with st.generate(with_source({"mugs/ü": "a/b"}, color=[0, 1, 0.5]), ["depth"]) as samples:
        assert ("mugs/ü", "a/b") in [(it.name, it.category) for it in next(samples).objects]


def test_an_asset_belongs_to_one_scene():
    first = []

    @st.placer()
    def test_hoarder(scene):
        first.append(scene.draw("pyramids"))
        return [{"asset": first[0], "pose": np.eye(4), "fixed": True}]

    recipe = with_source(["a"]).set("dataset.scenes", 2)
    steps = pytest.importorskip("tomllib").loads(str(recipe))["place"]
    recipe = recipe.set("place", [*steps[:-1], {"kind": "test_hoarder"}])
    samples = st.generate(recipe, ["depth"], threads=1)
    with samples, pytest.raises(st.SyntableError) as raised:
        list(samples)
    assert f"`asset` is pyramids/{first[0].name} of another scene: call scene.draw" in str(raised.value)
    assert raised.value.file == __file__ and raised.value.line == test_hoarder.__code__.co_firstlineno
    assert "_call" not in repr(first[0])


def test_an_unlucky_placer_is_tried_again():
    attempts = []

    @st.placer()
    def test_unlucky(scene):
        attempts.append(scene.rng.random())
        if len(attempts) < 3:
            raise st.Unlucky("no place is free")
        return []

    recipe = small(dataset__views_per_scene=1)
    steps = pytest.importorskip("tomllib").loads(str(recipe))["place"]
    with st.generate(recipe.set("place", [*steps, {"kind": "test_unlucky"}]), ["depth"], threads=1) as samples:
        next(samples)
    assert len(set(attempts)) == 3


# --- writers


@st.writer(reads=["rgb", "visible_mask"], optional=["occlusion_rate"], options=Threshold)
class TestFiles:
    "Files of a test."

    __test__ = False

    def __init__(self, options):
        self.options = options

    def write(self, view, out):
        out.write(f"{view.name}.png", view.rgb)
        out.write(f"masks/{view.name}.npy", view.visible_masks)
        out.write(f"{view.name}.txt", f"{len(view.ids)} {self.options.threshold}")
        out.record({"name": view.name, "area": view.visible_masks.sum(axis=(1, 2))})

    def finish(self, dataset, out):
        rows = list(dataset.records())
        out.write("all.csv", "".join(f"{row['name']},{sum(row['area'])}\n" for row in rows))
        out.write("about.txt", f"{dataset.name} {dataset.scenes} {dataset.categories[1]}")


def read_png(path):
    import zlib

    data, raw, at = path.read_bytes(), b"", 8
    size = int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    while at < len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        if data[at + 4 : at + 8] == b"IDAT":
            raw += data[at + 8 : at + 8 + length]
        at += 12 + length
    bits, color = data[24], data[25]
    channels = {0: 1, 2: 3}[color]
    rows = np.frombuffer(zlib.decompress(raw), np.uint8).reshape(size[1], 1 + channels * bits // 8 * size[0])
    assert not rows[:, 0].any()
    pixels = np.ascontiguousarray(rows[:, 1:]).view(np.uint8 if bits == 8 else ">u2")
    return pixels.reshape(size[1], size[0], 3) if channels == 3 else pixels


def test_a_writer_in_a_run_that_is_resumed(tmp_path):
    recipe = small(dataset__scenes=2, write={"test_files": {"threshold": 0.5}, "syntable": {}})
    out = tmp_path / "data"
    st.run(recipe, out, scenes=range(0, 1), progress=False)
    assert (out / "test_files/all.csv").read_text().count("\n") == 2
    outcome = st.run(recipe, out, progress=False)
    assert outcome.complete and outcome.images == 4
    stored = st.open(out)
    for it in stored:
        masks = np.load(out / f"test_files/masks/{it.scene}_{it.view}.npy")
        assert np.array_equal(masks, it.visible_masks)
        assert np.array_equal(read_png(out / f"test_files/{it.scene}_{it.view}.png"), it.rgb)
        assert (out / f"test_files/{it.scene}_{it.view}.txt").read_text() == f"{len(it.ids)} 0.5"
    rows = list(csv.reader((out / "test_files/all.csv").open()))
    assert rows == [[f"{it.scene}_{it.view}", str(it.visible_masks.sum())] for it in stored]
    assert (out / "test_files/about.txt").read_text().endswith("[0, 1] object")
    assert command("verify", out).returncode == 0
    # A damaged file is found and made again.
    (out / "test_files/1_0.txt").write_text("damaged")
    damaged = command("verify", out)
    assert damaged.returncode == 3 and "test_files/1_0.txt" in damaged.stdout + damaged.stderr
    st.run(recipe, out, repair=True, progress=False)
    assert (out / "test_files/1_0.txt").read_text().endswith(" 0.5")


def test_stages_take_part_in_convert(tmp_path):
    st.run(small(write={"syntable": {}}), tmp_path / "data", progress=False)
    st.convert(tmp_path / "data", tmp_path / "files", "test_files", progress=False)
    st.convert(
        tmp_path / "data",
        tmp_path / "npz",
        "npz",
        npz={"include": ["rgb", "visible_mask", "test_darkness"]},
        progress=False,
    )
    stored = st.open(tmp_path / "data")
    for it in stored:
        assert np.array_equal(read_png(tmp_path / f"files/test_files/{it.scene}_{it.view}.png"), it.rgb)
    files = sorted((tmp_path / "npz").rglob("*.npz"))
    assert len(files) == len(stored)
    with np.load(files[0]) as arrays:
        names = [name for name in arrays if "test_darkness" in name]
        values = np.concatenate([np.atleast_1d(arrays[name]).ravel() for name in names])
    expected = darkness_by_hand(stored[0], 0.2)
    assert all(np.isclose(values, value).any() for value in expected.values())


@pytest.mark.parametrize(
    ("write", "says"),
    [
        (lambda view, out: out.write("../x", b""), "not a path inside the dataset"),
        (lambda view, out: out.write("x", b"") or out.write("x", b""), "written twice"),
        (lambda view, out: out.write("x", 3), "a file holds bytes, text or an array, not 3, a int"),
        (lambda view, out: out.write("x.png", np.zeros((2, 2))), "a PNG file holds bool, uint8 or uint16"),
        (lambda view, out: out.write("x.png", view.rgb[..., :2]), "a PNG file holds bool, uint8 or uint16"),
        (lambda view, out: out.write("x.png", view.rgb[:0]), "a PNG file holds bool, uint8 or uint16"),
        (lambda view, out: out.write(3, b""), "the name of a file is text or a path, not 3"),
        (lambda view, out: out.write("x.jpg", view.rgb), "an array's file ends in .npy or .png, not 'x.jpg'"),
        (lambda view, out: out.write("x", view.rgb), "ends in .npy or .png, not 'x'"),
        (lambda view, out: out.write(".png", view.rgb), "ends in .npy or .png, not '.png'"),
        (lambda view, out: out.write("x.npy", np.array([object()])), "Object arrays cannot be saved"),
        (lambda view, out: out.record({1j}), "a record holds what JSON holds"),
        (lambda view, out: out.record(1), "records are for the method finish(self, dataset, out), which"),
        (lambda view, out: {"x": 1}, "write() returns nothing, not {'x': 1}, a dict: out.write stores a file, and"),
        (lambda view, out: view.depth, "does not read `depth`"),
    ],
)
def test_mistakes_of_writers(tmp_path, write, says):
    @st.writer(reads=["rgb"])
    class TestWrong:
        __test__ = False

        def write(self, view, out):
            return write(view, out)

    with pytest.raises(st.SyntableError) as raised:
        st.run(small(write={"test_wrong": {}}), tmp_path / "data", progress=False)
    # The lines after the first are a traceback, which may quote this test.
    first = str(raised.value).partition("\n")[0]
    assert says in first and "write.test_wrong" in first


def test_finish_returns_nothing(tmp_path):
    @st.writer(reads=[])
    class TestFinisher:
        __test__ = False

        def write(self, view, out):
            out.record(view.name)

        def finish(self, dataset, out):
            return list(dataset.records())

    says = r"finish\(\) returns nothing, not \['0_0'.*: out.write stores a file"
    with pytest.raises(st.SyntableError, match=says) as raised:
        st.run(small(write={"test_finisher": {}}), tmp_path / "data", progress=False)
    assert raised.value.line == TestFinisher.finish.__code__.co_firstlineno


def test_images_of_writers(tmp_path):
    made = {}

    @st.writer(reads=["rgb", "depth", "visible_ids"])
    class TestImages:
        __test__ = False

        def write(self, view, out):
            images = {
                "color": view.rgb,
                "mask": view.depth > 0.6,
                "gray": view.rgb[..., 1],
                "ids": view.visible_ids.astype(np.uint16),
                "millimeters": (1000 * view.depth).astype(">u2"),
            }
            for name, image in images.items():
                out.write(pathlib.PurePath(view.name) / f"{name}.PNG", image)
                out.write(pathlib.PureWindowsPath(view.name, f"{name}.npy"), image)
                made[view.name, name] = image

    st.run(small(write={"test_images": {}}), tmp_path / "data", progress=False)
    masks = [image for (_, name), image in made.items() if name == "mask"]
    assert len(made) == 10 and any(mask.any() and not mask.all() for mask in masks)
    for (view, name), image in made.items():
        found = read_png(tmp_path / f"data/test_images/{view}/{name}.PNG")
        assert found.dtype == (np.uint8 if image.dtype.itemsize == 1 else np.dtype(">u2")), name
        assert np.array_equal(found, 255 * image if image.dtype == bool else image), name
        assert np.array_equal(np.load(tmp_path / f"data/test_images/{view}/{name}.npy"), image), name


def test_an_output_ends_with_its_scene(tmp_path):
    kept = []

    @st.writer(reads=[])
    class TestKeeper:
        __test__ = False

        def write(self, view, out):
            kept.append(out)

    st.run(small(write={"test_keeper": {}}), tmp_path / "data", progress=False)
    with pytest.raises(RuntimeError, match="the output has ended"):
        kept[0].write("late.txt", "x")


# --- the command


def command(*arguments, cwd=None):
    return subprocess.run(
        [sys.executable, "-m", "syntable", *map(str, arguments)], capture_output=True, text=True, cwd=cwd, timeout=300
    )


SMALL = [
    word
    for key, value in {
        "camera.resolution": "[64, 48]",
        "render.samples_per_pixel": "1",
        "place[2].count": "{ integers = [2, 4] }",
        "settle.duration_s": "1.0",
        "dataset.scenes": "1",
        "dataset.views_per_scene": "2",
    }.items()
    for word in ("--set", f"{key}={value}")
]


def test_the_example_runs_from_the_command(tmp_path):
    out = tmp_path / "data"
    writes = "write={ syntable = {}, dark_objects = {} }"
    done = command(
        "--plugin", EXAMPLE, "run", "--out", out, *SMALL, "--set", writes, "--set", "annotate.darkness.threshold=0.4"
    )
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader((out / "dark_objects/darkness.csv").open()))
    expected = {
        (f"{it.scene}_{it.view}", str(id)): share
        for it in st.open(out)
        for id, share in darkness_by_hand(it, 0.4).items()
    }
    assert {(row["view"], row["object"]): float(row["darkness"]) for row in rows} == pytest.approx(expected, abs=6e-4)
    again = command("run", out / "recipe.toml", f"--plugin={EXAMPLE}", "--out", tmp_path / "again")
    assert again.returncode == 0, again.stderr
    assert (tmp_path / "again/dark_objects/darkness.csv").read_text() == (out / "dark_objects/darkness.csv").read_text()
    assert command("--plugin", EXAMPLE, "verify", out).returncode == 0
    unknown = command("check", out / "recipe.toml")
    assert unknown.returncode == 2 and "dark_objects" in unknown.stderr


def test_verbs_know_plugins():
    listed = command("list", "darkness", "--plugin", EXAMPLE)
    assert listed.returncode == 0 and "annotate.darkness (my_stages.darkness " in listed.stdout
    for text in [
        "Share of dark pixels of each visible object",
        "threshold",
        "number, 0 to 1",
        "0.2",
        "Share of white below",
    ]:
        assert text in listed.stdout
    assert "darkness" in command("list", "products", "--plugin", EXAMPLE).stdout
    assert '"darkness"' in command("schema", "--plugin", EXAMPLE).stdout
    plan = command("plan", "--plugin", EXAMPLE, "--set", "write.dark_objects={}")
    assert plan.returncode == 0 and "annotate.darkness" in plan.stdout
    wrong = command("check", "--plugin", EXAMPLE, "--set", "annotate.darkness.threshold=2")
    assert wrong.returncode == 2 and "threshold" in wrong.stderr
    assert "--plugin" in command("--help").stdout


def test_preview_knows_plugins(tmp_path):
    sheet = tmp_path / "sheet.png"
    writes = ["--set", "write.dark_objects={}"]
    done = command("preview", "--plugin", EXAMPLE, *SMALL, *writes, "--scenes", "0", "--out", sheet)
    assert done.returncode == 0 and sheet.read_bytes().startswith(b"\x89PNG"), done.stderr
    assert "dark_objects" not in done.stderr
    unknown = command("preview", *SMALL, *writes, "--scenes", "0", "--out", tmp_path / "none.png")
    assert unknown.returncode == 2 and "dark_objects" in unknown.stderr


def test_a_broken_plugin_ends_with_its_traceback(tmp_path):
    broken = tmp_path / "broken.py"
    broken.write_text("import syntable as st\n\nst.annotator(reads=['rbg'], provides={'x': float})(lambda view: 1)\n")
    done = command("--plugin", broken, "list")
    assert done.returncode == 2 and done.stdout == ""
    assert "broken.py" in done.stderr and "line 3" in done.stderr and "importlib" not in done.stderr
    for missing in [tmp_path / "none.py", "no_such_module"]:
        done = command("--plugin", missing, "list")
        assert done.returncode == 2 and "no" in done.stderr.lower()
    assert command("--plugin").returncode == 2


def test_a_plugin_is_a_module_too(tmp_path):
    (tmp_path / "package").mkdir()
    (tmp_path / "package/__init__.py").write_text("")
    (tmp_path / "package/stages.py").write_text(
        "import syntable as st\n@st.annotator(reads=[], provides={'seven': int})\ndef seventh(view):\n    return 7\n"
    )
    done = command("--plugin", "package.stages", "list", "seventh", cwd=tmp_path)
    assert done.returncode == 0 and "annotate.seventh (package.stages.seventh " in done.stdout, done.stderr


# --- time


def test_a_call_is_quick(tmp_path):
    @st.annotator(reads=["rgb", "depth", "visible_mask"], provides={"test_constant": float})
    def test_constant(view):
        return 1.0

    recipe = small(dataset__views_per_scene=20, write={"npz": {"include": ["test_constant"]}})
    st.run(recipe.set("place[2].count", 20), tmp_path / "data", progress=False)
    times = json.loads((tmp_path / "data/.syntable/times.jsonl").read_text())
    worked = times["stages"]["annotate.test_constant"]
    # Below 1 ms on a machine with nothing else to do, for any size of the image: nothing is converted.
    assert worked["calls"] == 20 and worked["seconds"] / worked["calls"] < 0.02


def test_no_leak():
    class Result(float):
        alive = 0

        def __init__(self, _):
            Result.alive += 1

        def __del__(self):
            Result.alive -= 1

    @st.annotator(reads=["visible_mask"], provides={"test_leak": float})
    def test_leaks(view):
        return Result(1.0)

    for _ in st.generate(small(dataset__scenes=2), ["test_leak"]):
        pass
    gc.collect()
    assert Result.alive == 0
