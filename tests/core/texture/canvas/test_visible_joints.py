import numpy as np
import pytest

from toposeam.texture.canvas import JointSteps, JointVerdict, Lift, busyness
from toposeam.texture.exemplar import Atlas


@pytest.fixture
def halves():
    """An atlas of 40 × 40 px and its sample: dark above, bright below; and flat indices of rows of it."""
    atlas = Atlas.of([np.ones((40, 40), bool)], 4)
    gray = np.full((40, 40, 1), 0.2, np.float32)
    gray[20:] = 0.8
    flat = np.arange(atlas.usable.size, dtype=np.int32).reshape(atlas.usable.shape)[atlas.places[0]]
    return atlas, atlas.spread([gray]), flat


def judged(atlas, plane, index, wraps=(False, False), lift=None):
    steps = JointSteps(index, atlas, wraps)
    steps.add(plane[..., 0], np.ones(1, np.float32), lift)
    return steps.verdict(0.0, index.size, None)


def test_steps_between_copies_are_counted(halves):
    atlas, plane, flat = halves
    index = np.concatenate([flat[:10, :20], flat[25:35, 10:30]], axis=1)  # dark, and bright beside it
    found = judged(atlas, plane, index)
    assert found.joints == pytest.approx(1000 * 10 / 400)
    assert found.where == (19, 4)
    assert str(found) == "joints are seen, look at 19,4"
    round_it = judged(atlas, plane, index, (False, True))
    assert round_it.joints == pytest.approx(1000 * 20 / 400)


def test_steps_that_the_sample_has_there_are_none(halves):
    atlas, plane, flat = halves
    index = np.concatenate([flat[10:20, :20], flat[20:30, 3:23]])  # its own edge, from another place
    assert judged(atlas, plane, index).joints == 0
    assert judged(atlas, plane, index).where is None
    assert judged(atlas, plane, flat[:30, :30]).joints == 0


def test_joints_within_objects_count_less_than_steps(halves):
    atlas, plane, flat = halves
    index = np.concatenate([flat[:10, :20], flat[:10, 12:32]], axis=1)  # the same tone on either side
    steps = JointSteps(index, atlas, (False, False))
    steps.add_all(plane, 1.0)
    everywhere = np.ones(atlas.usable.shape, bool)
    assert steps.verdict(0.0, 400, None).joints == 0
    assert steps.verdict(0.0, 400, None, objects=~everywhere).joints == 0
    assert steps.verdict(0.0, 400, None, objects=everywhere).joints == pytest.approx(0.2 * 1000 * 10 / 400)


def test_light_that_evens_a_step_hides_it(halves):
    atlas, plane, flat = halves
    index = np.concatenate([flat[:10, :20], flat[25:35, 10:30]], axis=1)
    offset = np.zeros((10, 40, 1), np.float32)
    offset[:, 20:] = -0.55
    lift = Lift(gain=np.ones((1, 1, 1), np.float32), offset=offset, low=0, high=1)
    assert judged(atlas, plane, index, lift=lift).joints == 0


def test_busy_samples_hide_joints():
    pixels = np.zeros((60, 60, 1), np.float32)
    pixels[::3, ::3] = 0.5  # points, each with a step on either side
    assert busyness(pixels, np.ones((60, 60), bool)) == 0
    pixels = np.repeat(np.repeat(np.float32([0, 0.5]), 4)[np.newaxis], 60, axis=0).repeat(8, axis=0)[:60]
    tiled = np.tile(pixels, (1, 8))[:, :60, np.newaxis]  # edges 4 px apart, on one axis
    assert busyness(tiled, np.ones((60, 60), bool)) == pytest.approx(0.5 / 4, abs=0.01)
    assert busyness(tiled, np.zeros((60, 60), bool)) == 0
    busy = JointVerdict(joints=1.0, busy=0.04, shown=0.5, where=(1, 2))
    assert busy.noticed == pytest.approx(1 / 3)
    assert not busy.unseen
    assert JointVerdict(joints=0.8, busy=0.04, shown=0.5, where=(1, 2)).unseen


def test_the_place_to_look_at_goes_with_the_picture():
    verdict = JointVerdict(joints=4.0, busy=0.0, shown=0.5, where=(10, 20))
    assert verdict.rolled((30, 4), (100, 80)).where == (6, 90)
    assert verdict.summary() == {"joints": 4.0, "shown": 0.5, "look_at": [10, 20]}


def test_hues_of_one_brightness_are_told_apart_also_in_noise():
    noise = np.random.default_rng(0).normal(0, 0.04, (40, 40, 1)).astype(np.float32)
    pink, green = np.float32([0.75, 0.5, 0.55]), np.float32([0.5, 0.7, 0.6])  # both as bright
    sample = np.where(np.arange(40)[:, np.newaxis, np.newaxis] < 20, pink, green) + noise
    atlas = Atlas.of([np.ones((40, 40), bool)], 4)
    flat = np.arange(atlas.usable.size, dtype=np.int32).reshape(atlas.usable.shape)[atlas.places[0]]

    def counted(index, values, light=None):
        steps = JointSteps(index, atlas, (False, False))
        plane = atlas.spread([values])
        if light is None:
            steps.add_all(plane, 1.0)
        else:
            shown = steps.lit(light, plane, 1.0)
            [shown(channel) for channel in range(3)]
        return steps.verdict(0.0, index.size, None).joints

    beside = np.concatenate([flat[:10, :20], flat[26:36, 10:30]], axis=1)
    assert counted(beside, sample) >= 0.9 * 1000 * 10 / 400
    assert counted(beside, sample.mean(axis=2, keepdims=True)) <= 0.2 * 1000 * 10 / 400
    alike = np.concatenate([flat[:10, :20], flat[:10, 10:30]], axis=1)
    assert counted(alike, sample) <= 0.1 * 1000 * 10 / 400
    own = np.concatenate([flat[10:20, :20], flat[20:30, 3:23]])  # where the sample changes hue itself
    assert counted(own, sample) <= 0.1 * 1000 * 20 / 400

    def evened(channel):
        offset = np.zeros((10, 40, 1), np.float32)
        offset[:, 20:] = (pink - green)[channel]
        return Lift(gain=np.ones((1, 1, 1), np.float32), offset=offset, low=-1, high=2)

    assert counted(beside, sample, evened) <= 0.2 * 1000 * 10 / 400
    assert busyness(sample, np.ones((40, 40), bool)) == pytest.approx(0.5 / 37, abs=0.01)


def test_gray_pictures_in_colour_are_judged_as_gray(halves):
    atlas, plane, flat = halves
    index = np.concatenate([flat[:10, :20], flat[25:35, 10:30]], axis=1)
    gray, colour = (JointSteps(index, atlas, (False, False)) for _ in range(2))
    gray.add_all(plane, 1.0)
    colour.add_all(plane.repeat(3, axis=2), 1.0)
    assert gray.verdict(0.0, 400, None) == colour.verdict(0.0, 400, None)
