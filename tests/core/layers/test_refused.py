"""What cannot be stitched."""

import dataclasses

import numpy as np
import pytest
from crops import crop

import toposeam as ts


def clear(layer):
    """The layer without a pixel that shows."""
    return dataclasses.replace(layer, alpha=np.zeros(layer.image.shape[:2], layer.image.dtype))


ERRORS = {
    "no layer": (lambda: ts.stitch([]), ts.OptionError, "at least two"),
    "a number": (lambda: ts.stitch(3), ts.OptionError, "say where it lies"),
    "numbers": (lambda: ts.stitch([3, 4]), ts.OptionError, "say where it lies"),
    "no sequence": (lambda: ts.find_places(2.5), ts.OptionError, "pass"),
    "one layer": (lambda: ts.stitch([crop(0, 0)]), ts.OptionError, "at least two"),
    "apart": (lambda: ts.stitch([crop(0, 0), crop(100, 0)]), ts.OverlapError, "move one of them"),
    "side by side": (lambda: ts.stitch([crop(0, 0), crop(40, 0)]), ts.OverlapError, "move one of them"),
    "third apart": (
        lambda: ts.stitch([crop(0, 0), crop(25, 0), crop(0, 90, name="third")]),
        ts.OverlapError,
        r"third \(at 0,90\)",
    ),
    "transparent": (
        lambda: ts.stitch([crop(0, 0), clear(crop(25, 0, name="second"))]),
        ts.OverlapError,
        r"second \(at 25,0\): .* no pixel of it shows, as it is transparent or masked everywhere",
    ),
    "third transparent": (
        lambda: ts.stitch([clear(crop(0, 0, name="first")), crop(25, 0), crop(30, 0)]),
        ts.OverlapError,
        r"first \(at 0,0\): .* no pixel of it shows, as it is transparent or masked everywhere",
    ),
    "same place": (
        lambda: ts.stitch([crop(0, 0), crop(0, 0)]),
        ts.OverlapError,
        "nothing divides the patches: both cover the same ground, so that there is nothing to join",
    ),
    "dtypes": (
        lambda: ts.stitch([crop(0, 0), crop(9, 0, dtype=np.uint16)]),
        ts.ImageError,
        "uint16, uint8; convert them to one",
    ),
    "channels": (
        lambda: ts.stitch([crop(0, 0), ts.Layer(image=np.zeros((9, 9, 4), np.uint8))]),
        ts.ImageError,
        "3, 4 channels; convert them to the same number",
    ),
    "far": (
        lambda: ts.stitch([crop(0, 0), ts.Layer(image=crop(0, 0).image, at=(10**6, 10**6))]),
        ts.OptionError,
        "check where they lie",
    ),
    "limit": (
        lambda: ts.stitch([crop(0, 0), crop(20, 0)], max_megapixels=0.001),
        ts.OptionError,
        "more than 0.001 megapixels",
    ),
    "limit is a word": (
        lambda: ts.layers.common_canvas([crop(0, 0)], max_megapixels="x"),
        ts.OptionError,
        "max_megapixels is 'x'; it must be a positive number",
    ),
    "limit is nothing": (
        lambda: ts.layers.common_canvas([crop(0, 0)], max_megapixels=0),
        ts.OptionError,
        "max_megapixels is 0",
    ),
    "nan": (
        lambda: ts.stitch(
            [ts.Layer(image=np.full((9, 9), np.nan)), ts.Layer(image=np.zeros((9, 9)), at=(5, 0))]
        ),
        ts.ImageError,
        "NaN or infinite",
    ),
    "avoid": (
        lambda: ts.stitch([crop(0, 0), crop(20, 0)], avoid=np.ones((3, 3))),
        ts.ImageError,
        "one value per pixel",
    ),
    "method": (
        lambda: ts.stitch([crop(0, 0), crop(20, 0)], method="magic"),
        ts.OptionError,
        "choose one of auto",
    ),
    "option": (
        lambda: ts.stitch([crop(0, 0), crop(20, 0)], patience=3),
        ts.OptionError,
        "does not know patience",
    ),
    "path": (
        lambda: ts.stitch([crop(0, 0), crop(25, 0), crop(50, 0)], use_path=ts.vector.read_svg(SVG)),
        ts.OptionError,
        "say between which two it runs",
    ),
    "no path": (
        lambda: ts.stitch([crop(0, 0), crop(20, 0)], use_path="seam.svg"),
        ts.OptionError,
        "pass an SvgSeam, or one for each pair of layers",
    ),
    "path elsewhere": (
        lambda: ts.stitch([crop(0, 0), crop(20, 0)], use_path=ts.vector.read_svg(SVG)),
        ts.PathError,
        "9 × 9",
    ),
    "array beside a layer": (
        lambda: ts.stitch([crop(0, 0), np.zeros((9, 9))]),
        ts.OptionError,
        r"layer 1 is of type ndarray; say where it lies, as toposeam.Layer\(image, at=\(x, y\)\)",
    ),
    "a name": (
        lambda: ts.stitch(["a.jpg", "b.jpg"]),
        ts.OptionError,
        r"layer 0 is the name 'a.jpg'; pass the picture, as PIL.Image.open\('a.jpg'\)",
    ),
    "one name": (lambda: ts.stitch("a.jpg"), ts.OptionError, "layer 0 is the name 'a.jpg'"),
    "one picture": (lambda: ts.stitch([np.zeros((9, 9))]), ts.OptionError, "1 picture was given"),
    "a picture": (lambda: ts.stitch(np.zeros((9, 9))), ts.OptionError, "1 picture was given"),
    "none": (lambda: ts.stitch([]), ts.OptionError, "0 layers were given"),
    "mistyped": (
        lambda: ts.stitch([crop(0, 0), crop(20, 0)], blendwidth=3),
        ts.OptionError,
        "there is no option blendwidth; did you mean blend_width",
    ),
    "alone": (lambda: ts.stitch([crop(0, 0)]), ts.OptionError, "1 layer was given"),
    "not a list": (lambda: ts.layers.match_tones(crop(0, 0)), ts.OptionError, "1 layer was given"),
    "no image": (lambda: ts.Layer("a.png"), ts.ImageError, "type str"),
    "beyond": (lambda: ts.Layer(np.zeros((4, 5)), at=(2**31, 0)), ts.OptionError, "beyond"),
    "gradient and cost": (
        lambda: ts.stitch([crop(0, 0), crop(20, 0)], cost=ts.seam.MatchCost(), gradient=False),
        ts.OptionError,
        "leave gradient out",
    ),
    "paths in an array": (
        lambda: ts.stitch([crop(0, 0), crop(20, 0)], give=8, use_path=np.ones((8, 8))),
        ts.OptionError,
        "use_path says where they are",
    ),
    "two ways": (
        lambda: ts.stitch([crop(0, 0), crop(20, 0)], options=ts.seam.HeatOptions(), tolerance=0.1),
        ts.OptionError,
        "tolerance was given beside options",
    ),
    "other options": (
        lambda: ts.stitch([crop(0, 0), crop(20, 0)], options=ts.seam.ThesisOptions()),
        ts.OptionError,
        "takes HeatOptions",
    ),
    "rounds": (lambda: ts.stitch([crop(0, 0), crop(20, 0)], max_rounds=2.5), ts.OptionError, "whole number"),
    "empty": (lambda: ts.Layer(image=np.zeros((0, 5)), name="B"), ts.ImageError, r"B has shape \(0, 5\)"),
    "flat": (lambda: ts.Layer(image=np.zeros(5)), ts.ImageError, "pass a non-empty"),
    "alpha shape": (
        lambda: ts.Layer(image=np.zeros((4, 5)), alpha=np.zeros((5, 4))),
        ts.ImageError,
        "one value per pixel",
    ),
    "alpha dtype": (
        lambda: ts.Layer(image=np.zeros((4, 5)), alpha=np.zeros((4, 5), bool)),
        ts.ImageError,
        "alpha is bool",
    ),
    "half a pixel": (
        lambda: ts.Layer(image=np.zeros((4, 5)), at=(0.5, 1)),
        ts.OptionError,
        "two whole numbers",
    ),
    "three numbers": (
        lambda: ts.Layer(image=np.zeros((4, 5)), at=(0, 1, 2)),
        ts.OptionError,
        "two whole numbers",
    ),
}

SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><path d="M4 0 V9"/></svg>'


@pytest.mark.parametrize(("call", "error", "remedy"), ERRORS.values(), ids=ERRORS)
def test_what_cannot_be_stitched_says_what_to_do(call, error, remedy):
    with pytest.raises(error, match=remedy) as caught:
        call()
    assert isinstance(caught.value, ts.TopoSeamError)
    assert isinstance(caught.value, ValueError)
    assert "\n" not in str(caught.value)


# Found by hand
