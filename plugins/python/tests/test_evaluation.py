"""Scores of predictions in memory, against files, the command and pycocotools."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest

import syntable as st
from test_api import command


def noisy(dataset, seed=1):
    """Predictions that are nearly right: shifted masks, some missing, some doubled."""
    draw = np.random.default_rng(seed)
    predictions = []
    for sample in dataset:
        visible, amodal, labels, scores = [], [], [], []
        for id, shown, whole in zip(sample.ids.tolist(), sample.visible_masks, sample.amodal_masks):
            if not shown.any() or draw.random() < 0.15:
                continue
            for _ in range(1 + int(draw.random() < 0.2)):
                shift = draw.integers(-2, 3, 2)
                visible.append(np.roll(shown, shift, (0, 1)))
                amodal.append(np.roll(whole, shift, (0, 1)))
                labels.append(sample["category_id"][id])
                scores.append(round(float(draw.random()), 3))
        shape = (0, *sample.shape)
        predictions.append(
            {
                "masks": np.stack(visible) if visible else np.zeros(shape, bool),
                "amodal_masks": np.stack(amodal) if amodal else np.zeros(shape, bool),
                "scores": np.asarray(scores),
                "labels": np.asarray(labels, dtype=np.int64),
            }
        )
    return predictions


def as_results(dataset, predictions):
    """The same as the objects of a COCO results file."""
    return [
        {
            "image_id": sample.name,
            "score": float(score),
            "category_id": int(label),
            "segmentation": st.Mask(mask).rle(),
            "amodal_segmentation": st.Mask(whole).rle(),
        }
        for sample, of in zip(dataset, predictions)
        for mask, whole, score, label in zip(of["masks"], of["amodal_masks"], of["scores"], of["labels"])
    ]


@pytest.fixture
def predictions(dataset):
    return noisy(dataset)


def test_memory_files_and_the_command_agree(data, dataset, predictions, tmp_path):
    path = tmp_path / "results.json"
    path.write_text(json.dumps(as_results(dataset, predictions)), encoding="utf-8")
    options = {"by_category": True, "bootstrap": 20, "seed": 3}
    found = st.evaluate(dataset, predictions, **options)
    from_file = st.evaluate(data, path, **options)
    done = command("eval", "--gt", data, "--pred", path, "--json", "--by-category", "--bootstrap", 20, "--seed", 3)
    assert found.to_dict() == from_file.to_dict() == json.loads(done.stdout)
    assert found.csv == from_file.csv
    assert 0 < found.amodal_f < 100 and 0 < found.visible_ap < 100 and found["visible_mask_ap"] == found.visible_ap
    assert found.intervals["amodal_overlap_f"][0] <= found.amodal_f <= found.intervals["amodal_overlap_f"][1]
    assert "amodal F" in repr(found) and "ACC_O" in str(st.evaluate(dataset, predictions))


def test_every_form_of_masks_is_the_same(dataset, predictions):
    wanted = st.evaluate(dataset, predictions).to_dict()

    def of(change):
        return [{name: change(name, value) for name, value in one.items()} for one in predictions]

    def is_mask(name):
        return name.endswith("masks")

    forms = [
        of(lambda name, value: value.astype(np.float32)[:, None] * 0.9 if is_mask(name) else value),
        of(lambda name, value: value.astype(np.uint8) * 255 if is_mask(name) else value.tolist()),
        of(lambda name, value: [st.Mask(mask) for mask in value] if is_mask(name) else value),
        of(lambda name, value: [st.Mask(mask).rle() for mask in value] if is_mask(name) else value),
        of(lambda name, value: list(value) if is_mask(name) else value),
        {sample.name: one for sample, one in zip(dataset, predictions)},
        {place: one for place, one in enumerate(predictions)},
        (one for one in predictions),
    ]
    for number, form in enumerate(forms):
        assert st.evaluate(dataset, form).to_dict() == wanted, number


def test_the_labels_themselves_are_perfect(dataset):
    labels = [
        {"masks": sample.visible_masks, "amodal_masks": sample.amodal_masks, "occlusion_masks": sample.occlusion_masks}
        for sample in dataset
    ]
    found = st.evaluate(dataset, labels)
    assert found.amodal_f == found.amodal_ap == found.occlusion_accuracy == 100.0
    with pytest.warns(st.SyntableWarning, match="the predictions have no scores.*AP") as caught:
        as_dataset = st.evaluate(dataset, dataset)
    assert as_dataset.amodal_f == 100.0 and as_dataset.amodal_ap is None and caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert st.evaluate(dataset, [{"masks": []}] * len(dataset)).predictions == 0
        assert st.evaluate(dataset, dataset, metrics=["amodal"]).amodal_f == 100.0


def test_probabilities_may_be_rounded(dataset):
    labels = [{"masks": np.where(sample.visible_masks, 1 + 1e-6, -1e-6)} for sample in dataset]
    assert st.evaluate(dataset, labels).visible_f == 100.0


def test_scores_by_image_average_to_the_scores(dataset, predictions):
    found = st.evaluate(dataset, predictions)
    assert list(found.by_image) == [sample.name for sample in dataset]
    of_images = list(found.by_image.values())
    assert [of["predictions"] for of in of_images] == [int((one["scores"] >= 0.5).sum()) for one in predictions]
    assert np.mean([of["visible_overlap_f"] for of in of_images]) == pytest.approx(found.visible_f, abs=1e-6)
    first, *others = predictions
    alone = st.evaluate(dataset, {0: first}).by_image
    assert alone[dataset[0].name] == of_images[0] and alone[dataset[1].name]["visible_overlap_f"] == 0


def test_ap_is_that_of_pycocotools(dataset, predictions):
    coco = pytest.importorskip("pycocotools.coco")
    from pycocotools.cocoeval import COCOeval

    truth, results = coco.COCO(), []
    images, annotations = [], []
    for place, (sample, of) in enumerate(zip(dataset, predictions), 1):
        images.append({"id": place, "height": sample.shape[0], "width": sample.shape[1]})
        for mask in sample.visible_masks:
            rle = st.Mask(mask).rle()
            box = list(st.Mask(mask).box)
            annotations.append(
                {"id": len(annotations) + 1, "image_id": place, "category_id": 1, "segmentation": rle, "bbox": box}
                | {"area": int(mask.sum()), "iscrowd": 0}
            )
        for mask, score in zip(of["masks"], of["scores"]):
            runs = st.Mask(mask).rle()
            results.append({"image_id": place, "category_id": 1, "segmentation": runs, "score": float(score)})
    # As in the library: an object that nobody sees is no visible object.
    annotations = [one for one in annotations if one["area"]]
    truth.dataset = {"images": images, "annotations": annotations, "categories": [{"id": 1}]}
    truth.createIndex()
    scored = COCOeval(truth, truth.loadRes(results), "segm")
    scored.evaluate()
    scored.accumulate()
    scored.summarize()
    found = st.evaluate(dataset, predictions, metrics=["coco"])
    assert found.visible_ap == pytest.approx(100 * scored.stats[0], abs=1e-6)
    assert found["visible_mask_ap50"] == pytest.approx(100 * scored.stats[1], abs=1e-6)
    assert found["visible_mask_ar100"] == pytest.approx(100 * scored.stats[8], abs=1e-6)


def test_scores_are_saved_for_a_report(dataset, data, predictions, tmp_path):
    st.evaluate(dataset, predictions, save=tmp_path / "scores.json", worst=2)
    made = st.report(data, tmp_path / "pages", scores=tmp_path / "scores.json", images=2)
    assert made.images >= 2
    other = tmp_path / "mine.txt"
    other.write_text("mine")
    with pytest.raises(st.SyntableError, match="mine.txt.*overwrite=True"):
        st.evaluate(dataset, predictions, save=other)
    assert other.read_text() == "mine"
    st.evaluate(dataset, predictions, save=other, overwrite=True)
    assert other.read_text() != "mine"


MASK = np.zeros((1, 48, 64), bool)
LOGITS = np.full((2, 48, 64), 0.3, np.float32)
LOGITS[1, 3, 2] = -4


@pytest.mark.parametrize(
    ("predictions", "kind", "words"),
    [
        ({"masks": MASK}, TypeError, "dict for each image"),
        ([{"masks": MASK}], ValueError, "1 images, the dataset 6"),
        ([{"masks": MASK}] * 7, ValueError, "more images"),
        ([MASK] * 6, TypeError, "predictions\\[0\\] is a dict"),
        ([{"mask": MASK}] * 6, ValueError, "no 'masks'"),
        ([{"masks": MASK, "score": [1.0]}] * 6, ValueError, "unknown fields 'score'"),
        ([{"masks": MASK[0]}] * 6, ValueError, "objects × height × width"),
        ([{"masks": MASK.astype(complex)}] * 6, TypeError, "complex"),
        ([{"masks": LOGITS}] * 6, ValueError, r"predictions\[0\]\['masks'\]\[1\] is -4 at row 3, column 2; .* sigmoid"),
        ([{"masks": list(LOGITS)}] * 6, ValueError, r"\['masks'\]\[1\] is -4 at row 3, column 2; .* sigmoid"),
        ([{"masks": MASK + np.nan}] * 6, ValueError, r"\['masks'\]\[0\] is nan at row 0, column 0"),
        ([{"masks": MASK, "amodal_masks": MASK + np.inf}] * 6, ValueError, r"\['amodal_masks'\]\[0\] is inf"),
        ({0: {"masks": MASK}, 4: {"masks": MASK * 1.0 + 255}}, ValueError, r"predictions\[4\]\['masks'\]\[0\] is 255"),
        ([{"masks": MASK, "scores": [1.0, 2.0]}] * 6, ValueError, "1 'masks' and 2 'scores'"),
        ([{"masks": MASK, "scores": [float("nan")]}] * 6, st.SyntableError, "not a number"),
        ([{"masks": MASK, "scores": 1.0}] * 6, TypeError, "number for each object"),
        ([{"masks": MASK, "labels": [1.5]}] * 6, TypeError, "integer for each object"),
        ([{"masks": MASK, "labels": [-1]}] * 6, ValueError, "from 0"),
        ([{"masks": MASK[:, :10]}] * 6, st.SyntableError, "64 × 10"),
        ([{"masks": [{"size": [48, 64]}]}] * 6, ValueError, "counts"),
        ({"nowhere": {"masks": MASK}}, st.SyntableError, "nowhere"),
        ({9: {"masks": MASK}}, ValueError, "no image 9"),
        (3, TypeError, "int"),
        (None, TypeError, "NoneType"),
        (MASK, TypeError, "ndarray"),
    ],
)
def test_wrong_predictions_are_refused_by_name(dataset, predictions, kind, words):
    with pytest.raises(kind, match=words):
        st.evaluate(dataset, predictions)


def test_wrong_options_are_refused_by_name(dataset, predictions):
    for options, kind, words in [
        ({"min_score": "high"}, TypeError, "min_score"),
        ({"min_score": float("nan")}, ValueError, "min_score"),
        ({"occluded_from": 2}, ValueError, "occluded_from"),
        ({"convention": "mine"}, ValueError, "convention"),
        ({"metrics": ["nonsense"]}, st.SyntableError, "nonsense"),
        ({"bootstrap": 0}, ValueError, "bootstrap"),
        ({"threads": 0}, ValueError, "threads"),
    ]:
        with pytest.raises(kind, match=words):
            st.evaluate(dataset, predictions, **options)
