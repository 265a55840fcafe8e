"""What the tests beside this have in common."""

import numpy as np
import pytest
from skimage import data

from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture

PHOTOGRAPH = data.coffee()[100:, 200:]


PLACES = {"a": (0, 0), "b": (40, 4), "c": (20, 30)}


AT = [word for x, y in PLACES.values() for word in ("--at", f"{x},{y}")]


FILES = ["a.png", "b.png", "c.png"]


def crop(name):
    x, y = PLACES[name]
    noise = np.random.default_rng(ord(name)).integers(-9, 10, (50, 60, 3))
    return np.clip(PHOTOGRAPH[y : y + 50, x : x + 60] + noise, 0, 255).astype(np.uint8)


@pytest.fixture
def three(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in PLACES:
        write_picture(tmp_path / f"{name}.png", Picture(pixels=crop(name)))
    return tmp_path


def shown(path="labels.png"):
    """Which layer shows, by the labels picture of three layers."""
    return np.rint(read_picture(path).pixels / 127.5).astype(int)


def assert_joined(output="out.png", labels="labels.png"):
    """Every pixel is that of the picture the labels name, and none is missing."""
    result, label_map = read_picture(output), shown(labels)
    covered = np.zeros(label_map.shape, bool)
    for index, (name, (x, y)) in enumerate(PLACES.items()):
        place = np.s_[y : y + 50, x : x + 60]
        covered[place] = True
        mine = (label_map[place] == index) & (result.alpha[place] > 0)
        assert mine.any()
        np.testing.assert_array_equal(result.pixels[place][mine], crop(name)[mine])
    np.testing.assert_array_equal(result.alpha > 0, covered)
    return label_map
