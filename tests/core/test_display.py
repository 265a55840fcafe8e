"""What results say of themselves, and how they show in notebooks."""

import numpy as np
import PIL.Image
import pytest
import tifffile
from defusedxml import ElementTree
from skimage import data

import toposeam as ts

PICTURE = data.coffee()[:40, :70]
LAYERS = ts.Layer(PICTURE[:, :40]), ts.Layer(PICTURE[:, 30:], at=(30, 0))
SMALL = {"layers": 2, "iterations": 2, "repeat": "translate", "palette": "sumi"}
NAMESPACE = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def results():
    seam = ts.find_seam(PICTURE[:, 30:40], PICTURE[:, 31:41])
    recipe = ts.motif.random_recipe(16, seed=1, **SMALL)
    motif = ts.generate_motif(recipe)
    line = seam.paths[0]
    return {
        "seam": seam,
        "stitched": ts.stitch(LAYERS),
        "composition": ts.stitch(LAYERS),
        "aligned": ts.layers.align(LAYERS, radius=4),
        "synthesis": ts.synthesize(PICTURE, (50, 60), patch=16, seed=1),
        "palette": ts.motif.palette("indigo", 3),
        "recipe": recipe,
        "motif": motif,
        "arrangement": ts.motif.arrange([motif, motif], [[0, 1]]),
        "joined": ts.motif.join_motifs([recipe, ts.motif.random_recipe(16, seed=2, **SMALL)]),
        "path": ts.plan_path((12, 12), (2, 2), (9, 9)),
        "line": line,
        "closed line": ts.vector.Polyline([[0, 0], [30, 0], [0, 40]], closed=True),
        "curve": ts.vector.smooth_path(ts.vector.Polyline([[0, 0], [0, 90], [60, 90]])),
        "drawing": ts.vector.read_svg(seam.to_svg()),
    }


def test_what_they_say_is_a_short_line(results):
    for result in results.values():
        assert "\n" not in repr(result)
        assert len(repr(result)) <= 100
    assert repr(results["palette"]).startswith("Palette(#")
    assert repr(results["aligned"]) == "Aligned(2 layers, moved by up to 0 px)"
    assert repr(results["drawing"]) == "SvgSeam(1 line on 10 × 40 px)"
    assert repr(results["recipe"]) == "Recipe(2 inks on 16 × 16 elements, repeat='translate', seed=1)"


@pytest.mark.parametrize("name", ["seam", "stitched", "synthesis", "motif", "arrangement", "joined"])
def test_pictures_show_in_notebooks(results, name):
    assert results[name]._repr_png_().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["stitched", "synthesis", "motif", "arrangement"])
@pytest.mark.parametrize("suffix", [".png", ".webp", ".TIF", ".jpg"])
def test_pictures_are_saved(results, name, suffix, tmp_path):
    file = tmp_path / f"it{suffix}"
    results[name].save(file)
    shown = ts.to_pil(results[name])
    with PIL.Image.open(file) as read:
        assert read.size == shown.size
        off = np.abs(np.asarray(read.convert("RGB"), int) - np.asarray(shown.convert("RGB"), int))
    assert off.max() == 0 if suffix == ".png" else off.mean() < 4
    assert [one.name for one in tmp_path.iterdir()] == [file.name]


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_tiff_keeps_every_depth_and_opacity(dtype, tmp_path):
    picture = np.random.default_rng(0).random((20, 30, 3)).astype(np.float32)
    picture = picture if dtype == np.float32 else (picture * 65535).astype(dtype)
    stitched = ts.stitch([ts.Layer(picture[:, :20]), ts.Layer(picture[5:, 15:], at=(15, 5))])
    stitched.save(tmp_path / "it.tif")
    read = tifffile.imread(tmp_path / "it.tif")
    np.testing.assert_array_equal(read[..., :3], stitched.image)
    np.testing.assert_array_equal(read[..., 3], stitched.alpha)


def test_what_a_format_does_not_keep_is_refused(results, tmp_path):
    holed = ts.stitch([ts.Layer(PICTURE[:, :40]), ts.Layer(PICTURE[5:, 30:], at=(30, 5))])
    deep = ts.stitch([ts.Layer(np.zeros((9, 9), np.uint16)), ts.Layer(np.ones((9, 9), np.uint16), at=(4, 0))])
    for result, name, remedy in (
        (results["stitched"], "it.bmp", r"save as \.png"),
        (results["stitched"], "it", r"save as \.png"),
        (holed, "it.jpg", r"save it as \.png"),
        (deep, "it.png", r"save it as \.tif"),
    ):
        with pytest.raises(ts.OptionError, match=remedy):
            result.save(tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["path", "line", "closed line", "curve", "drawing"])
def test_vectors_show_in_notebooks(results, name):
    root = ElementTree.fromstring(results[name]._repr_svg_().encode())
    assert root.tag == f"{NAMESPACE}svg"
    assert len(list(root.iter(f"{NAMESPACE}path"))) == 1


def test_a_line_in_a_notebook_is_drawn_where_it_runs(results):
    root = ElementTree.fromstring(results["closed line"]._repr_svg_())
    assert root.find(f"{NAMESPACE}path").get("d") == "M 0,0 30,0 0,40 Z"
    left, top, width, height = map(float, root.get("viewBox").split())
    assert (left, top, left + width, top + height) == pytest.approx((-0.8, -0.8, 30.8, 40.8))
    point = ElementTree.fromstring(ts.vector.Polyline([[4, 5], [4.25, 5]])._repr_svg_()).get("viewBox")
    assert point == "3.98 4.98 0.29 0.04"  # what is smaller than a pixel has a pixel's margin
    d = ElementTree.fromstring(results["curve"]._repr_svg_()).find(f"{NAMESPACE}path").get("d")
    assert d.startswith("M 0,0 C ")
    assert d.endswith(" 60,90")


@pytest.mark.parametrize("name", ["seam", "stitched", "synthesis", "motif", "arrangement", "joined", "path"])
def test_drawings_are_written_whole(results, name, tmp_path):
    text = results[name].to_svg(tmp_path / "drawn.svg")
    assert (tmp_path / "drawn.svg").read_text(encoding="utf-8") == text
    with pytest.raises(OSError, match="no such"):
        results[name].to_svg(tmp_path / "no such" / "drawn.svg")
    assert [path.name for path in tmp_path.iterdir()] == ["drawn.svg"]


def test_the_row_of_joined_motifs_is_drawn_in_its_order(results):
    joined = results["joined"]
    row = ts.motif.arrange(joined.motifs, [range(len(joined.motifs))])
    assert joined.to_svg() == row.to_svg()
    assert row.densities.shape[2] == 16 * len(joined.motifs)
    np.testing.assert_array_equal(row.densities[:, :, :16], joined.motifs[0].densities)


def test_results_are_equal_by_identity_and_hashable(results):
    """Arrays have no truth: a result is equal to itself, and can be a key."""
    assert len({result: name for name, result in results.items()}) == len(results)
    for result in results.values():
        assert result == result


def test_a_folder_that_is_not_there_is_named(results, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"gone/it\.png'$"):
        results["stitched"].save(tmp_path / "gone" / "it.png")


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("seam", lambda one: one.labels),
        ("stitched", lambda one: one.image),
        ("synthesis", lambda one: one.image),
        ("motif", lambda one: one.image()),
        ("path", lambda one: one.density),
        ("joined", lambda one: np.concatenate([each.image() for each in one.motifs], axis=1)),
    ],
)
def test_numpy_takes_a_result_for_its_picture(results, name, what):
    result = results[name]
    np.testing.assert_array_equal(np.asarray(result), what(result))
    assert np.asarray(result).dtype == what(result).dtype
    assert np.asarray(result, float).dtype == float
    changed = np.array(result)
    changed[:] = 0
    np.testing.assert_array_equal(np.asarray(result), what(result))


def test_numpy_takes_joined_stacks_and_loops_for_their_voxels():
    stack = np.random.default_rng(1).random((8, 10, 12)).astype(np.float32)
    joined = ts.join_volumes(stack, stack, offset=(0, 0, 6))
    np.testing.assert_array_equal(np.asarray(joined), joined.volume)
    surface = ts.find_surface(stack, stack[::-1])
    assert np.asarray(surface).shape == stack.shape
    loop = ts.loop(np.random.default_rng(1).random((24, 8, 8)).astype(np.float32))
    np.testing.assert_array_equal(np.asarray(loop), loop.frames)
