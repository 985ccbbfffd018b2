"""Samples as PyTorch's, in torchvision's form."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import syntable as st

torch = pytest.importorskip("torch")

from torch.utils.data import DataLoader  # noqa: E402

from syntable.torch import collate, detection  # noqa: E402


def double(image, target):
    return image * 2, target["boxes"].shape


def test_a_sample_has_the_form_of_torchvision(dataset):
    set = dataset.torch(products=["depth", "occlusion_rate"])
    assert len(set) == 6
    image, target = set[2]
    sample = dataset[2]
    assert image.shape == (3, 48, 64) and image.dtype == torch.float32 and 0 <= image.min() <= image.max() <= 1
    assert np.array_equal((image.numpy() * 255).round().astype(np.uint8).transpose(1, 2, 0), sample.rgb)
    seen = sample.visible_masks.any(axis=(1, 2))
    count = int(seen.sum())
    assert count and target["masks"].shape == target["amodal_masks"].shape == (count, 48, 64)
    assert target["masks"].dtype == torch.uint8 and target["labels"].dtype == torch.int64
    assert target["labels"].min() >= 1
    assert np.array_equal(target["masks"].numpy().astype(bool), sample.visible_masks[seen])
    x, y, width, height = sample.visible_boxes[seen].T
    assert np.array_equal(target["boxes"].numpy(), np.stack([x, y, x + width, y + height], 1))
    assert target["image_id"] == 2 and set[-4][1]["image_id"] == 2
    assert np.array_equal(target["depth"].numpy(), sample.depth) and len(target["occlusion_rate"]) == count
    assert dataset.torch(double)[0][1] == (len(set[0][1]["ids"]), 4)


@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_datasets_work_in_workers(dataset, start):
    loader = DataLoader(
        dataset.torch(), batch_size=2, num_workers=2, collate_fn=collate, multiprocessing_context=start, shuffle=False
    )
    batches = list(loader)
    assert len(batches) == 3
    images, targets = batches[1]
    assert [target["image_id"] for target in targets] == [2, 3]
    assert torch.equal(images[0], dataset.torch()[2][0])


def test_views_and_streams_agree(small):
    products = ["rgb", "visible_mask", "amodal_mask"]
    views = st.Views(small, products).torch()
    loader = DataLoader(views, batch_size=3, collate_fn=collate, sampler=views.samples.order(1))
    by_id = {target["image_id"]: image for images, targets in loader for image, target in zip(images, targets)}
    assert sorted(by_id) == list(range(6))
    stream = st.Stream(small, products).torch()
    for image, target in stream:
        assert torch.equal(image, by_id[target["image_id"]])
        if target["image_id"] == 2:
            break
    again = st.Stream(small, products).torch(double)
    again.load_state_dict(stream.state_dict())
    assert len(list(again)) == 3
    assert len(pickle.loads(pickle.dumps(views))) == 6


def test_a_stream_shares_itself_among_workers(small):
    stream = st.Stream(small, ["rgb", "visible_mask"], threads=1).torch()
    loader = DataLoader(stream, batch_size=None, num_workers=2, multiprocessing_context="spawn")
    assert sorted(target["image_id"] for _, target in loader) == list(range(6))


def test_a_fork_after_work_is_an_error(small):
    views = st.Views(small, ["rgb", "visible_mask"]).torch()
    views[0]
    loader = DataLoader(views, num_workers=1, multiprocessing_context="fork", collate_fn=collate)
    with pytest.raises(st.SyntableError, match="forked"):
        next(iter(loader))


def test_ranks_come_from_torch_distributed(small, tmp_path, monkeypatch):
    import torch.distributed as distributed

    monkeypatch.setattr(distributed, "is_initialized", lambda: True)
    monkeypatch.setattr(distributed, "get_rank", lambda: 1)
    monkeypatch.setattr(distributed, "get_world_size", lambda: 3)
    stream = st.Stream(small, ["rgb"])
    assert stream.shard() == (1, 3) and [sample.scene for sample in stream] == [1, 1]


def test_one_step_of_training(small):
    net = torch.nn.Conv2d(3, 1, 3, padding=1)
    optimizer = torch.optim.SGD(net.parameters(), lr=0.1)
    stream = st.Stream(small, ["rgb", "visible_mask"])
    with st.Buffer(stream, 4, start=4, reuse=None, transform=detection) as buffer:
        images, targets = collate(buffer.batch(4))
        wanted = torch.stack([target["masks"].amax(0) for target in targets]).float()[:, None]
        loss = torch.nn.functional.binary_cross_entropy_with_logits(net(torch.stack(images)), wanted)
        loss.backward()
        optimizer.step()
    assert torch.isfinite(loss)


def test_mistakes_are_named(dataset, small):
    with pytest.raises(TypeError, match="transform"):
        dataset.torch(3)
    with pytest.raises(TypeError, match="list of names"):
        dataset.torch(products="depth")
    with pytest.raises(KeyError, match="nonsense"):
        dataset.torch(products=["nonsense"])[0]
    with pytest.raises(KeyError, match="rgb"):
        detection(next(st.generate(small, ["visible_mask"])))
