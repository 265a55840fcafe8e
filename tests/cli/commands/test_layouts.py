"""Layouts in TOML and JSON."""

import json

import numpy as np
import pytest
from three_pictures import FILES, PLACES, assert_joined

from toposeam_cli.media.layouts.layout import read_layout
from toposeam_cli.media.pictures.picture import Picture, write_picture

LAYOUT = """
[[layer]]
file = "a.png"
at = [0, 0]

[[layer]]
file = "b.png"
at = [40, 4]
name = "the second"
mask = "m.png"

[[layer]]
file = "a.png"
name = "hidden"
at = [999, 0]
visible = false

[[layer]]
file = "c.png"
at = [20, 30]
"""


def test_a_layout_in_toml_and_in_json(three, toposeam):
    (three / "sub").mkdir()
    for name in FILES:
        (three / name).rename(three / "sub" / name)
    write_picture(three / "sub" / "m.png", Picture(pixels=np.full((50, 60), 255, np.uint8)))
    (three / "sub" / "l.toml").write_text(LAYOUT)
    layers = [{"file": f"{name}.png", "at": list(at)} for name, at in PLACES.items()]
    (three / "sub" / "l.json").write_text(json.dumps({"layer": layers}))
    for kind in ("toml", "json"):
        assert (
            toposeam("stitch", f"sub/l.{kind}", "-o", f"{kind}.png", "--labels", "labels.png", "--force").code
            == 0
        )
        assert_joined(f"{kind}.png")
    assert (three / "toml.png").read_bytes() == (three / "json.png").read_bytes()


def test_a_layout_of_one_camera_and_a_scan_is_saved(three, toposeam):
    view = "[view]\nprojection = 'cylinder'\nradius = 80.0"
    camera = "[[layer]]\nfile = 'a.png'\nsize = [60, 50]\nfocal = 80.0"
    scan = "[[layer]]\nfile = 'b.png'\nat = [20, 4]"
    (three / "l.toml").write_text("\n".join([view, camera, scan]))
    assert toposeam("stitch", "l.toml", "-o", "out.png", "--save-layout", "saved.toml").code == 0
    saved, given = (
        [layer.transform for layer in read_layout(three / name).layers] for name in ("saved.toml", "l.toml")
    )
    assert (saved[0].radius, saved[0].projection) == (given[0].radius, given[0].projection)
    np.testing.assert_array_equal(saved[1].matrix, given[1].matrix)


LAYOUTS = {
    "syntax": ("[[layer]\n", "is not TOML: "),
    "empty": ("", "it has none"),
    "surplus": ("colour = 3\n[[layer]]\nfile='a.png'\nat=[0,0]", "it has colour"),
    "one": ("[[layer]]\nfile='a.png'\nat=[0,0]", "needs at least two"),
    "no place": ("[[layer]]\nfile='a.png'", "layer 1 has no at"),
    "no file": ("[[layer]]\nat=[0,0]", "layer 1 has no file"),
    "half a place": ("[[layer]]\nfile='a.png'\nat=[0]", "two whole numbers"),
    "fractions": ("[[layer]]\nfile='a.png'\nat=[0.5,1]", "two whole numbers"),
    "far": ("[[layer]]\nfile='a.png'\nat=[0,99999999999]", "which lies too far away"),
    "misspelt": ("[[layer]]\nfile='a.png'\nposition=[0,0]", "'position', which is none of file, name"),
    "visible": ("[[layer]]\nfile='a.png'\nat=[0,0]\nvisible='no'", "write true or false"),
    "name": ("[[layer]]\nfile='a.png'\nat=[0,0]\nname=3", "write a text"),
    "mesh": ("[[layer]]\nfile='a.png'\nat=[0,0]\nmesh={size=[60,50]}", "write its size, cell, x and y"),
    "rows": (
        "[[layer]]\nfile='a.png'\nat=[0,0]\nmesh={size=[60,50],cell=32.0,x=[[0]],y=[[0]]}",
        "x is not 5 rows of 5 numbers",
    ),
    "twice": (
        "[[layer]]\nfile='a.png'\nat=[0,0]\n[[layer]]\nfile='a.png'\nat=[9,0]",
        "give each a name of its own",
    ),
    "missing": ("[[layer]]\nfile='a.png'\nat=[0,0]\n[[layer]]\nfile='z.png'\nat=[9,0]", "there is no file"),
}


def test_a_layout_of_bent_pictures_is_read_back(three, toposeam):
    rng = np.random.default_rng(0)
    rows = [[round(float(value), 3) for value in row] for row in rng.uniform(-2, 2, (5, 5))]
    mesh = f"mesh = {{ size = [60, 50], cell = 32.0, x = {rows}, y = {rows} }}"
    bent = "matrix = [[1.0, 0.01, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]"
    camera = "size = [60, 50]\nfocal = 80.0"
    view = "[view]\nprojection = 'flat'\nradius = 80.0"
    layers = [
        f"[[layer]]\nfile = '{name}'\n{own}\n{mesh}" for name, own in (("a.png", bent), ("b.png", camera))
    ]
    (three / "l.toml").write_text("\n".join([view, *layers]))
    assert toposeam("stitch", "l.toml", "-o", "out.png", "--save-layout", "saved.toml").code == 0
    saved, given = (
        [layer.transform for layer in read_layout(three / name).layers] for name in ("saved.toml", "l.toml")
    )
    spots = np.array([[0.0, 0.0], [30.0, 40.0], [59.0, 49.0]])
    for one, other in zip(saved, given, strict=True):
        assert one.to_canvas(spots) == pytest.approx(other.to_canvas(spots), abs=1e-6)
        assert np.abs(one.to_canvas(spots) - one.base.to_canvas(spots)).max() > 0.3
    gone = toposeam("stitch", "l.toml", "-o", "out.png", "--save-layout", "saved.pto", "--force")
    assert gone.code == 1
    assert "save a layout (.toml) instead" in gone.err


@pytest.mark.parametrize(("text", "phrase"), LAYOUTS.values(), ids=LAYOUTS)
def test_a_layout_that_makes_no_sense(three, toposeam, text, phrase):
    (three / "l.toml").write_text(text)
    toposeam("stitch", "l.toml", "-o", "out.png").fails(phrase)
    assert not (three / "out.png").exists()


def test_a_layout_leaves_no_room_for_places(three, toposeam):
    (three / "l.toml").write_text(LAYOUT)
    toposeam("stitch", "l.toml", "--at", "0,0", "-o", "out.png").fails("says itself where its pictures lie")
    (three / "l.json").write_text('{"layer": [')
    toposeam("stitch", "l.json", "-o", "out.png").fails("is not JSON")
    (three / "l.toml").write_bytes(b"\n\xff")
    toposeam("stitch", "l.toml", "-o", "out.png").fails("is not UTF-8 (at line 2)")
    toposeam("stitch", "none.toml", "-o", "out.png").fails("there is no file")
