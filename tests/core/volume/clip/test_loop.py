"""Loops: clips that come back are found out, every pixel's frames follow each other, light is levelled."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.volume.clip import Jump, LoopVerdict, closed_walk
from toposeam.volume.clip import walk as walks
from toposeam.volume.clip.frames import as_clip
from toposeam.volume.clip.period import jump_costs, small_mask
from toposeam.volume.clip.survey import survey_of
from toposeam.volume.clip.walk import walk_length


def turning(frames, period, size=24):
    """A spoked wheel that turns once in a period."""
    y, x = np.indices((size, size)) - (size - 1) / 2
    turn = np.arctan2(y, x) - 2 * np.pi * np.arange(frames)[:, None, None] / period
    return (0.5 + 0.4 * np.cos(turn)).astype(np.float32)


def drifting(frames, size=(20, 28), seed=0):
    """Smooth noise that moves on and never comes back."""
    rng = np.random.default_rng(seed)
    texture = ndimage.gaussian_filter(rng.standard_normal((size[0], size[1] + 4 * frames)), 2, mode="wrap")
    texture = (texture - texture.min()) / np.ptp(texture)
    return np.stack([texture[:, 2 * t : 2 * t + size[1]] for t in range(frames)]).astype(np.float32)


def test_frames_are_compared_by_means_over_squares():
    frames = np.zeros((2, 80, 81, 1), np.uint8)
    frames[0, ::2] = 255  # every other row
    frames[1, :, :27] = 255
    small = survey_of(as_clip(frames)[0], 1, None, None).small
    assert small.shape == (2, 26, 27, 1)  # squares of 3 px, so that about 1500 are left at most
    assert small[0, :2, 0, 0].tolist() == pytest.approx([2 / 3, 1 / 3])
    long = np.zeros((1000, 60, 60, 1), np.uint8)
    assert survey_of(as_clip(long)[0], 1, None, None).small.shape == (
        1000,
        20,
        20,
        1,
    )  # 400 px, as there are a million pairs
    assert small[1, :, :9] == pytest.approx(1.0)
    assert small[1, :, 9:] == pytest.approx(0.0)
    mask = np.zeros((80, 81), bool)
    mask[:, :28] = True  # a third of the squares in the tenth column
    assert small_mask(mask, (26, 27)).sum(axis=1).tolist() == [9] * 26


def test_a_period_is_found():
    made = ts.loop(turning(40, 13))
    assert len(made.frames) in (13, 26)
    assert np.abs(made.frames[0] - made.frames[-1]).max() <= np.abs(np.diff(made.frames, axis=0)).max() + 1e-6


@pytest.mark.parametrize("seed", range(3))
def test_every_pixel_goes_on_by_one_frame_or_by_the_jump(seed):
    clip = drifting(40, seed=seed)
    made = ts.loop(clip, transition=8, level=False)
    (jump,) = made.jumps
    assert len(made.frames) == jump.leaves - jump.enters
    step = np.diff(np.concatenate([made.source, made.source[:1]]), axis=0)
    assert set(np.unique(step)) <= {1, 1 - jump.period, 1 + jump.period}
    assert (np.sum(step, axis=0) == 0).all()
    np.testing.assert_array_equal(made.frames, np.take_along_axis(clip, made.source.astype(int), 0))


def test_the_surface_costs_no_more_than_any_single_cut():
    clip = drifting(40)
    made = ts.loop(clip, transition=8, gradient=False)
    jump, surface = made.jumps[0], made.surfaces[0]
    apart = np.abs(clip[jump.leaves :][:8] - clip[jump.enters :][:8])
    cuts = [float((apart[t] + apart[t + 1] + 1e-3).sum()) for t in range(7)]
    assert surface.cost <= min(cuts) * (1 + 1e-6)


def test_length_and_start_are_kept():
    clip = drifting(40)
    made = ts.loop(clip, length=20, start=5, transition=6)
    assert (made.jumps[0].leaves, made.start, len(made.frames)) == (25, 5, 20)
    ranged = ts.loop(clip, length=(17, 19), transition=6)
    assert 17 <= len(ranged.frames) <= 19


def test_colours_and_depth_are_kept():
    clip = np.rint(drifting(24)[..., None] * (60000, 40000, 20000)).astype(np.uint16)
    made = ts.loop(clip, transition=5)
    assert made.frames.dtype == np.uint16
    assert made.frames.shape[1:] == clip.shape[1:]


def test_slow_light_is_levelled():
    clip = turning(40, 13)
    darker = clip * 0.5 + 0.4 * (1 - np.arange(40) / 40)[:, None, None].astype(np.float32)
    options = {"length": 26, "start": 0, "transition": 6}

    def jump_of_light(made):
        means = made.frames.mean(axis=(1, 2))
        return np.abs(np.diff(np.append(means, means[0]))).max()

    rough, even = (ts.loop(darker, level=level, **options) for level in (False, True))
    assert jump_of_light(even) < 0.2 * jump_of_light(rough)
    # What is left is the wheel: levelling takes away the darkening, and nothing of the turning.
    kept = even.frames - even.frames.mean(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(kept.std(axis=(1, 2)), 0.5 * clip[0].std(), rtol=0.1)


def clouds(frames, seed=0, size=(48, 64)):
    """Wide soft forms that come and go and never come back."""
    noise = np.random.default_rng(seed).standard_normal((frames, *size))
    soft = ndimage.gaussian_filter(noise, (6, 10, 10), mode="wrap")
    return (0.5 + 0.15 * soft / soft.std()).astype(np.float32)


def test_clouds_are_levelled_by_themselves_and_a_wheel_is_not():
    made = ts.loop(clouds(48))
    assert made.settings["level"] is True
    assert made.verdict.unseen
    hard = ts.loop(clouds(48), level=False)
    assert not hard.verdict.unseen
    x, y = hard.verdict.where
    assert str(hard.verdict) == f"look at frame {hard.verdict.frame} at {x},{y}"
    assert hard.verdict.summary()["look_at_frame"] < hard.transition
    wheel = ts.loop(turning(40, 13))
    assert wheel.settings["level"] is False
    assert str(wheel.verdict) == "will not be seen"


@pytest.mark.parametrize(("kind", "moved"), [("camera", True), ("object", False), ("window", False)])
def test_a_camera_that_moves_is_told_from_things_that_do(kind, moved):
    rough = np.random.default_rng(0).standard_normal((80, 280))
    scene = ndimage.gaussian_filter(rough, 1.5)
    scene = (0.5 + 0.2 * scene / scene.std()).astype(np.float32)
    clip = np.stack([scene[:64, 3 * t : 3 * t + 80] for t in range(60)])
    if kind != "camera":  # half of the picture stands still, or a quarter as round a window
        still = 40 if kind == "object" else 20
        clip[:, :, :still] = clip[0, :, :still]
    made = ts.loop(clip, transition=6, level=False)
    assert (made.verdict.moved is not None) is moved
    if moved:
        assert made.verdict.moved == (3 * 57, 0)


@pytest.mark.parametrize("axis", [1, 2])
@pytest.mark.parametrize(("by", "moves"), [(3, False), (4, True)])
def test_a_camera_that_trembles_a_little_stands_still(axis, by, moves):
    """It moves in every frame, but by less than a twentieth of the frame's length in the end."""
    scene = ndimage.gaussian_filter(np.random.default_rng(1).standard_normal((48, 84)), 1)
    clip = np.stack([scene[:, by * (t % 2) :][:, :80] for t in range(15)])
    clip = (0.5 + 0.2 * clip / clip.std()).astype(np.float32)
    clip = clip.transpose(0, 2, 1) if axis == 1 else clip
    found = ts.loop(clip, length=8, start=0, transition=4, level=False).verdict
    assert found.moved == (((0, by), (by, 0))[axis - 1] if moves else None)


def test_a_verdict_says_how_much_shows_and_in_which_frame():
    shown = []
    for white, by in (1, 0.04), (1, 0.08), (50000, 0.08):
        clip = np.full((20, 9, 14, 1), 0.4) + by * (np.arange(20) >= 9)[:, None, None, None]
        clip = clip.astype(np.float32) if white == 1 else np.rint(white * clip).astype(np.uint16)
        made = ts.loop(clip, length=12, start=2, transition=6, level=False, data_range=white)
        first = made.source[:6, :1, :1]
        assert (made.source[:6] == first).all()  # all at once, where nothing else changes
        changes = np.flatnonzero(np.diff(first.ravel().astype(int)) != 1)
        assert made.verdict.frame == changes[0]
        shown.append(made.verdict.shows)
    assert shown[1] == pytest.approx(4 * shown[0], rel=1e-4)  # the squares of steps count
    assert shown[2] == pytest.approx(shown[1], rel=1e-3)
    turned = ts.loop(drifting(24).transpose(0, 2, 1), length=12, start=2, transition=6, level=False)
    upright = ts.loop(drifting(24), length=12, start=2, transition=6, level=False)
    assert turned.verdict.shows == pytest.approx(upright.verdict.shows, rel=1e-4)
    assert turned.verdict.frame == upright.verdict.frame


def test_a_verdict_counts_as_unseen_up_to_what_is_just_seen():
    just, more = (
        LoopVerdict(shows=1.0, frame=3),
        LoopVerdict(shows=1.2345, frame=3, where=(40, 30), moved=(7, 2)),
    )
    assert just.unseen
    nowhere = {"look_at_frame": None, "look_at": None}
    assert just.summary() == {"shows": 1.0, **nowhere, "camera_moved": None}
    assert not more.unseen
    there = {"look_at_frame": 3, "look_at": [40, 30]}
    assert more.summary() == {"shows": 1.234, **there, "camera_moved": [7, 2]}


def test_what_is_to_stand_still_does():
    still = np.zeros((20, 28), bool)
    still[:, :12] = True
    made = ts.loop(drifting(40), still=still, transition=6)
    assert (made.frames[:, still] == made.frames[0, still]).all()
    assert len(np.unique(made.source[:, still])) == 1
    assert (np.diff(made.frames[:, ~still], axis=0) != 0).any()


@pytest.mark.medium
def test_growing_makes_a_longer_clip_that_still_repeats():
    clip = drifting(60)
    made = ts.loop(clip, grow=150, transition=6, seed=3)
    assert len(made.frames) >= 150
    step = np.diff(np.concatenate([made.source, made.source[:1]]), axis=0)
    periods = {jump.period for jump in made.jumps}
    assert set(np.unique(step)) <= {1} | {1 - p for p in periods} | {1 + p for p in periods}
    again, other = (ts.loop(clip, grow=150, transition=6, seed=seed) for seed in (3, 4))
    np.testing.assert_array_equal(again.source, made.source)
    assert [jump.enters for jump in other.jumps] != [jump.enters for jump in made.jumps]


def test_the_least_change_is_found_pixel_by_pixel():
    small = np.random.default_rng(0).random((12, 2, 3, 1)).astype(np.float32)
    lag, transition = 4, 3
    apart = np.abs(small[lag:] - small[:-lag])[..., 0]
    for t, score in enumerate(jump_costs(small, lag, transition, np.ones((2, 3), bool))):
        pairs = [apart[t + k] + apart[t + k + 1] for k in range(transition - 1)]
        assert score == pytest.approx(np.min(pairs, axis=0).mean(), rel=1e-5)
    assert t == 12 - lag - transition


def test_a_walk_closes_and_never_runs_out_of_the_clip():
    jumps = [Jump(30, 4, 1.0), Jump(12, 25, 1.1), Jump(38, 10, 1.3), Jump(20, 2, 9.0)]
    for seed in range(20):
        walk = closed_walk(jumps, 4, 200, np.random.default_rng(seed))
        assert walk_length(walk) >= 200
        assert Jump(20, 2, 9.0) not in walk
        for jump, after in zip(walk, [*walk[1:], walk[0]], strict=True):
            assert after.leaves >= jump.enters + 4


def test_a_loop_shows_itself_in_a_line_and_a_picture():
    made = ts.loop(turning(30, 10))
    assert repr(made).startswith("Loop(")
    assert "\n" not in repr(made)
    assert made._repr_png_().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"frames": np.zeros((1, 4, 4))}, "at least 4"),
        ({"frames": np.zeros((4, 4))}, "pass a non-empty"),
        ({"length": 21}, "use a length of at most 18"),
        ({"length": 3, "transition": 5}, "shorter than its transition"),
        ({"length": (9, 8)}, "least number of frames first"),
        ({"length": 2.5}, "whole number"),
        ({"start": 30}, "start is 30"),
        ({"start": 20, "transition": 6}, "shorter than its transition"),
        ({"transition": 1}, "transition is 1"),
        ({"transition": 13}, "use at most 12"),
        ({"still": np.ones((4, 4))}, "leave something that moves"),
        ({"still": np.ones((3, 4))}, "one value per pixel"),
        ({"grow": 100, "length": 10}, "leave length and start out"),
        ({"grow": 2}, "grow is 2"),
        ({"gradient": True, "cost": ts.seam.MatchCost()}, "leave gradient out"),
        ({"level": "yes"}, "choose one of True, False"),
        ({"tolerence": 1}, "does not know"),
    ],
)
def test_bad_input_is_one_sentence(change, text):
    given = {"frames": np.random.default_rng(0).random((24, 4, 4)), **change}
    with pytest.raises(ts.TopoSeamError, match=text):
        ts.loop(given.pop("frames"), **given)


def test_a_walk_closes_by_a_dear_jump_if_no_cheap_one_does():
    home = Jump(8, 4, 9.0)
    walk = closed_walk([Jump(6, 4, 1.0), Jump(12, 9, 3.0), home], 4, 4, np.random.default_rng(0))
    assert walk[0] == home


@pytest.mark.timeout(60)  # else they are taken for ever
def test_a_walk_takes_no_jump_from_which_there_is_no_way_back():
    home, trap, way = Jump(9, 0, 1.0), Jump(16, 11, 0.9), Jump(14, 5, 1.1)
    for seed in range(20):
        walk = closed_walk([home, trap, way], 4, 100, np.random.default_rng(seed))
        assert set(walk) == {home, way}
        for jump, after in zip(walk, [*walk[1:], walk[0]], strict=True):
            assert after.leaves >= jump.enters + 4


@pytest.mark.timeout(60)
def test_a_clip_from_which_few_jumps_lead_back_is_grown():
    """Noise, found by the fuzzer: its cheapest jumps lead nowhere."""
    noise = (np.random.default_rng(0).random((16, 24, 1)) * 65535).astype(np.uint16)
    assert len(ts.loop(noise, grow=40, seed=4).frames) >= 40


@pytest.mark.timeout(60)
def test_a_walk_ends_as_soon_as_it_is_long_enough():
    rng, home, other = np.random.default_rng(0), Jump(8, 4, 1.0), Jump(9, 0, 1.0)
    assert closed_walk([home, other], 4, 4, rng) == [home]  # it shows 4 frames, as long as a transition
    assert len(closed_walk([home, other], 4, 5, rng)) > 1
    assert closed_walk([other], 4, 9, rng) == [other]
    assert closed_walk([other], 4, 10, rng) == [other, other]
    assert closed_walk([Jump(4, 0, 1.0)], 4, 5, rng) == 2 * [Jump(4, 0, 1.0)]


def test_a_walk_takes_jumps_up_to_twice_as_dear_in_turn():
    jumps = [Jump(20, 0, 1.0), Jump(30, 16, 2.0), Jump(24, 7, 1.0), Jump(40, 0, 2.1), Jump(50, 27, 1.0)]
    walk = closed_walk(jumps, 4, 1500, np.random.default_rng(0))
    counts = [walk.count(jump) for jump in jumps]
    assert counts[3:] == [0, 0]  # too dear; from 27 on there is no way back
    assert max(counts) - min(counts[:3]) <= 3
    assert 1500 <= walk_length(walk) < 1550


def test_a_long_walk_is_counted_on_as_it_is_walked(monkeypatch):
    monkeypatch.setattr(walks, "walk_length", None)
    walk = closed_walk([Jump(20, 0, 1.0), Jump(30, 4, 1.2)], 4, 5000, np.random.default_rng(0))
    assert 5000 <= walk_length(walk) < 5100


def test_a_loop_grown_beyond_memory_is_refused():
    with pytest.raises(ts.OptionError, match="grow is 10000000, which makes more than 1000 million values"):
        ts.loop(np.random.default_rng(0).random((12, 16, 16)), grow=10**7)


def test_a_walk_prefers_cheap_jumps_at_any_cost_scale():
    costs = {30: 1.0, 25: 1.6, 38: 1.9}
    walks = []
    for scale in (1e-4, 1.0, 1e4):
        jumps = [Jump(leaves, 4, scale * cost) for leaves, cost in costs.items()]
        walk = closed_walk(jumps, 4, 3000, np.random.default_rng(1))
        walks.append([jump.leaves for jump in walk])
    assert walks[0] == walks[1] == walks[2]
    # Each is taken in its turn: what was taken less often comes first, and then what is cheaper.
    assert walks[1].count(30) >= walks[1].count(25) >= walks[1].count(38) > len(walks[1]) / 4


class Read:
    """A clip that is read by slices only, and remembers which."""

    def __init__(self, frames):
        self._frames = frames
        self.shape, self.dtype = frames.shape, frames.dtype
        self.read = []

    def __getitem__(self, part):
        self.read.append((part.start, part.stop))
        return self._frames[part]


@pytest.mark.parametrize("level", [False, True])
def test_a_clip_is_read_part_by_part(level):
    clip = np.rint(drifting(40)[..., None] * (255, 200, 100)).astype(np.uint8)
    lazy = Read(clip)
    made, whole = (ts.loop(one, level=level, transition=6) for one in (lazy, clip))
    (jump,) = made.jumps
    assert lazy.read[0] == (0, 40)
    stretches = [(jump.leaves - 1, jump.leaves + 6), (jump.enters, jump.enters + 7)]
    assert lazy.read[1:] == stretches  # it is not painted yet
    np.testing.assert_array_equal(np.concatenate(list(made.blocks())), whole.frames)


def ball(frames=60, size=(60, 90)):
    """A ball that crosses the picture once: no two moments are alike."""
    rng = np.random.default_rng(0)
    ground = 0.4 + 0.1 * ndimage.gaussian_filter(rng.standard_normal(size), 3, mode="wrap")
    y, x = np.indices(size)
    clip = []
    for t in range(frames):
        there = (x - 10 - 1.2 * t) ** 2 + (y - 30 - 8 * np.sin(t / 9)) ** 2 < 81
        clip.append(np.where(there, 0.9, ground + 0.01 * rng.standard_normal(size)))
    return np.stack(clip).astype(np.float32)


def test_a_thing_that_is_cut_or_doubled_for_some_frames_is_seen():
    verdict = ts.loop(ball()).verdict
    assert not verdict.unseen
    assert verdict.frame < 15


def test_of_a_clip_with_cuts_the_longest_shot_is_taken():
    shots = turning(20, 9), 4 + turning(40, 13), 8 + turning(16, 7)
    clip = 0.1 * np.concatenate(shots)
    made = ts.loop(clip)
    assert made.shot == (20, 60)
    assert len(made.frames) in (13, 26)
    assert made.source.min() >= 20
    assert made.source.max() < 60
    assert ts.loop(clip, start=2, length=9, transition=3).shot == (0, 20)
    with pytest.raises(ts.OptionError, match="the shot of frames 20 to 59 has 40"):
        ts.loop(clip, transition=21)


def test_pictures_that_stand_between_cuts_are_shots():
    one, other = (np.repeat(turning(1, 9) + more, count, axis=0) for more, count in ((0, 30), (2, 20)))
    assert ts.loop(0.2 * np.concatenate([one, other])).shot == (0, 30)


def test_large_frames_are_joined_on_squares(monkeypatch):
    """Every pixel still goes on by one frame, or by the jump; what is levelled has no step at the surface."""
    monkeypatch.setattr("toposeam.volume.clip.loop._WORKING_VOXELS", 4000)
    clip = drifting(40, (40, 56))
    made = ts.loop(clip, transition=8, level=False)
    assert made.side > 1
    step = np.diff(np.concatenate([made.source, made.source[:1]]), axis=0)
    assert set(np.unique(step)) <= {1, 1 - made.jumps[0].period, 1 + made.jumps[0].period}
    np.testing.assert_array_equal(made.frames, np.take_along_axis(clip, made.source.astype(int), 0))
    soft = clouds(48)
    hard, even = (ts.loop(soft, length=24, start=0, transition=12, level=level) for level in (False, True))
    assert even.side > 1
    steps = [np.abs(np.diff(frames, axis=0)).max() for frames in (hard.frames, soft, even.frames)]
    assert steps[0] > 3 * steps[1]  # else this clip tells nothing
    assert steps[2] < 1.3 * steps[1]


@pytest.mark.medium
def test_of_long_clips_a_period_is_found_between_some_moments():
    y, x = np.indices((8, 8)) - 3.5
    rng = np.random.default_rng(0)
    turn = np.cumsum(rng.uniform(0.02, 0.2, 4500))
    turn[3700:] = turn[700 : 700 + 800]  # comes back once, 3000 frames later
    clip = 0.5 + 0.4 * np.cos(np.arctan2(y, x) - turn[:, None, None]).astype(np.float32)
    clip += 0.3 * np.sin(turn / 40)[:, None, None].astype(np.float32)
    made = ts.loop(clip, transition=6)
    assert made.verdict.unseen


@pytest.mark.parametrize("size", [(1, 300), (300, 1), (1, 1), (2, 513)])
def test_thin_frames_are_looped(size):
    made = ts.loop(np.random.default_rng(0).random((12, *size)))
    assert made.frames.shape[1:] == size
