"""Exemplars in all positions, and what turns with them."""

import numpy as np
import pytest
from scipy import ndimage

from toposeam.texture.exemplar import read_sources, turned_sources


@pytest.mark.parametrize("down", [False, True])
@pytest.mark.parametrize("kind", ["u1", "u2", "f4", "signed"])
def test_normals_turn_with_their_patches(kind, down):
    def normals(heights):
        y, x = np.gradient(heights)
        vectors = np.stack([-x, -y if down else y, np.ones_like(x)], axis=2)
        vectors /= np.linalg.norm(vectors, axis=2, keepdims=True)
        if kind in ("signed", "f4"):
            return vectors if kind == "signed" else np.float32(vectors + 1) / 2
        return np.rint((vectors + 1) / 2 * np.iinfo(kind).max).astype(kind)

    heights = 20 * ndimage.gaussian_filter(np.random.default_rng(0).normal(size=(60, 70)), 3)
    sources = read_sources(heights, normal=normals(heights), data_range=[heights.max(), None])
    found = turned_sources(sources, "all")
    assert len(found.planes[1]) == 8
    for surface, vectors in zip(found.planes[0], found.planes[1], strict=True):
        np.testing.assert_allclose(vectors, normals(surface[..., 0]), rtol=1e-6)
    white = 1 if kind in ("f4", "signed") else np.iinfo(kind).max
    weight = np.sqrt(sources.compared[1][1])
    np.testing.assert_allclose(found.features[1][..., 1:], weight * (found.planes[1][1] / white), rtol=1e-4)
