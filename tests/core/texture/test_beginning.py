import numpy as np
import pytest

import toposeam as ts
from toposeam.texture.tile_origin import begun, line_steps


def stripes(period=16, width=3):
    """Rows of light joints across a dark ground, with noise."""
    rng = np.random.default_rng(0)
    image = np.where(np.arange(96)[:, np.newaxis] % period < width, 220.0, 60.0) + rng.normal(0, 4, (96, 96))
    return np.clip(image, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("shape", [(300, 40), (40, 30, 3)])
def test_steps_of_lines_are_those_from_the_line_before(shape):
    image = np.random.default_rng(1).integers(0, 256, shape, np.uint8)
    gray = image if image.ndim == 2 else image.mean(axis=2)
    for axis, steps in enumerate(line_steps(image)):
        wanted = np.abs(gray.astype(float) - np.roll(gray, 1, axis)).mean(axis=1 - axis)
        np.testing.assert_allclose(steps, wanted, rtol=1e-4)


def test_a_repeating_texture_does_not_start_at_a_visible_border():
    for seed in range(4):
        made = ts.synthesize(stripes(), (128, 112), patch=32, seed=seed, tileable=True)
        for steps in line_steps(made.image):
            assert steps[0] <= np.quantile(steps, 0.75)


def test_a_texture_begun_elsewhere_is_the_same_in_all_its_parts():
    image, alpha = stripes(), np.full((96, 96), 200, np.uint8)
    made = ts.synthesize(
        image, (128, 112), patch=32, smooth=0, level=False, tileable=True, maps=[255 - image], alpha=alpha
    )
    steps = line_steps(made.image)[0]
    for first in (int(steps.argmax()), int(steps.argmin())):
        turned = ts.texture.Synthesis(
            **{
                name: np.roll(value, -first, 0) if isinstance(value, np.ndarray) else value
                for name, value in vars(made).items()
                if name in ts.texture.Synthesis.__dataclass_fields__ and name != "maps"
            },
            maps=tuple(np.roll(one, -first, 0) for one in made.maps),
        )
        again = begun(turned)
        moved = (again.image != turned.image).any()
        assert moved == (first == int(steps.argmax()))
        assert (again.index != turned.index).any() == (again.labels != turned.labels).any() == moved
        np.testing.assert_array_equal(again.maps[0], 255 - again.image)
        np.testing.assert_array_equal(again.apply(image), again.image)


def test_ended_and_guided_textures_start_where_they_were_laid():
    image, wanted = stripes(), np.tile(stripes(), (2, 2))[:128, :112]
    ended = ts.synthesize(image, (128, 112), patch=32)
    assert begun(ended) is ended
    made = ts.synthesize(image, (128, 112), patch=32, tileable=True, guide=wanted, guide_source=image)
    assert np.abs(made.image.astype(float) - wanted).mean() < 25
