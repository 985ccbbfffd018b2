"""Small recipes and datasets for all tests."""

from __future__ import annotations

from pathlib import Path

import pytest

import syntable as st


def small_recipe(**more) -> st.Recipe:
    recipe = st.recipe("quickstart")
    settings = {
        "dataset.scenes": 3,
        "dataset.views_per_scene": 2,
        "camera.resolution": [64, 48],
        "render.samples_per_pixel": 2,
        "place[2].count": 7,
        "place[2].width_factor": 0.15,
        "views.radius": {"of_table": [0.35, 0.45]},
        "settle.duration_s": 2.0,
        "denoise.kind": "none",
        **more,
    }
    return recipe.set(settings)


@pytest.fixture(scope="session")
def small() -> st.Recipe:
    """A recipe of three scenes with two views of 64 × 48 pixels and seven objects."""
    return small_recipe()


@pytest.fixture(scope="session")
def data(small: st.Recipe, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The dataset of the small recipe."""
    folder = tmp_path_factory.mktemp("small") / "data"
    assert st.run(small, folder).complete
    return folder


@pytest.fixture
def dataset(data: Path) -> st.Dataset:
    return st.open(data)
