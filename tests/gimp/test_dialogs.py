"""The real windows, on a display that nobody sees: dialogs, menu, last values, undo, cancel."""

import json
import shutil
import threading
import time

import numpy as np
import pytest
from inside import STITCH, succeeded
from pictures import write_png
from PIL import Image
from running import Gimp, Screen, find_gimp, needs_gimp

from toposeam_gimp.entries.table import PROCEDURES

needs_gimp()

MOTIF, FILL, LOOP, HINTS = (f"plug-in-toposeam-{name}" for name in ("motif", "fill", "loop", "hints"))
#: Where a stroke across the overlap begins, wherever GIMP's window shows the picture, and its length, px.
ACROSS = (225, 345), 230
#: An animation has a test of its own.
DIALOGS = [name for name, entry in PROCEDURES.items() if entry.options and not name.endswith("loop")]


@pytest.fixture(scope="module")
def screen():
    missing = [
        program for program in ("Xvfb", "xdotool", "openbox", "import") if shutil.which(program) is None
    ]
    if missing:
        pytest.fail(
            f"{', '.join(missing)} is missing; install it, or run `make test-gimp` where the system has no "
            "GIMP"
        )
    shown = Screen()
    yield shown
    shown.close()


@pytest.fixture(scope="module")
def windows(screen, tmp_path_factory):
    """Every GIMP with windows that these tests have started, the last one running or not."""
    started = []

    def start():
        started.append(
            Gimp(
                tmp_path_factory.mktemp("windowed"),
                {"DISPLAY": screen.display},
                [find_gimp("gimp"), "--no-splash", "--new-instance"],
            )
        )

    start()
    yield started, start
    for running in started:
        running.close()
    assert [line for running in started for line in running.complaints()] == []


@pytest.fixture
def windowed(windows):
    """A GIMP with windows: a new one where a test has ended the last."""
    started, start = windows
    if not started[-1].runs():
        start()
    return started[-1]


@pytest.fixture
def opened(windowed, samples):
    """Two layers, selected, in a window."""
    files = [str(samples / f"grass_{name}.png") for name in "ab"]
    loaded = windowed.load(files=files, offsets=[[0, 0], [120, 0]])
    code = """
image = image_of(number)
answer = Gimp.Display.new(image).get_id()
image.set_selected_layers([item(layer) for layer in layers])
image.clean_all()
"""
    display = windowed.python(code=code, number=loaded["image"], layers=loaded["layers"])
    yield loaded
    windowed.python(code="Gimp.Display.get_by_id(number).delete()", number=display)


class Asked(threading.Thread):
    """A procedure called interactively, which waits for its dialog."""

    def __init__(self, gimp, procedure, loaded, layers):
        super().__init__(daemon=True)
        self.call = {
            "procedure": procedure,
            "image": loaded["image"],
            "layers": layers,
            "mode": "INTERACTIVE",
        }
        self.gimp, self.result = gimp, None
        self.start()

    def run(self):
        self.result = self.gimp.run(**self.call)

    def answer(self):
        self.join()
        assert self.result is not None, "the dialog does not end"
        return self.result


def title(name):
    return PROCEDURES[name].title


def select(gimp, loaded):
    gimp.python(
        code="image_of(number).select_rectangle(Gimp.ChannelOps.REPLACE, 140, 60, 40, 40)",
        number=loaded["image"],
    )


def test_the_menu_entry_opens_a_dialog_and_one_undo_reverts_all(screen, windowed, opened):
    before = windowed.tree(image=opened["image"])
    picture = screen.window("Background|grass|GIMP")
    # GIMP's search runs what is in the menus.
    screen.press(picture, "slash")
    search = screen.window("Search Actions")
    size = "getwindowgeometry", "--shell", search
    empty = screen.do(*size)
    screen.press(search)
    screen.do("type", "--delay", "40", "Stitch Layers")
    deadline = time.monotonic() + 60
    while screen.do(*size) == empty and time.monotonic() < deadline:
        time.sleep(0.1)
    time.sleep(1.5)  # the list follows the words
    screen.do("key", "Return")
    dialog = screen.window(title(STITCH))
    time.sleep(1)
    screen.press(dialog, "Return")
    after = wait_for_change(windowed, opened, before)
    assert [len(layer.get("children", [])) for layer in after["layers"]] == [2, 0, 0]
    assert len(after["paths"]) == 1
    picture = screen.window("Background|grass|GIMP")
    screen.press(picture, "ctrl+z")
    undone = wait_for_change(windowed, opened, after)
    assert undone == before
    assert windowed.python(code="answer = image_of(number).is_dirty()", number=opened["image"]) is False
    assert screen.do("search", "--onlyvisible", "--name", "GIMP Message") == ""
    screen.press(picture, "ctrl+y")
    assert wait_for_change(windowed, opened, undone) == after


@pytest.mark.parametrize("name", DIALOGS)
def test_every_dialog_opens_and_works_with_its_defaults(screen, windowed, opened, name):
    layers = opened["layers"] if PROCEDURES[name].needs == "several" else opened["layers"][1:]
    if name.endswith(("patch", "fill")):
        select(windowed, opened)
    if name.endswith("repeat"):
        motif = windowed.run(
            procedure="plug-in-toposeam-motif", image=None, layers=[], options={"size": 32, "iterations": 2}
        )
        opened = {
            "image": windowed.python(code="answer = item(number).get_image().get_id()", number=motif["layer"])
        }
        layers = [motif["layer"]]
    asked = Asked(windowed, name, opened, layers)
    window = screen.window(title(name))
    time.sleep(1)
    screen.press(window, "Return")
    succeeded(asked.answer())


def test_the_dialog_of_an_animation_plays_its_loop(screen, windowed, tmp_path):
    rng = np.random.default_rng(0)
    files = []
    for index in range(8):
        files.append(str(tmp_path / f"{index}.png"))
        write_png(files[-1], rng.integers(0, 256, (40, 60, 3)).astype(np.uint8))
    loaded = windowed.load(files=files)
    show = "answer = Gimp.Display.new(image_of(number)).get_id()"
    display = windowed.python(code=show, number=loaded["image"])
    asked = Asked(windowed, LOOP, loaded, loaded["layers"][:1])
    window = screen.window(title(LOOP))
    seen, deadline = set(), time.monotonic() + 60
    while len(seen) < 6 and time.monotonic() < deadline:  # empty, “drawing …”, and frames
        screen.shoot(tmp_path / "seen.png", window)
        seen.add(np.asarray(Image.open(tmp_path / "seen.png").convert("RGB")).tobytes())
    screen.press(window, "alt+o")
    answer = succeeded(asked.answer())
    assert len(seen) >= 6
    assert answer["layer"] is not None
    windowed.python(code="Gimp.Display.get_by_id(number).delete()", number=display)


def test_ok_waits_until_something_is_selected(screen, windowed, opened):
    windowed.python(code="Gimp.Selection.none(image_of(number))", number=opened["image"])
    asked = Asked(windowed, FILL, opened, opened["layers"][1:])
    window = screen.window(title(FILL))
    time.sleep(1)
    screen.press(window, "alt+o")  # does nothing: nothing is selected
    time.sleep(1)
    assert asked.result is None
    assert screen.window(title(FILL)) == window
    screen.press(window, "Escape")
    assert asked.answer()["status"] == "cancel"


def test_cancelling_a_dialog_changes_nothing(screen, windowed, opened):
    before = windowed.tree(image=opened["image"])
    asked = Asked(windowed, STITCH, opened, opened["layers"])
    screen.press(screen.window(title(STITCH)), "Escape")
    assert asked.answer()["status"] == "cancel"
    assert windowed.tree(image=opened["image"]) == before


def wait_for_change(gimp, loaded, before, seconds=120):
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        now = gimp.tree(image=loaded["image"])
        time.sleep(1)
        if now != before and gimp.tree(image=loaded["image"]) == now:
            return now
    raise AssertionError("nothing has changed")


def test_the_last_values_are_remembered(screen, windowed, opened):
    asked = Asked(windowed, STITCH, opened, opened["layers"])
    window = screen.window(title(STITCH))
    time.sleep(1)
    screen.press(window, "alt+e", "Return")  # “Show the seam” off, then OK
    succeeded(asked.answer())
    assert not windowed.tree(image=opened["image"])["paths"][0]["visible"]
    for layer in opened["layers"]:
        windowed.python(code="item(number).set_visible(True)", number=layer)
    succeeded(windowed.stitch(opened, mode="WITH_LAST_VALS"))
    visible = [path["visible"] for path in windowed.tree(image=opened["image"])["paths"]]
    assert visible == [False, False]


@pytest.mark.parametrize("undone", [False, True])
def test_a_stroke_moves_the_seam_while_its_window_is_open(screen, windowed, opened, undone):
    group = succeeded(windowed.stitch(opened))["layer"]
    before = windowed.tree(image=opened["image"])
    asked = Asked(windowed, HINTS, opened, [group])
    window = screen.window("^Seam$")
    screen.do("windowmove", window, 900, 600)
    picture = screen.window("Background|grass|GIMP")
    screen.press(picture, "p")
    (x, y), length = ACROSS
    screen.do("mousemove", x, y, "mousedown", 1)
    for step in range(0, length, 10):
        screen.do("mousemove", x + step, y)
    screen.do("mouseup", 1)
    time.sleep(8)
    assert asked.result is None
    if undone:
        screen.press(window, "alt+u")
        time.sleep(6)
    screen.press(window, "Escape")
    succeeded(asked.answer())
    after = windowed.tree(image=opened["image"])
    strokes, found = after["layers"][:2]
    assert (strokes["name"], strokes["visible"], strokes["opacity"]) == ("Seam hints", False, 60.0)
    assert [layer["name"] for layer in after["layers"][2:]] == [
        layer["name"] for layer in before["layers"][1:]
    ]
    masks = [[child["mask"] for child in one["children"]] for one in (before["layers"][0], found)]
    assert masks[0] != masks[1] or undone
    code = "buffer = item(n).get_buffer(); answer = any(buffer.get(buffer.get_extent(), 1.0, 'A u8', 0))"
    assert windowed.python(code=code, n=strokes["id"]) is not undone


@pytest.mark.slow
def test_a_rule_is_chosen_by_its_picture(screen, windowed, opened):
    asked = Asked(windowed, MOTIF, opened, opened["layers"][1:])
    window = screen.window(title(MOTIF))
    time.sleep(2)
    screen.press(window, "alt+b", "Down", "Return")
    time.sleep(2)
    screen.press(window, "alt+o")
    group = succeeded(asked.answer())["layer"]
    code = "answer = bytes(item(number).get_parasite('toposeam-motif').get_data()).decode()"
    assert json.loads(windowed.python(code=code, number=group))["repeat"] != "translate"


def test_the_variant_of_a_fill_that_is_shown_is_taken(screen, windowed, samples):
    loaded = windowed.load(files=[str(samples / "still_life_left.png")])
    code = """
image_of(number).select_rectangle(Gimp.ChannelOps.REPLACE, 180, 120, 60, 90)
Gimp.Display.new(image_of(number))
"""
    windowed.python(code=code, number=loaded["image"])
    wanted = {}
    for seed in (0, 2):
        made = succeeded(windowed.run(procedure=FILL, **loaded, options={"seed": seed}))["layer"]
        wanted[seed] = windowed.pixels(made, "R'G'B'A u8")[0].tobytes()
        windowed.python(code="item(n).get_image().remove_layer(item(n))", n=made)
    assert wanted[0] != wanted[2]
    asked = Asked(windowed, FILL, loaded, loaded["layers"])
    window = screen.window(title(FILL))
    time.sleep(6)
    screen.press(window, "alt+3")
    time.sleep(1)
    screen.press(window, "alt+o")
    made = windowed.pixels(succeeded(asked.answer())["layer"], "R'G'B'A u8")[0]
    assert made.tobytes() == wanted[2]


@pytest.mark.slow
def test_a_hole_is_filled_from_the_first_layer_in_the_list(screen, windowed, opened):
    select(windowed, opened)
    code = """
Gimp.context_set_foreground(Gegl.Color.new("red"))
Gimp.Selection.none(image_of(number))
item(layer).fill(Gimp.FillType.FOREGROUND)
"""
    windowed.python(code=code, number=opened["image"], layer=opened["layers"][0])
    select(windowed, opened)
    asked = Asked(windowed, FILL, opened, opened["layers"][1:])
    window = screen.window(title(FILL))
    time.sleep(2)
    screen.press(window, "alt+f", "Down", "Down", "alt+o")
    made, (x, y) = windowed.pixels(succeeded(asked.answer())["layer"], "R'G'B'A u8")
    hole = made[60 - y : 100 - y, 140 - x : 180 - x]
    assert (hole == hole[0, 0]).all()  # the layer of one colour, not the grass
