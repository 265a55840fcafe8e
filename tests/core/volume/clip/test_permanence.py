"""What appears or vanishes in a loop is found, also where it dissolves; what moves or flickers is not."""

import numpy as np
import pytest

from toposeam.volume.clip import missing, strangeness

SIZE = 90, 160
SHOWN = np.ones(SIZE, bool)
Y, X = np.indices(SIZE)


def picture(*discs):
    """A calm ground with discs: (x, y, opacity)."""
    made = np.full((*SIZE, 1), 0.5, np.float32)
    for x, y, opacity in discs:
        made[(X - x) ** 2 + (Y - y) ** 2 < 6**2] += 0.4 * opacity
    return made


def as_moments(frames):
    return np.rint(255 * np.stack(frames)).astype(np.uint8)


#: A disc that crosses the picture, and returns.
CLIP = as_moments([picture((20 + 3 * abs(t - 40), 45, 1)) for t in range(80)])


def of(opacity):
    """What is missing of a disc that goes on with such an opacity."""
    made = np.stack([picture((30 + 3 * t, 45, opacity(t))) for t in range(20)])
    return missing(made, CLIP, 1, SHOWN)


def test_what_moves_on_is_not_missing():
    assert of(lambda t: 1)[0] < 1.2


@pytest.mark.parametrize("frames", [1, 4, 12])
def test_what_dissolves_is_missing(frames):
    area, frame, (row, column) = of(lambda t: np.clip(1 - (t - 5) / frames, 0, 1))
    assert area > 1.6
    assert 5 <= frame <= 5 + frames + 2
    assert row == pytest.approx(0.5, abs=0.1)
    assert column == pytest.approx((30 + 3 * frame) / SIZE[1], abs=0.15)


def test_what_appears_is_missing_before():
    assert of(lambda t: float(t > 9))[0] > 1.6


def test_a_double_is_missing_before_and_after():
    made = np.stack(
        [picture((30 + 3 * t, 45, 1), *([(110 - 3 * t, 20, 1)] if t in (8, 9) else [])) for t in range(20)]
    )
    assert missing(made, CLIP, 1, SHOWN)[0] > 1.6


def test_what_comes_and_goes_in_the_clip_may_do_so_in_the_loop():
    clip = as_moments([picture((80, 45, float(t % 20 < 5))) for t in range(80)])
    made = np.stack([picture((80, 45, float(t in (7, 8, 9)))) for t in range(20)])
    assert missing(made, clip, 1, SHOWN)[0] < 1.2


def test_what_leaves_by_the_border_is_not_missing():
    made = np.stack([picture((130 + 3 * t, 45, 1)) for t in range(20)])
    assert missing(made, CLIP, 1, SHOWN)[0] < 1.2


def test_what_is_to_stand_still_does_not_count():
    made = np.stack([picture((80, 45, float(t > 9))) for t in range(20)])
    assert missing(made, CLIP, 1, X < 60)[0] == 0


def test_the_kernel_finds_the_likenesses_that_numpy_finds(monkeypatch):
    rng = np.random.default_rng(0)
    clip = rng.random((9, 12, 17), dtype=np.float32)
    made = rng.random((6, 12, 17), dtype=np.float32)
    compiled = strangeness(made, clip, 5, 1)
    monkeypatch.setattr("toposeam._kernels.library", None)
    np.testing.assert_allclose(compiled, strangeness(made, clip, 5, 1), rtol=1e-5)


def test_what_passes_now_and_then_does_not_hide_its_cut():
    rng = np.random.default_rng(0)
    clip = np.full((40, 24, 32), 0.5, np.float32)
    for passing in [t for t in range(40) if t % 10 < 4]:
        clip[passing, 8:16, 12:20] += 0.3 * rng.choice([-1, 1], (8, 8))
    made = clip[9:21].copy()
    made[1:-1, 8:16, 16:20] = clip[9::-1, 8:16, 16:20]  # halves of two different ones
    found = strangeness(made, clip, 10, 0)
    assert found[7:9].max() > 1.5
    assert found[5].max() == 0
