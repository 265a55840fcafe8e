"""What the engine cannot do with somebody's layers, and how GIMP says it: never in the words of the library
or of the command line.
"""

import ast
import gettext
import itertools
import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import toposeam
import toposeam_engine
import toposeam_gimp
from toposeam.checks import check_choice, check_number, check_whole
from toposeam.errors import Term, TopoSeamError
from toposeam.layers.registration import align
from toposeam_engine.job import EngineJob
from toposeam_engine.serving import OPERATIONS, described
from toposeam_gimp import sentences

KOREAN = gettext.translation("toposeam_gimp", Path(toposeam_gimp.__file__).parent / "locale", ["ko"])
#: What who sits at GIMP has never written: options, arrays, masks, patches that are layers.
FOREIGN = re.compile(
    r"--|\w=|\bmasks?\b|\balpha\b|\barray|\bdtype|exemplar|\bsource\b|\bimage (?:is|has)\b|\bpass\b|TOPOSEAM"
    r"|\bpatches (?:do not|on opposite)|divides the patches|pip |paint "
)


class Engine:
    """Operations in this process, on layers of our own."""

    def __init__(self, folder):
        self.folder, self.count = folder, 0
        self.rng = np.random.default_rng(0)

    def raster(self, pixels, at=(0, 0), name="sky"):
        self.count += 1
        file = self.folder / f"{self.count}.raw"
        np.ascontiguousarray(pixels).tofile(file)
        channels = 1 if pixels.ndim == 2 else pixels.shape[2]
        height, width = pixels.shape[:2]
        size = {"width": width, "height": height, "channels": channels, "dtype": str(pixels.dtype)}
        return {"file": file.name, "name": name, "at": list(at), **size}

    def layer(self, kind, at=(0, 0), name="sky"):
        height, width = {"dot": (1, 1), "thin": (3, 40)}.get(kind, (50, 60))
        pixels = self.rng.integers(0, 256, (height, width, 4)).astype(np.uint8)
        pixels[..., 3] = 255
        if kind == "plain":
            pixels[..., :3] = 7
        elif kind == "clear":
            pixels[..., 3] = 0
        elif kind == "holed":
            pixels[..., 3] = self.rng.integers(0, 2, (height, width)) * 255
        elif kind == "framed":
            pixels[..., 3] = np.pad(np.full((48, 58), 255), 1)
        elif kind == "no numbers":
            pixels = (pixels / 255).astype(np.float32)
            pixels[3, 3, 0] = np.nan
        return self.raster(pixels, at, name)

    def selection(self, kind, shape=(50, 60)):
        selected = np.zeros(shape, np.uint8)
        if kind == "all":
            selected[:] = 255
        elif kind == "middle":
            selected[20:30, 20:30] = 255
        return self.raster(selected)

    def says(self, operation, request):
        """What GIMP shows of an operation that does not work; None where it does."""
        job = EngineJob(folder=self.folder, request=request, progress=lambda share: None)
        work = getattr(import_module(f"toposeam_engine.{OPERATIONS[operation]}"), operation)
        try:
            work(job)
        except TopoSeamError as error:
            return sentences.in_gimps_words(described(error))
        return None


@pytest.fixture
def engine(tmp_path):
    return Engine(tmp_path)


def assert_gimps(shown):
    assert shown is not None
    assert not FOREIGN.search(shown), shown


@pytest.mark.parametrize(
    ("kinds", "places", "options"),
    [
        (["any", "any"], [(0, 0), (300, 0)], {}),
        (["any", "any"], [(0, 0), (0, 0)], {}),
        (["any", "any", "any"], [(0, 0), (20, 0), (300, 0)], {}),
        (["any", "clear"], [(0, 0), (20, 0)], {}),
        (["no numbers", "no numbers"], [(0, 0), (20, 0)], {}),
        (["any", "any"], [(0, 0), (20, 12)], {"method": "dp"}),
        (["any"], [(0, 0)], {}),
        (["dot", "dot"], [(0, 0), (0, 0)], {}),
    ],
)
def test_layers_that_cannot_be_stitched(engine, kinds, places, options):
    layers = [
        engine.layer(kind, at, name)
        for kind, at, name in zip(kinds, places, ("sea", "sky", "sand"), strict=False)
    ]
    assert_gimps(engine.says("stitch", {"layers": layers, "options": options}))


@pytest.mark.parametrize("kind", ["any", "clear", "dot"])
@pytest.mark.parametrize("at", [(0, 0), (300, 0), (-59, 0)])
def test_patches_that_do_not_lie_well(engine, kind, at):
    layers = [engine.layer("any", name="sea"), engine.layer(kind, at)]
    for method in ("heat", "dp"):
        shown = engine.says("patch", {"layers": layers, "options": {"method": method}})
        assert shown is None or not FOREIGN.search(shown), shown


@pytest.mark.parametrize("operation", ["synthesize", "make_tileable", "fill"])
@pytest.mark.parametrize("kind", ["any", "dot", "thin", "plain", "clear", "holed", "framed", "no numbers"])
@pytest.mark.parametrize("selected", [None, "nothing", "middle", "all"])
def test_textures_of_all_sorts_of_layers(engine, operation, kind, selected):
    layer = engine.layer(kind)
    selection = selected and engine.selection(selected, (layer["height"], layer["width"]))
    size = {"synthesize": {"width": 40, "height": 40}, "fill": {"from": "around"}}.get(operation, {})
    tried = {
        "synthesize": [{}, {"patch": 2}, {"patch": 400}, {"patch": 20, "overlap": 30}, {"patch": 40}],
        "make_tileable": [{}, {"band": 1}, {"band": 400}],
        "fill": [{}, {"patch": 2}, {"patch": 400}, {"patch": 20, "overlap": 30}, {"band": 500}],
    }[operation]
    for options in tried:
        shown = engine.says(operation, {"layer": layer, "selection": selection, "options": size | options})
        assert shown is None or not FOREIGN.search(shown), shown
    if (operation, kind, selected) == ("fill", "plain", "middle"):  # with the colour round it
        assert shown is None
    elif kind in ("dot", "plain", "clear", "no numbers"):
        assert shown


def test_unexpected_errors_name_no_command_line_remedy():
    shown = sentences.in_gimps_words(described(IndexError("index 3 is out of bounds")))
    assert "IndexError: index 3 is out of bounds" in shown
    assert_gimps(shown)


@pytest.mark.parametrize(
    ("check", "arguments", "shown"),
    [
        (check_number, (7, 0, 1), "“mass” is 7; choose a number from 0 to 1."),
        (check_number, (0, 0, 1, "above"), "“mass” is 0; choose a number above 0, 1 at most."),
        (check_number, (-1, 0), "“mass” is -1; choose a number, 0 at least."),
        (check_number, ("{x}", 0, np.inf, "above"), "“mass” is {x}; choose a number above 0."),
        (check_number, (9, -np.inf, 8), "“mass” is 9; choose a number, 8 at most."),
        (check_number, ("x",), "mass is 'x'; it must be a number"),
        (check_whole, (2.5, 1, 6), "“mass” is 2.5; choose a whole number from 1 to 6."),
        (check_whole, (0, 1), "“mass” is 0; choose a whole number, 1 at least."),
        (check_choice, ("z", ("x", "y")), "“mass” is z; choose one of x, y."),
    ],
)
def test_settings_out_of_range_are_named_with_their_range(check, arguments, shown):
    *given, last = arguments
    with pytest.raises(TopoSeamError) as refused:
        check("mass", *given, above=True) if last == "above" else check("mass", *arguments)
    assert sentences.in_gimps_words(described(refused.value)) == shown


def test_the_engine_says_ranges_of_what_is_no_setting():
    with pytest.raises(TopoSeamError) as refused:
        check_number(Term("", "{sky}"), 7, 0, 1)
    assert (
        sentences.in_gimps_words(described(refused.value))
        == "{sky} is 7; it must be a number between 0 and 1"
    )


def test_layers_that_repeat_themselves_are_named_in_gimps_words():
    found = {(i, j): (np.array([5.0 * (i == 0), 0]), 0.9, 10.0) for i, j in ((0, 1), (0, 2), (1, 2))}
    with pytest.raises(TopoSeamError, match="leave out aligning") as refused:
        align._vote_on_shifts(["sky", "sea", "sand"], found | {(1, 2): (np.array([24.0, 0]), 0.9, 10.0)})
    shown = sentences.in_gimps_words(described(refused.value))
    assert "where these layers belong: sky and sea, sky and sand, sea and sand." in shown
    assert_gimps(shown)


def test_every_sentence_is_korean_too():
    for text in itertools.chain(*sentences._SENTENCES.values()):
        assert KOREAN.gettext(text) != text, text


def test_every_kind_is_one_that_the_engine_knows():
    raised = set()
    for file in (
        *Path(toposeam.__file__).parent.rglob("*.py"),
        *Path(toposeam_engine.__file__).parent.glob("*.py"),
    ):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                raised.add(node.value)
    assert {kind.removeprefix("whole number ") for kind in sentences._SENTENCES} <= raised


def test_names_of_layers_come_through_unharmed(engine):
    names = ("a (at 1,2): the patches do not overlap", "{patches}", "sky fits none of the other pictures")
    layers = [engine.layer("any", (300 * k, 0), name) for k, name in enumerate(names)]
    shown = engine.says("stitch", {"layers": layers, "options": {}})
    assert shown == f"“{names[1]}” overlaps no other layer; move it onto one."
