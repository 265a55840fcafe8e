"""Verdicts on what a joined picture shows: steps of tone, hue and grain across its seams."""

import numpy as np
import pytest

import toposeam as ts

CUT = np.arange(260) >= np.full((200, 1), 130)


def flat(colour, noise=0.0, seed=0):
    grain = np.random.default_rng(seed).normal(0, 1, (200, 260, 1)) * noise
    return np.clip(np.round(np.array(colour, float) + grain), 0, 255).astype(np.uint8)


def scene(seed=3):
    """Stripes, and texture that grows from left to right."""
    rng = np.random.default_rng(seed)
    rows = 128 + 60 * np.sin(np.arange(200) / 9)[:, np.newaxis] + np.zeros((1, 260))
    rough = rng.normal(0, 1, (200, 260)) * np.linspace(2, 30, 260)
    return np.clip(rows + rough, 0, 255)[..., np.newaxis].repeat(3, axis=2)


def joined(a, b):
    return np.where(CUT[..., np.newaxis], b, a)


STEPS = {
    "gray": (flat([128] * 3), flat([134] * 3)),
    "pink": (flat([128] * 3), flat([134, 128, 128])),
    "blue": (flat([128] * 3), flat([128, 128, 136])),
    "dark": (flat([20] * 3), flat([24] * 3)),
    "noise": (flat([128] * 3, 4), flat([136] * 3, 4, seed=1)),
    "grain": (flat([128] * 3, 4), flat([128] * 3)),
}


@pytest.mark.parametrize("kind", STEPS)
@pytest.mark.parametrize("known", [False, True])
def test_a_step_on_plain_ground_is_seen(kind, known):
    pictures = STEPS[kind]
    verdict = ts.verdict(joined(*pictures), CUT.astype(int), list(pictures) if known else None)
    assert not verdict.unseen
    assert verdict.step > 1
    assert abs(verdict.where[0] - 130) < 3


@pytest.mark.parametrize("pictures", [(flat([128] * 3), flat([129] * 3)), (flat([60] * 3, 3),) * 2])
def test_what_eyes_do_not_find_is_unseen(pictures):
    verdict = ts.verdict(joined(*pictures), CUT.astype(int), list(pictures))
    assert verdict.unseen
    assert verdict.step < 1


def test_texture_hides_a_step_that_plain_ground_shows():
    rough = flat([120] * 3, 30)
    brighter = np.clip(rough.astype(int) + 6, 0, 255).astype(np.uint8)
    assert ts.verdict(joined(rough, brighter), CUT.astype(int), [rough, brighter]).step < 1
    assert ts.verdict(joined(*STEPS["gray"]), CUT.astype(int), list(STEPS["gray"])).step > 2


def test_an_edge_of_the_scene_along_the_seam_is_no_step():
    edge = joined(flat([60] * 3), flat([200] * 3))
    assert ts.verdict(edge, CUT.astype(int), [edge, edge]).step == 0
    assert ts.verdict(edge, CUT.astype(int)).step > 10  # nothing tells it from a seam


def broken(by, texture=0.0):
    """Two pictures of a dark line, in texture, of which the second shows it some px lower."""
    rng = np.random.default_rng(5)
    pictures = []
    for shift in (0, by):
        one = 150 + texture * rng.normal(0, 1, (200, 260))
        one[100 + shift : 104 + shift] -= 60
        pictures.append(np.clip(one, 0, 255).astype(np.uint8)[..., np.newaxis].repeat(3, axis=2))
    return pictures


@pytest.mark.parametrize(
    ("by", "texture", "seen"), [(0, 0, False), (3, 0, True), (3, 3, True), (3, 60, False)]
)
def test_a_line_that_steps_at_the_seam_is_named(by, texture, seen):
    a, b = broken(by, texture)
    verdict = ts.verdict(joined(a, b), CUT.astype(int), [a, b])
    assert verdict.unseen != seen
    if seen:
        assert abs(verdict.where[0] - 130) < 10
        assert abs(verdict.where[1] - 103) < 12


def test_pictures_that_differ_are_not_named_for_that():
    a, b = (np.random.default_rng(seed).integers(0, 255, (200, 260, 3), np.uint8) for seed in (1, 2))
    verdict = ts.verdict(joined(a, b), CUT.astype(int), [a, b])
    assert verdict.worst < 0.1
    assert verdict.unseen


def test_what_fills_a_hole_is_no_break_of_the_seam():
    a, b = broken(3)
    holes = CUT.astype(int)
    holes[90:116] = -1
    pictures = [ts.Layer(one, mask=holes >= 0) for one in (a, b)]
    made = ts.layers.restitch(pictures, [(holes == index) for index in (0, 1)], {})
    (verdict,) = made.verdicts(window=lambda *at: joined(a, b)[at]).values()
    assert verdict.unseen


def test_a_wide_blend_hides_a_step_until_it_is_large():
    share = np.clip((np.arange(260) - 70) / 120, 0, 1)[np.newaxis, :, np.newaxis]
    for more, seen in ((3, False), (40, True)):
        a, b = flat([128] * 3), flat([128 + more] * 3)
        mixed = np.round(a + share * (b.astype(float) - a)).astype(np.uint8)
        assert (ts.verdict(mixed, CUT.astype(int), [a, b]).step > 1) == seen


def test_the_verdict_of_a_stitch_counts_in_the_crop():
    made = ts.stitch(ts.layers.overlapping(*STEPS["gray"], overlap=60), blend="none")
    x, y = made.verdict.where
    cropped = made.crop((10, x - 20, 120, x + 20))
    assert cropped.verdict.inside(cropped.cropped).where[0] == pytest.approx(20, abs=3)
    assert made.summary(optima=False)["look_at"] == [x, y]
    assert made.summary(optima=False)["step"] > 1
    away = made.crop((0, 0, 200, 60))
    assert away.verdict.inside(away.cropped).unseen


@pytest.mark.parametrize("dtype", [np.uint16, np.float32, np.float64])
def test_depth_changes_nothing(dtype):
    a, b = STEPS["gray"]
    scale = 257 if dtype == np.uint16 else dtype(1 / 255)
    pictures = [
        (one * scale).astype(dtype) if dtype != np.uint16 else one.astype(dtype) * 257 for one in (a, b)
    ]
    expected = ts.verdict(joined(a, b), CUT.astype(int), [a, b]).step
    assert ts.verdict(joined(*pictures), CUT.astype(int), pictures).step == pytest.approx(expected, rel=1e-3)


def test_gray_planes_and_odd_sizes():
    a, b = (one[:199, :259, 0] for one in STEPS["gray"])
    cut = CUT[:199, :259].astype(np.int64)
    assert ts.verdict(np.where(cut > 0, b, a), cut, [a, b]).step > 1
    assert ts.verdict(np.zeros((3, 3)), np.zeros((3, 3), int)).unseen


def test_windows_of_large_pictures_are_judged_alike(monkeypatch):
    made = ts.stitch(ts.layers.overlapping(*STEPS["gray"], overlap=60), blend="none")
    again = ts.stitch(ts.layers.overlapping(*STEPS["gray"], overlap=60), blend="none")
    first = made.verdicts()
    second = again.verdicts(window=lambda *at: again.window(*at)[0])
    assert {pair: one.step for pair, one in first.items()} == {pair: one.step for pair, one in second.items()}


@pytest.mark.parametrize(
    ("label_map", "pictures", "kind"),
    [
        (np.zeros((3, 4), int), None, ts.ImageError),
        (np.full((200, 260), 0.5), None, ts.OptionError),
        (CUT.astype(int) + 1, list(STEPS["gray"]), ts.OptionError),
        (CUT.astype(int) - 1, list(STEPS["gray"]), ts.OptionError),
        (CUT.astype(int), [STEPS["gray"][0], STEPS["gray"][1][:9]], ts.ImageError),
        (CUT.astype(int), 7, ts.OptionError),
    ],
)
def test_what_cannot_be_judged_is_one_sentence(label_map, pictures, kind):
    with pytest.raises(kind):
        ts.verdict(STEPS["gray"][0], label_map, pictures)
