"""What the engine answers: layers joined, joined again, aligned."""

import dataclasses
import io
import re

import numpy as np
import pytest
from engine_requests import message_of, points_of, result_of
from scipy import ndimage

import toposeam as ts
from toposeam.layers.registration import Residual
from toposeam_cli.commands.stitch import stitch
from toposeam_engine import kept, serving
from toposeam_engine.job import EngineJob
from toposeam_engine.places import PlacedLayers
from toposeam_engine.standing_out import standing_out
from toposeam_gimp.entries.seams import SEAM_ENTRIES

#: Rows and columns of two layers on their canvas.
PLACES = [np.s_[:30, :40], np.s_[5:, 20:]]


@pytest.mark.parametrize("ask", ["ask", "ask_process"])
def test_stitch_is_what_core_finds(request_folder, pair, ask):
    layers = [request_folder.raster("a", pair[0]), request_folder.raster("b", pair[1], (20, 5))]
    result = result_of(
        getattr(request_folder, ask)(operation="stitch", layers=layers, options={"method": "shortest-path"})
    )
    expected = ts.stitch(
        [ts.Layer(image=pair[0][..., :3]), ts.Layer(image=pair[1][..., :3], at=(20, 5))],
        method="shortest-path",
    )
    assert result["masks"][0] is None  # the lowest stays whole
    np.testing.assert_array_equal(request_folder.seen(result["masks"], PLACES, (35, 60)), expected.label_map)
    (line,) = result["seams"][0]["lines"]
    path = expected.seams[0].paths[0]
    assert ts.vector.Polyline(points_of(line), line["closed"]).length == path.length
    np.testing.assert_array_equal(points_of(line)[[0, -1]], path.points[[0, -1]])
    assert len(line["pieces"]) == len(line["curves"])


def test_layers_that_show_nowhere_are_told(request_folder, pair):
    patch = pair[0][25:5:-1, 35:10:-1].copy()
    layers = [request_folder.raster("a", pair[0]), request_folder.raster("b", pair[1], (20, 5))]
    layers.insert(1, request_folder.raster("patch", patch, (18, 7)))
    assert result_of(request_folder.ask(operation="stitch", layers=layers))["hidden"] == [1]


@pytest.mark.parametrize("place", [(-15, -9), (12, -6), (18, -27)])
def test_a_selection_beyond_the_layers_confines_the_seam(request_folder, pair, place):
    layers = [request_folder.raster("a", pair[0]), request_folder.raster("b", pair[1], (20, 5))]
    selected = np.full((60, 60), 255, np.uint8)
    selected[:, -3:] = 0
    selection = request_folder.raster("selection", selected, place)
    canvas = np.zeros((35, 60), bool)
    rows, columns = slice(max(place[1], 0), place[1] + 60), slice(max(place[0], 0), place[0] + 57)
    canvas[rows, columns] = True
    layers_of_core = [ts.Layer(pair[0][..., :3]), ts.Layer(pair[1][..., :3], at=(20, 5))]
    expected = ts.stitch(layers_of_core, avoid=~canvas)
    result = result_of(request_folder.ask(operation="stitch", layers=layers, selection=selection))
    np.testing.assert_array_equal(request_folder.seen(result["masks"], PLACES, (35, 60)), expected.label_map)


@pytest.mark.parametrize("place", [(-15, -9), (10, -2), (-3, 4)])
def test_a_selection_counts_where_it_lies(request_folder, pair, place):
    """Squares are left out here and there, so that any other place gives another seam."""
    layers = [request_folder.raster("a", pair[0]), request_folder.raster("b", pair[1], (20, 5))]
    y, x = np.indices((60, 60))
    selected = np.where((x % 7 < 4) | (y % 7 < 4), 255, 0).astype(np.uint8)
    selection = request_folder.raster("selection", selected, place)
    avoid = np.ones((35, 60), bool)
    y, x = np.indices(avoid.shape)
    x, y = x - place[0], y - place[1]
    inside = (x >= 0) & (y >= 0) & (x < 60) & (y < 60)
    avoid[inside & ((x % 7 < 4) | (y % 7 < 4))] = False
    layers_of_core = [ts.Layer(pair[0][..., :3]), ts.Layer(pair[1][..., :3], at=(20, 5))]
    expected = ts.stitch(layers_of_core, avoid=avoid)
    result = result_of(request_folder.ask(operation="stitch", layers=layers, selection=selection))
    shown = request_folder.pixels(result["masks"][1]) > 0
    np.testing.assert_array_equal(shown, expected.masks[1][5:, 20:])


def test_the_found_lines_applied_again_give_the_same_masks(request_folder, pair):
    layers = [request_folder.raster("a", pair[0], (-7, 3)), request_folder.raster("b", pair[1], (13, 8))]
    first = result_of(request_folder.ask(operation="stitch", layers=layers))
    found = request_folder.seen(first["masks"], PLACES, (35, 60))
    for path in request_folder.folder.glob("result-*"):
        path.unlink()
    seams = [
        {**seam, "lines": [{**line, "points": points_of(line).ravel().tolist()} for line in seam["lines"]]}
        for seam in first["seams"]
    ]
    seams = [{**seam, "touched": True} for seam in seams]
    shown = [None, request_folder.raster("shown", np.full((30, 40), 255, np.uint8))]
    second = result_of(request_folder.ask(operation="restitch", layers=layers, seams=seams, shown=shown))
    np.testing.assert_array_equal(request_folder.seen(second["masks"], PLACES, (35, 60)), found)


@pytest.mark.parametrize("blend", ts.layers.BLENDS)
def test_masks_and_blended_pixels_compose_core_s_result(request_folder, pair, blend):
    pair[1] = np.maximum(pair[1], 60)
    layers = [request_folder.raster("a", pair[0]), request_folder.raster("b", pair[1], (20, 5))]
    options = {"blend": blend, "blend_width": 6, "match_tones": True}
    result = result_of(request_folder.ask(operation="stitch", layers=layers, options=options))
    width = {"blend_width": 6.0} if blend in ("auto", "feather", "multiband", "gradient") else {}
    placed = [ts.Layer(image=pair[0][..., :3]), ts.Layer(image=pair[1][..., :3], at=(20, 5))]
    expected = ts.stitch(placed, blend=blend, match_tones=True, **width)
    canvas = np.zeros((*expected.masks[0].shape, 4), np.uint8)
    seen = request_folder.seen(result["masks"], PLACES, (35, 60))
    for index, (pixels, place) in enumerate(zip(result["pixels"], PLACES, strict=True)):
        np.copyto(canvas[place], request_folder.pixels(pixels), where=(seen[place] == index)[..., None])
    assert (result["blended"] is None) == (blend == "none")
    if result["blended"]:
        over = request_folder.pixels(result["blended"])
        x, y = result["blended"]["at"]
        part = canvas[y : y + over.shape[0], x : x + over.shape[1]]
        np.copyto(part, over, where=over[..., 3:] > 0)
    np.testing.assert_array_equal(canvas[..., :3], expected.image)


@pytest.mark.medium
def test_strokes_for_one_layer_leave_the_other_free(request_folder, pair):
    layers = [request_folder.raster("a", pair[0]), request_folder.raster("b", pair[1], (20, 5))]
    strokes = np.zeros((4, 6, 4), np.uint8)
    strokes[:] = (0, 0, 255, 255)
    request = {
        "layers": layers,
        "shown": [None, None],
        "hints": request_folder.raster("hints", strokes, (30, 12)),
        "colours": [[0, 0, 255], [255, 0, 0]],
        "seams": [],
    }
    result = result_of(request_folder.ask(operation="restitch", **request, options={"blend": "none"}))
    seen = request_folder.seen(result["masks"], PLACES, (35, 60))
    assert (seen[12:16, 30:36] == 0).all()
    assert (seen == 1).any()


@pytest.mark.parametrize("places", [[(0, 0), (30, 4), (70, 0)], [(0, 0), (20, 9), (5, 60)]])
def test_what_is_kept_of_layers_is_where_they_overlap(tmp_path, places):
    rng = np.random.default_rng(7)
    layers = [ts.Layer(rng.random((30, 44)), at=at, name=str(at)) for at in places]
    layers[1] = dataclasses.replace(layers[1], alpha=np.where(np.tri(30, 44, 40) > 0, 1.0, 0.0))
    canvas = ts.layers.common_canvas(layers)
    labels = np.full(canvas.shape, -1, np.int16)
    for index, (place, cover) in enumerate(zip(canvas.places, canvas.covers, strict=True)):
        here = labels[place.slices]
        here[cover & ((here < 0) | (np.arange(cover.shape[1]) > 7))] = index
    job = EngineJob(folder=tmp_path, request={}, progress=lambda _share: None)
    again = kept.unpacked(job, kept.kept_of(layers, labels, canvas).pack(job))
    assert again.labels.size < labels.size
    np.testing.assert_array_equal(again.on(canvas), labels)
    masks = [labels == index for index in range(3)]
    whole = ts.layers.restitch(layers, masks, {})
    traced = again.traced()
    assert traced.pairs == whole.pairs
    for own, wanted in zip(traced.outlines, whole.outlines, strict=True):
        shift = np.subtract(traced.origin, whole.origin)
        for line, other in zip(own.paths, wanted.paths, strict=True):
            np.testing.assert_array_equal(line.points + shift, other.points)


def test_progress_rises_to_the_end(request_folder):
    rng = np.random.default_rng(0)
    layers = [
        request_folder.raster(name, rng.random((200, 300, 4), np.float32), (x, 0))
        for name, x in (("a", 0), ("b", 100))
    ]
    _, events = request_folder.ask_process(operation="stitch", layers=layers)
    shares = [event["share"] for event in events if event["event"] == "progress"]
    assert shares == sorted(shares)
    assert shares[-1] == 1


def test_a_mask_hides_what_is_black(request_folder, pair):
    mask = np.full((30, 40), 255, np.uint8)
    mask[:, :10] = 0
    layers = [
        request_folder.raster("a", pair[0]),
        request_folder.raster("b", pair[1], (20, 0), mask=request_folder.raster("m", mask)),
    ]
    result = result_of(request_folder.ask(operation="stitch", layers=layers))
    shown = request_folder.pixels(result["masks"][1])
    assert not shown[:, :10].any()
    assert shown[:, 20:].all()


@pytest.mark.parametrize("content", ["", "{", "[1]", "7", "[" * 100_000])
def test_a_request_that_is_none_is_one_sentence(request_folder, content):
    (request_folder.folder / "request.json").write_text(content)
    with pytest.raises(ts.OptionError, match="holds no request; run “toposeam gimp install”"):
        serving._serve(request_folder.folder, serving.Channel(io.StringIO()))


def test_pixels_that_are_not_all_there_are_refused(request_folder, pair):
    raster = request_folder.raster("a", pair[0])
    (request_folder.folder / "a.raw").write_bytes(b"short")
    assert "send it again" in message_of(request_folder.ask(operation="stitch", layers=[raster, raster]))


@pytest.mark.parametrize(
    ("request_", "phrase"),
    [
        ({"operation": "stitch", "version": "0.0.1"}, "the plug-in is of TopoSeam 0.0.1"),
        ({"operation": "stitch", "protocol": 99}, "run “toposeam gimp install”"),
        ({"operation": "fly"}, "the engine has no operation 'fly'"),
        ({"operation": "stitch", "layers": []}, "give at least one"),
        (
            {
                "operation": "stitch",
                "layers": [{"file": "../a", "width": 1, "height": 1, "channels": 1, "dtype": "uint8"}],
            },
            "folder",
        ),
        (
            {
                "operation": "stitch",
                "layers": [{"file": "a", "width": 1, "height": 1, "channels": 1, "dtype": "object"}],
            },
            "type object",
        ),
    ],
)
def test_bad_requests_are_one_sentence(request_folder, request_, phrase):
    message = message_of(request_folder.ask(**request_))
    assert phrase in message
    assert "\n" not in message


def test_a_full_disk_is_one_sentence(request_folder, pair):
    layers = [request_folder.raster("a", pair[0]), request_folder.raster("b", pair[1], (20, 5))]
    (request_folder.folder / "result-0.raw").symlink_to("/dev/full")
    assert "the system refused (No space left on device); free some space" in message_of(
        request_folder.ask(operation="stitch", layers=layers)
    )


def test_aligned_layers_come_with_their_places(request_folder):
    rng = np.random.default_rng(4)
    whole = np.kron(rng.integers(0, 256, (30, 45, 3)), np.ones((4, 4, 1))).astype(np.uint8)
    parts = [
        np.dstack([part, np.full(part.shape[:2], 255, np.uint8)]) for part in (whole[:, :100], whole[:, 60:])
    ]
    layers = [request_folder.raster("a", parts[0]), request_folder.raster("b", parts[1], (63, -5))]
    result = result_of(request_folder.ask(operation="stitch", layers=layers, options={"places": "near"}))
    assert result["places"] == [[0, 0], [60, 0]]
    seen = request_folder.seen(result["masks"], [np.s_[:, :100], np.s_[:, 60:]], (120, 180))
    assert (np.bincount(seen.ravel() + 1, minlength=3)[1:] > 120 * 60).all()


def test_layers_that_lie_anywhere_are_put_where_they_belong(request_folder):
    rng = np.random.default_rng(4)
    whole = ndimage.gaussian_filter(rng.random((160, 260, 3)), (2, 2, 0))
    whole = (255 * (whole - whole.min()) / np.ptp(whole)).astype(np.uint8)
    whole = np.dstack([whole, np.full(whole.shape[:2], 255, np.uint8)])
    parts = whole[20:, 90:], whole[:, :160]
    layers = [request_folder.raster("a", parts[0], (30, 40)), request_folder.raster("b", parts[1], (500, 7))]
    result = result_of(request_folder.ask(operation="stitch", layers=layers, options={"places": "anywhere"}))
    assert result["places"] == [[90, 40], [0, 20]]  # the first would have lain at 30, the other then at -60
    assert "pixels" not in result  # nothing was turned
    layers[1] = request_folder.raster("c", np.full_like(parts[1], 90), (0, 0))
    refused = request_folder.ask(operation="stitch", layers=layers, options={"places": "anywhere"})
    assert "a and c cannot be placed: c shows too little detail; " in message_of(refused)


def test_strangers_are_those_that_no_group_takes():
    residuals = {
        pair: Residual(1.0, farthest, 20, 20)
        for pair, farthest in {(0, 1): 2.5, (0, 2): 2.0, (1, 2): 7.25}.items()
    }
    found = ts.layers.Placement(
        layers=(),
        model="plane",
        sizes=(),
        transforms=(),
        numbers=(0, 1, 3),
        left_out={2: "", 4: "", 5: ""},
        other_groups=((4, 5),),
        correlations={},
        residuals=residuals,
        misfit=1.0,
        doubts=("the canvas is large",),
    )
    about = PlacedLayers([], [0, 1, 3], found).about
    assert (about["strangers"], about["other_groups"]) == ([2], [[4, 5]])
    assert about["doubts"] == ["the canvas is large"]


def test_a_patch_is_divided_anew_by_its_path(request_folder, pair):
    below = np.dstack([np.zeros((60, 60, 3), np.uint8), np.full((60, 60), 255, np.uint8)])
    layers = [request_folder.raster("below", below), request_folder.raster("patch", pair[0], (10, 15))]
    square = {"points": [12, 17, 30, 17, 30, 40, 12, 40], "closed": True}
    seams = [{"pair": [0, 1], "name": "below : patch", "lines": [square], "touched": True}]
    result = result_of(
        request_folder.ask(operation="restitch", layers=layers, seams=seams, shown=[None, None])
    )
    expected = np.zeros((30, 40), bool)
    expected[2:25, 2:20] = True
    np.testing.assert_array_equal(request_folder.pixels(result["masks"][1]) > 0, expected)


def test_a_larger_core_shows_more_of_a_patch_as_texts_say(request_folder, pair):
    layers = [request_folder.raster("below", np.full((60, 60, 4), 255, np.uint8))]
    layers.append(request_folder.raster("patch", pair[0], (10, 15)))
    areas = []
    for core in (0.05, 0.5, 0.9):
        result = result_of(request_folder.ask(operation="patch", layers=layers, options={"core": core}))
        areas.append(np.count_nonzero(request_folder.pixels(result["masks"][1])))
    assert 0 < areas[0] < areas[1] < areas[2]
    (option,) = (each for each in stitch.params if each.name == "core")
    (field,) = (each for entry in SEAM_ENTRIES for each in entry.options if each.name == "core")
    for text in (option.help, field.help):
        assert re.search(r"outwards.* must |must .* outwards", text)


@pytest.mark.parametrize(
    ("changes", "phrase"),
    [
        ({"height": None}, "give file, height, width, channels and dtype"),
        ({"height": "tall"}, "give file, height, width, channels and dtype"),
        ({"height": -30}, "send it again"),
        ({"height": 10**12}, "send it again"),
        ({"dtype": "float64"}, "use one of uint8"),
        ({"file": "gone.raw"}, "is not in the request's folder"),
        ({"file": "../a.raw"}, "is not the name of a file"),
    ],
    ids=str,
)
def test_pixels_that_are_described_wrongly_are_refused(request_folder, pair, changes, phrase):
    layers = [request_folder.raster("a", pair[0]), request_folder.raster("b", pair[1], (20, 5))]
    layers[1] = {name: value for name, value in {**layers[1], **changes}.items() if value is not None}
    assert phrase in message_of(request_folder.ask(operation="stitch", layers=layers))


def test_steps_are_named(request_folder):
    rng = np.random.default_rng(4)
    whole = ndimage.gaussian_filter(rng.random((160, 260, 3)), (2, 2, 0))
    whole = (255 * (whole - whole.min()) / np.ptp(whole)).astype(np.uint8)
    layers = [request_folder.raster("a", whole[20:, 90:]), request_folder.raster("b", whole[:, :160])]
    _code, events = request_folder.ask(operation="stitch", layers=layers, options={"places": "anywhere"})
    steps = [event["name"] for event in events if event["event"] == "step"]
    assert steps == ["places", "seams", "blending"]


def _with_a_thing():
    """A patch of dim noise with a bright bar from its middle downwards, and the bar's mask."""
    rng = np.random.default_rng(2)
    pixels = np.dstack([rng.integers(90, 120, (120, 100, 3)), np.full((120, 100), 255)]).astype(np.uint8)
    thing = np.zeros((120, 100), bool)
    thing[30:108, 44:58] = True
    pixels[thing, :3] = [220, 40, 40]
    return pixels, thing


def test_what_stands_out_of_a_patch_stays_whole(request_folder):
    pixels, thing = _with_a_thing()
    y, x = np.mgrid[:120, :100]
    selected = np.where(((x - 50) / 48) ** 2 + ((y - 62) / 58) ** 2 <= 1, 255, 0).astype(np.uint8)
    below = np.dstack([np.random.default_rng(5).integers(90, 120, (200, 200, 3)), np.full((200, 200), 255)])
    below[105:140, 60:150, :3] = [220, 40, 40]  # over which the seam would rather run
    layers = [request_folder.raster("below", below.astype(np.uint8))]
    layers.append(request_folder.raster("patch", pixels, (50, 40)))
    request = {"operation": "patch", "layers": layers}
    request["selection"] = request_folder.raster("selection", selected, (50, 40))
    shown = {}
    for core in (0.0, 0.05):
        result = result_of(request_folder.ask(**request, options={"core": core}))
        shown[core] = request_folder.pixels(result["masks"][1]) > 0
    assert shown[0.0][thing].mean() > 0.99
    assert shown[0.05][thing].mean() < 0.9


def test_nothing_stands_out_of_noise():
    pixels, thing = _with_a_thing()
    whole = np.ones(thing.shape, bool)
    found = standing_out(pixels[..., :3], whole)
    assert found[thing].mean() > 0.95
    assert found[~thing].mean() < 0.1
    noise = np.random.default_rng(2).integers(90, 120, (120, 100, 3)).astype(np.uint8)
    assert standing_out(noise, whole) is None
    assert standing_out(noise, ~whole) is None
