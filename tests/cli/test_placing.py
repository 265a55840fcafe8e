"""Where pictures come to lie, and what is refused before any work."""

import json
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
import scipy
import tifffile
from scipy import ndimage
from skimage import data

import toposeam as ts
from toposeam.layers.canvas import largest_full
from toposeam_cli.app.options import Length
from toposeam_cli.files.scratch import scratch as scratch_beside
from toposeam_cli.media.pictures.lens import in_pixels
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture
from toposeam_cli.stitching import inputs
from toposeam_cli.stitching.inputs import PlacedPictures, arrange, picture_number
from toposeam_cli.stitching.positions import Where

RNG = np.random.default_rng(5)


@pytest.fixture
def unlike(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, shape in (("a", (40, 60, 3)), ("b", (30, 50, 3))):
        write_picture(tmp_path / f"{name}.png", Picture(pixels=RNG.integers(0, 256, shape).astype(np.uint8)))
    return [tmp_path / "a.png", tmp_path / "b.png"]


@pytest.mark.parametrize(
    ("side", "at"), [("right", (45, 0)), ("left", (-35, 0)), ("bottom", (0, 30)), ("top", (0, -20))]
)
def test_b_lies_at_its_side_of_a_picture_of_another_size(unlike, side, at):
    overlap = Length(25, True)  # of A's 60 × 40 px: 15 px across, 10 px down
    job = arrange(unlike, Where(overlap=overlap, side=side), max_megapixels=1)
    assert [layer.at for layer in job.layers] == [(0, 0), at]


@pytest.mark.medium
def test_a_picture_within_another_one_is_told(toposeam, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    whole = data.astronaut()
    for name, pixels in (("a.png", whole), ("inner.png", whole[120:400, 100:380])):
        write_picture(name, Picture(pixels=pixels))
    ran = toposeam("stitch", "a.png", "inner.png", "-o", "out.png")
    assert ran.err == (
        "warning: inner.png shows nothing that a.png does not show as well; leave it out unless it is to "
        "cover what is there\n"
    )


@pytest.mark.parametrize(("mm", "agree"), [((50, 52), True), ((50, 53), False)])
def test_focal_lengths_count_that_all_files_agree_on(monkeypatch, tmp_path, mm, agree):
    asked, files = [], []
    for length in mm:
        exif = PIL.Image.Exif()
        exif.get_ifd(0x8769)[0xA405] = length  # as of 35 mm film
        files.append(tmp_path / f"{length}.jpg")
        PIL.Image.new("RGB", (60, 40)).save(files[-1], exif=exif)

    def unplaced(layers, options, *_):
        asked.append((options.focal, options.about))
        raise ts.OverlapError("apart")

    monkeypatch.setattr(inputs, "found_places", unplaced)
    with pytest.raises(ts.OverlapError):
        arrange(files, Where(), max_megapixels=1)
    assert asked == [(pytest.approx(in_pixels(51, (60, 40))), True) if agree else (None, False)]


@pytest.mark.parametrize("at", [(-20, -7), (25, -3), (-12, 11)])
def test_negative_places_move_the_canvas_not_the_pixels(unlike, at):
    job = arrange(unlike, Where(offset=at), max_megapixels=1)
    stitched = ts.stitch(job.layers)
    assert stitched.origin == (min(0, at[0]), min(0, at[1]))
    for layer, mask in zip(job.layers, stitched.masks, strict=True):
        x, y = (layer.at[axis] - stitched.origin[axis] for axis in (0, 1))
        height, width = layer.image.shape[:2]
        shows = mask[y : y + height, x : x + width]
        assert mask.sum() == shows.sum() > 0
        np.testing.assert_array_equal(
            stitched.image[y : y + height, x : x + width][shows], layer.image[shows]
        )


@pytest.mark.parametrize("suffix", [".jpg", ".jpeg"])
def test_a_jpeg_with_holes_is_refused_before_the_seam_search(unlike, toposeam, monkeypatch, suffix):
    monkeypatch.setattr(ts, "stitch", lambda *_, **__: pytest.fail("a seam was sought"))
    line = ("stitch", *unlike, "--offset", "30,5", "-o", f"out{suffix}", "--crop", "outside")
    toposeam(*line).fails("cannot hold")
    assert not list(unlike[0].parent.glob("out*"))


# Nobody says where the pictures lie


COFFEE = data.coffee()
PLACES = {"c": (210, 150), "a": (0, 0), "d": (10, 160), "b": (200, 4)}


@pytest.fixture
def crops(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, (x, y) in PLACES.items():
        noise = np.random.default_rng(ord(name)).normal(0, 1.5, (220, 300, 3))
        pixels = np.clip(COFFEE[y : y + 220, x : x + 300] * (0.9 + 0.05 * len(name)) + noise, 0, 255)
        write_picture(tmp_path / f"{name}.png", Picture(pixels=np.rint(pixels).astype(np.uint8)))
    return [f"{name}.png" for name in PLACES]


@pytest.mark.medium
def test_places_are_found_and_kept(crops, toposeam):
    ran = toposeam("stitch", *crops, "-o", "all.png", "--save-layout", "placed.toml", "--json")
    assert ran.code == 0, ran
    first = next(iter(PLACES.values()))
    expected = {f"{name}.png": [x - first[0], y - first[1]] for name, (x, y) in PLACES.items()}
    told = json.loads(ran.out)["layers"]
    assert {layer["name"]: layer["at"] for layer in told} == expected
    assert min(layer["correlation"] for layer in told) > 0.8
    assert toposeam("stitch", "placed.toml", "-o", "again.png").code == 0
    np.testing.assert_array_equal(read_picture("again.png").pixels, read_picture("all.png").pixels)


@pytest.mark.medium
def test_a_turned_picture_is_found_kept_and_turned_back(crops, toposeam, tmp_path):
    turned = ndimage.rotate(COFFEE[80:380, 150:520], 2, reshape=False, order=3)[40:260, 40:330]
    write_picture(tmp_path / "t.png", Picture(pixels=turned))
    line = ("a.png", "t.png", "c.png", "b.png")
    ran = toposeam("stitch", *line, "-o", "all.png", "--save-layout", "placed.toml", "--json")
    assert ran.code == 0, ran
    turns = {layer["name"]: layer["turn"] for layer in json.loads(ran.out)["layers"]}
    assert abs(turns["t.png"]) == pytest.approx(2, abs=0.1)
    assert max(abs(turns[name]) for name in ("a.png", "b.png", "c.png")) < 0.1
    assert toposeam("stitch", "placed.toml", "--as", "photographs", "-o", "again.png").code == 0
    again, first = (read_picture(name).pixels.astype(int) for name in ("again.png", "all.png"))
    assert again.shape == first.shape
    assert np.abs(again - first).mean() < 0.1


@pytest.mark.medium
def test_a_stranger_is_named(crops, toposeam, tmp_path):
    write_picture(tmp_path / "cat.png", Picture(pixels=data.chelsea()[:220, :300].copy()))
    write_picture(tmp_path / "white.png", Picture(pixels=np.full((220, 300, 3), 255, np.uint8)))
    toposeam("stitch", *crops, "-o", "all.png")
    ran = toposeam("stitch", "white.png", *crops, "cat.png", "-o", "most.png", "--keep", "0=white.png")
    assert ran.code == 0, ran
    assert "left out: white.png shows too little detail to be placed" in ran.err
    assert "left out: cat.png shares" in ran.err
    np.testing.assert_array_equal(read_picture("most.png").pixels, read_picture("all.png").pixels)
    for stranger in ("cat.png", "white.png"):
        line = ("stitch", *crops, stranger, "--exact", "-o", "exact.png")
        toposeam(*line).fails(f"{stranger} fits none of the other pictures")


@pytest.mark.medium
def test_a_grid_in_any_order(crops, toposeam):
    for order, names in (
        ("rows", "abdc"),
        ("columns", "adbc"),
        ("snake-rows", "abcd"),
        ("snake-columns", "adcb"),
    ):
        files = [f"{name}.png" for name in names]
        grid = ("--grid", "2x2", "--overlap", "30%", "--order", order)
        ran = toposeam("stitch", *files, *grid, "--json", "-o", f"{order}.png")
        assert ran.code == 0, ran
        places = {layer["name"][0]: layer["at"] for layer in json.loads(ran.out)["layers"]}
        assert places == {"a": [0, 0], "b": [210, 0], "d": [0, 154], "c": [210, 154]}
    toposeam("stitch", *crops, "--grid", "3x2", "--overlap", "30%", "-o", "o.png").fails("6 places for 4")
    toposeam("stitch", *crops, "--row", "-o", "o.png").fails("add --overlap")


@pytest.mark.medium
def test_tiff_files_say_where_they_lie(crops, toposeam):
    for name, (x, y) in PLACES.items():
        tifffile.imwrite(
            f"{name}.tif",
            read_picture(f"{name}.png").pixels,
            resolution=(150, 150),
            resolutionunit="INCH",
            extratags=[(286, 5, 1, (x, 150), True), (287, 5, 1, (y, 150), True)],
            metadata=None,
        )
    files = [f"{name}.tif" for name in PLACES]
    ran = toposeam("stitch", *files, "--json", "-o", "all.png")
    assert ran.code == 0, ran
    places = [tuple(layer["at"]) for layer in json.loads(ran.out)["layers"]]
    assert places == list(PLACES.values())


@pytest.mark.medium
def test_a_picture_that_cannot_be_read_is_left_out_when_asked(crops, toposeam, tmp_path):
    (tmp_path / "bad.png").write_bytes(b"\x89PNG broken")
    ran = toposeam("stitch", *crops, "bad.png", "-o", "all.png")
    ran.fails("bad.png")
    ran.fails("--skip-bad")
    two = toposeam("stitch", crops[0], "bad.png", "-o", "all.png")
    assert "--skip-bad" not in two.err  # no two would be left
    ran = toposeam("stitch", *crops, "bad.png", "-o", "all.png", "--skip-bad")
    assert ran.code == 0
    assert "left out: cannot read" in ran.err
    assert "bad.png" in ran.err


@pytest.mark.medium
def test_unrelated_pictures_at_given_places_cause_a_warning(crops, toposeam, tmp_path):
    write_picture(tmp_path / "cat.png", Picture(pixels=data.chelsea()[:220, :300].copy()))
    ran = toposeam("stitch", "a.png", "cat.png", "--offset", "200,0", "-o", "all.png")
    assert ran.code == 0
    assert "warning: a.png and cat.png show little in common" in ran.err
    assert toposeam("stitch", "a.png", "b.png", "--offset", "200,4", "-o", "ab.png").err == ""


@pytest.mark.medium
def test_warped_pictures_may_fit_to_some_px_only(crops, toposeam, tmp_path):
    """Leaves that moved are no other place; for pictures that only lie somewhere, every pixel counts."""
    rng = np.random.default_rng(5)
    slow = scipy.ndimage.gaussian_filter(rng.standard_normal((2, 220, 400)), (0, 9, 9)) * 400
    shown = np.stack([slow[0, :, :300], slow[0, :, 100:], slow[1, :, 100:]])
    own = 128 + shown + 50 * rng.standard_normal((3, 220, 300))
    for name, pixels in zip(("one", "two", "other"), np.clip(own, 0, 255).astype(np.uint8), strict=True):
        write_picture(tmp_path / f"{name}.png", Picture(pixels=pixels))
    place = {"at": "at = [{}, 0]", "warped": "matrix = [[1, 0, {}], [0, 1, 0], [1e-7, 0, 1]]"}
    told = {}
    for second in ("two", "other"):
        for kind, words in place.items():
            files = (f"[[layer]]\nfile = '{name}.png'\n" for name in ("one", second))
            text = "\n".join(file + words.format(x) for file, x in zip(files, (0, 100), strict=True))
            (tmp_path / "l.toml").write_text(text)
            ran = toposeam("stitch", "l.toml", "-o", "all.png", "--force")
            assert ran.code == 0, ran
            told[second, kind] = "show little in common" in ran.err
    strange = {pair for pair, said in told.items() if said}
    assert strange == {("two", "at"), ("other", "at"), ("other", "warped")}


@pytest.mark.parametrize("plain", [0, 255])
def test_a_plain_picture_at_a_given_place_gives_a_warning(crops, toposeam, tmp_path, plain):
    write_picture(tmp_path / "plain.png", Picture(pixels=np.full((220, 300, 3), plain, np.uint8)))
    ran = toposeam("stitch", "a.png", "plain.png", "--offset", "200,0", "-o", "all.png")
    assert ran.code == 0
    assert "a.png and plain.png show little in common where they overlap (correlation 0.00)" in ran.err
    sky = toposeam("stitch", "plain.png", "plain.png", "--offset", "200,0", "-o", "sky.png")
    assert (sky.code, sky.err) == (0, "")


def test_of_many_strangers_the_first_pairs_are_named(folder, toposeam):
    rng = np.random.default_rng(0)
    places = []
    for number in range(6):
        pixels = rng.integers(0, 256, (40, 40), np.uint8)
        PIL.Image.fromarray(pixels).save(folder / f"s{number}.png")
        places += ["--at", f"{20 * number},0"]
    ran = toposeam("stitch", *(f"s{number}.png" for number in range(6)), *places, "-o", "all.png")
    assert ran.code == 0
    assert ran.err.count("show little in common") == 3
    assert "warning: the same holds for 2 more pairs of pictures\n" in ran.err


def test_folders_and_layouts_are_no_pictures(unlike, toposeam):
    folder = unlike[0].parent
    (folder / "photos").mkdir()
    toposeam("stitch", "photos", "-o", "o.png").fails(
        "the folder 'photos' holds 0 pictures; put two or more there"
    )
    (folder / "placed.toml").write_text("")
    toposeam("stitch", "placed.toml", "a.png", "-o", "o.png").fails(
        "'placed.toml' is a layout; give it alone"
    )
    toposeam("stitch", "a.png", "b.png", "--at", "0,0", "-o", "o.png").fails("--at is given once for 2")


@pytest.mark.medium
def test_a_panorama_of_a_wrong_width_gives_a_warning(tmp_path, monkeypatch, toposeam):
    monkeypatch.chdir(tmp_path)
    scene = np.concatenate([COFFEE[:90], COFFEE[:90, ::-1]], axis=1)  # goes round
    at = []
    for index, x in enumerate(range(0, 1200, 240)):
        around = np.arange(x, x + 340) % 1200
        write_picture(tmp_path / f"w{index}.png", Picture(pixels=np.ascontiguousarray(scene[:, around])))
        at += ["--at", f"{x},0"]
    line = ("stitch", *(f"w{index}.png" for index in range(5)), *at, "--wrap")
    right = toposeam(*line, "1200", "-o", "right.png")
    assert (right.code, right.err) == (0, "")
    wrong = toposeam(*line, "1230", "-o", "wrong.png")
    assert wrong.code == 0
    warning = "warning: w4.png and w0.png show little in common where they overlap all the way round"
    assert warning in wrong.err
    assert "how wide --wrap is" in wrong.err


# What a format can hold


@pytest.mark.medium
def test_a_jpeg_is_cropped_to_what_has_no_holes(crops, toposeam):
    at = ("--at", "0,0", "--at", "200,4")
    assert toposeam("stitch", "a.png", "b.png", *at, "-o", "ab.jpg", "--labels", "l.png").code == 0
    assert read_picture("ab.jpg").pixels.shape == (216, 500, 3)
    assert read_picture("l.png").pixels.shape == (216, 500)
    line = ("stitch", "a.png", "b.png", *at, "--background", "#2040a0", "-o")
    assert toposeam(*line, "full.jpg", "--quality", "100").code == 0
    full = read_picture("full.jpg").pixels
    assert full.shape == (224, 500, 3)
    assert np.abs(full[221:, :190].astype(int) - (32, 64, 160)).max() < 12
    toposeam(*line, "o.png", "--quality", "50").fails("--quality is for .jpg")
    toposeam("stitch", "a.png", "b.png", *at, "--background", "no", "-o", "o.png").fails("colour's name")


@pytest.mark.parametrize("seed", range(5))
def test_the_largest_rectangle_without_holes(seed):
    mask = np.random.default_rng(seed).random((9, 13)) > 0.2
    box = largest_full(mask)
    best = max(
        (bottom - top) * (right - left)
        for top in range(9)
        for bottom in range(top + 1, 10)
        for left in range(13)
        for right in range(left + 1, 14)
        if mask[top:bottom, left:right].all()
    )
    assert mask[box.slices].all()
    assert box.shape[0] * box.shape[1] == best


@pytest.mark.parametrize(
    ("step", "touches"),
    [
        ((59, 39), True),
        ((60, 0), False),
        ((0, 40), False),
        ((-49, -29), True),
        ((-50, 0), False),
        ((0, -30), False),
        ((45, 35), True),
        ((35, -30), False),
        ((-50, 39), False),
    ],
)
@pytest.mark.parametrize("begin", [(0, 0), (30, -7), (-100, 60)])
def test_two_pictures_have_a_pixel_in_common_or_are_refused(unlike, begin, step, touches):
    """A has 60 × 40 px, B 50 × 30."""
    where = Where(at=[begin, (begin[0] + step[0], begin[1] + step[1])])
    if touches:
        job = arrange(unlike, where, max_megapixels=1)
        assert [layer.at for layer in job.layers] == list(where.at)
        return
    told = rf"b.png at {step[0]},{step[1]} lies beside a.png, which is 60 × 40 px"
    with pytest.raises(ts.OverlapError, match=told):
        arrange(unlike, where, max_megapixels=1)


@pytest.mark.parametrize(("most", "stored"), [(60 * 40 + 50 * 30, False), (60 * 40 + 50 * 30 - 1, True)])
def test_pictures_with_too_many_pixels_wait_in_files(unlike, monkeypatch, most, stored):
    monkeypatch.setattr(inputs, "STORED_PIXELS", most)
    with scratch_beside(unlike[0].parent) as scratch:
        job = arrange(unlike, Where(offset=(20, 5)), max_megapixels=1, scratch=scratch)
        assert job.stored == stored
        assert all(isinstance(layer.image, np.ndarray) == (not stored) for layer in job.layers)
        np.testing.assert_array_equal(job.layers[1].image[:, :], read_picture(unlike[1]).pixels)
    assert not arrange(unlike, Where(offset=(20, 5)), max_megapixels=1).stored  # there is nowhere to wait


class Elsewhere:
    """Works in another folder, as workers on other machines do."""

    def __init__(self, folder, monkeypatch):
        self._folder, self._monkeypatch, self.paths = folder, monkeypatch, []

    def map(self, function, items):
        for item in list(items):
            self.paths.append(item[0])
            with self._monkeypatch.context() as there:
                there.chdir(self._folder)
                answer = function(item)
            yield answer


@pytest.mark.parametrize("stores", [True, False])
def test_only_workers_elsewhere_are_told_whole_paths(unlike, tmp_path_factory, monkeypatch, stores):
    there = unlike[0].parent if not stores else tmp_path_factory.mktemp("there")
    monkeypatch.setattr(inputs, "STORED_PIXELS", 0)
    files, executor = [Path("a.png"), Path("b.png")], Elsewhere(there, monkeypatch)
    with scratch_beside(unlike[0].parent) as scratch:
        more = {"scratch": scratch, "executor": executor, "stores": stores}
        job = arrange(files, Where(offset=(20, 5)), max_megapixels=1, **more)
        np.testing.assert_array_equal(job.layers[1].image[:, :], read_picture(unlike[1]).pixels)
    assert executor.paths == (unlike if stores else files), "errors name files as they were given"


def test_pictures_are_meant_by_their_numbers_or_only_names():
    names = {0: "a", 2: "b", 3: "b", 4: "1"}
    meant = {key: picture_number(key, names, 5) for key in ("a", "b", "0", "4", "5", "1", "-1", "c", "2")}
    assert meant == {"a": 0, "b": None, "0": 0, "4": 4, "5": None, "1": 4, "-1": None, "c": None, "2": 2}


def test_numbers_count_the_pictures_that_were_left_out():
    layers = tuple(ts.Layer(np.zeros((2, 2), np.uint8), name=name) for name in ("a", "c"))
    job = PlacedPictures(pictures=(), layers=layers, numbers=(0, 2), lost=("b",))
    meant = {key: job.number(key) for key in ("0", "a", "1", "b", "2", "c")}
    assert meant == {"0": 0, "a": 0, "1": None, "b": None, "2": 1, "c": 1}
    with pytest.raises(ts.OptionError, match=r"'3' is no picture .* from 0 to 2, or one of a, c$"):
        job.number("3")
    whole = PlacedPictures(pictures=(), layers=layers)
    assert [whole.number(key) for key in ("0", "1")] == [0, 1]
