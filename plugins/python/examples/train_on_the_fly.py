"""Training on views that are made meanwhile: a small net learns which pixels of a color image show objects.

    pip install "syntable[torch]"
    python train_on_the_fly.py

No dataset is written. Scores come from scenes on which the net does not train. After each round, `training` has a
checkpoint: the same command with more `--rounds` continues from it, with the weights that a run without a stop has.
"""

import argparse
import itertools
from pathlib import Path

import torch
from torch import nn

import syntable as st

PRODUCTS = ["rgb", "visible_mask"]
VIEWS = 64  # new views in a round
REUSE = 4  # number of times that the net sees each of them
BATCH = 8
HELD_OUT = 4  # scenes of eight views for the scores


def small_recipe(size: list[int]) -> st.Recipe:
    "Small images of few objects, with few samples per pixel: about ten views a second on two cores."
    recipe = st.recipe("quickstart").set("camera.resolution", size).set("render.samples_per_pixel", 2)
    recipe = recipe.set("views.radius", {"of_table": [0.5, 0.8]}).set("place[2].width_factor", 0.3)
    recipe = recipe.set("place[2].count", 8).set("settle.duration_s", 2.0)
    return recipe.set("dataset.views_per_scene", 8)  # further views of a scene cost less than further scenes


def tensors(sample: st.Sample) -> tuple[torch.Tensor, torch.Tensor]:
    "Image, 3 × height × width, and the mask of all objects, 1 × height × width."
    image = torch.from_numpy(sample.rgb).permute(2, 0, 1).float() / 255 - 0.5
    return image, torch.from_numpy(sample.visible_masks.any(axis=0, keepdims=True)).float()


def layer(inputs: int, outputs: int, stride: int = 1) -> nn.Module:
    return nn.Sequential(nn.Conv2d(inputs, outputs, 3, stride, padding=1), nn.GroupNorm(4, outputs), nn.ReLU())


class Net(nn.Module):
    "A small U-Net: 28,000 weights."

    def __init__(self) -> None:
        super().__init__()
        self.down = nn.ModuleList([layer(3, 8), layer(8, 16, 2), layer(16, 32, 2), layer(32, 32, 2)])
        self.up = nn.ModuleList([layer(32 + 32, 16), layer(16 + 16, 8), layer(8 + 8, 8)])
        self.last = nn.Conv2d(8, 1, 1)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        seen = []
        for down in self.down:
            x = down(x)
            seen.append(x)
        for up, beside in zip(self.up, reversed(seen[:-1])):
            x = up(torch.cat([nn.functional.interpolate(x, beside.shape[-2:], mode="bilinear"), beside], dim=1))
        return self.last(x)


def loss_of(found: torch.Tensor, wanted: torch.Tensor) -> torch.Tensor:
    "Cross entropy and Dice loss: most pixels show no object."
    inside = found.sigmoid()
    dice = 1 - (2 * (inside * wanted).sum() + 1) / (inside.sum() + wanted.sum() + 1)
    return nn.functional.binary_cross_entropy_with_logits(found, wanted) + dice


@torch.no_grad()
def score(net: nn.Module, images: torch.Tensor, masks: torch.Tensor) -> float:
    "IoU of predicted and labeled pixels of objects."
    found, wanted = net(images) > 0, masks > 0
    return float((found & wanted).sum() / (found | wanted).sum())


def main(out: Path, rounds: int, size: list[int]) -> None:
    recipe = small_recipe(size)
    # Views of another seed, by number: the same in every run.
    held_out = st.Views(recipe.set("dataset.seed", 1).set("dataset.scenes", HELD_OUT), PRODUCTS)
    images, masks = (torch.stack(part) for part in zip(*map(tensors, held_out)))

    # Threads make the views of the next round while the net learns from this one.
    stream = st.Stream(recipe.set("dataset.seed", 2), PRODUCTS, endless=True, ahead=VIEWS)
    # Threads of PyTorch that wait for a core take longer than one thread takes for such a small net.
    torch.set_num_threads(1)
    torch.manual_seed(0)
    net = Net()
    optimizer = torch.optim.Adam(net.parameters(), lr=0.003)
    done, checkpoint = 0, out / "checkpoint.pt"
    if checkpoint.exists():
        state = torch.load(checkpoint)
        net.load_state_dict(state["net"])
        optimizer.load_state_dict(state["optimizer"])
        stream.load_state_dict(state["stream"])
        done = state["done"]
    print(f"round {done}: IoU {score(net, images, masks):.3f} on {len(held_out)} views of other scenes")

    out.mkdir(parents=True, exist_ok=True)
    samples = iter(stream)
    for number in range(done, rounds):
        views = [tensors(sample) for sample in itertools.islice(samples, VIEWS)]
        order = torch.Generator().manual_seed(number)
        for _ in range(REUSE):
            # Batches mix scenes: from views of one scene alone, the net learns little.
            for batch in torch.randperm(VIEWS, generator=order).split(BATCH):
                some_images, some_masks = (torch.stack(part) for part in zip(*(views[place] for place in batch)))
                loss = loss_of(net(some_images), some_masks)
                optimizer.zero_grad()
                loss.backward()
                optimizer.step()
        # The state of a stream is one number: the next view.
        state = {"net": net.state_dict(), "optimizer": optimizer.state_dict(), "stream": stream.state_dict()}
        torch.save({**state, "done": number + 1}, checkpoint)
        iou = score(net, images, masks)
        print(f"round {number + 1}: IoU {iou:.3f}, loss {loss.item():.3f}, next view {stream.state_dict()['next']}")
    samples.close()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("training"), help="folder of the checkpoint (%(default)s)")
    parser.add_argument("--rounds", type=int, default=8, help="number of rounds of 32 steps (%(default)s)")
    parser.add_argument("--size", type=int, nargs=2, default=[96, 72], metavar="PX", help="width, height (96 72)")
    main(**vars(parser.parse_args()))
