"""The widgets of the dialogs, which are opened in the Python of a GIMP with a window."""

from pathlib import Path

import pytest
from running import CHECKOUT, Gimp, Screen, find_gimp, needs_gimp

from toposeam_gimp.entries.table import PROCEDURES

needs_gimp()

SHOWN = [name for name, entry in PROCEDURES.items() if entry.options]
FILL, MOTIF, STITCH = (f"plug-in-toposeam-{name}" for name in ("fill", "motif", "stitch"))
#: What every test's code begins with: `dialog`, its `config`, and the means to wait and to look.
OPEN = """
import os, sys

if plug_ins not in sys.path:
    sys.path.insert(0, plug_ins)
import gi

for name in ("Gtk", "GimpUi"):
    gi.require_version(name, "3.0")
from gi.repository import GLib, Gtk
from toposeam_gimp.dialogs import dialog as module
from toposeam_gimp.entries.table import PROCEDURES

entry = PROCEDURES[procedure]
config = Gimp.get_pdb().lookup_procedure(procedure).create_config()
loop = GLib.MainLoop()


def wait(milliseconds=100):
    GLib.timeout_add(milliseconds, loop.quit)
    loop.run()


def wait_until(found, seconds=60):
    for _ in range(20 * seconds):
        wait(50)
        if found():
            return True
    return False


def inside(widget):
    yield widget
    children = []
    if isinstance(widget, Gtk.Container):
        widget.forall(children.append)
    for child in children:
        yield from inside(child)


def opened():
    found = Gimp.get_pdb().lookup_procedure(procedure)
    made = module.Dialog(found, config, entry, image_of(number), [item(layer) for layer in layers])
    made._dialog.show()
    for widget in list(inside(made._dialog)):
        if isinstance(widget, Gtk.Expander):
            widget.set_expanded(True)
    wait(300)
    return made
"""


@pytest.fixture(scope="module", params=["en", pytest.param("ko", marks=pytest.mark.slow)])
def language(request):
    return request.param


@pytest.fixture(scope="module")
def windowed(language, tmp_path_factory):
    screen = Screen()
    told = {"DISPLAY": screen.display, "LANGUAGE": language}
    running = Gimp(
        tmp_path_factory.mktemp("fields"), told, [find_gimp("gimp"), "--no-splash", "--new-instance"]
    )
    yield running
    running.close()
    screen.close()


@pytest.fixture
def ask(windowed, samples):
    """`ask(procedure, code)`: what the code, after `OPEN`, calls `answer`; a layer is selected."""
    files = [str(samples / f"grass_{name}.png") for name in "ab"]
    loaded = windowed.load(files=files, offsets=[[0, 0], [120, 0]])
    code = "image_of(number).select_rectangle(Gimp.ChannelOps.REPLACE, 140, 60, 40, 40)"
    windowed.python(code=code, number=loaded["image"])

    def answer(procedure, code):
        several = PROCEDURES[procedure].needs == "several"
        told = {"procedure": procedure, "number": loaded["image"], "plug_ins": str(CHECKOUT / "plugin_gimp")}
        layers = loaded["layers"][:: -1 if several else 2]
        return windowed.python(code=OPEN + code, layers=layers, **told)

    yield answer
    windowed.delete(image=loaded["image"])


@pytest.mark.parametrize("name", SHOWN)
def test_nothing_is_clipped(ask, name):
    code = """
dialog, answer = opened(), []
for widget in inside(dialog._dialog):
    if widget.get_mapped() and isinstance(widget, Gtk.Label | Gtk.Entry | Gtk.Button | Gtk.ComboBox):
        room = widget.get_allocation()
        width = room.width + widget.get_margin_start() + widget.get_margin_end()
        height = room.height + widget.get_margin_top() + widget.get_margin_bottom()
        tall = widget.get_preferred_height_for_width(width)[0]  # of texts that wrap
        narrow = width < widget.get_preferred_width()[0] or height < tall
        text = widget.get_label() if isinstance(widget, Gtk.Label | Gtk.Button) else widget.get_name()
        if isinstance(widget, Gtk.Label):
            narrow |= width < widget.get_preferred_width()[1] and not widget.get_line_wrap()
            narrow |= widget.get_layout().is_ellipsized()
        answer.append([text, bool(narrow)])
dialog._dialog.destroy()
"""
    fields = ask(name, code)
    assert len(fields) > 5
    assert [text for text, narrow in fields if narrow] == []


@pytest.mark.parametrize("name", SHOWN)
def test_fields_that_do_not_apply_are_insensitive(ask, name):
    code = """
dialog, answer = opened(), []
for option in entry.options:
    if option.applies is not None:
        other, values = option.applies
        choices = [nick for nick, _label in {one.name: one for one in entry.options}[other].choices]
        for value in choices or [True, False]:
            config.set_property(other, value)
            wait(10)
            answer.append([option.name, value, dialog._rows[option.name].is_sensitive(), value in values])
        config.set_property(other, values[0])
dialog._dialog.destroy()
"""
    for field, value, sensitive, wanted in ask(name, code):
        assert sensitive == wanted, (field, value)


@pytest.mark.parametrize(
    "name", [name for name in SHOWN if any(one.automatic for one in PROCEDURES[name].options)]
)
def test_what_is_automatic_is_a_box_and_no_number(ask, name):
    code = """
dialog, answer = opened(), []
for option in entry.options:
    if option.automatic:
        row = list(inside(dialog._rows[option.name]))
        (box,) = (widget for widget in row if isinstance(widget, Gtk.CheckButton))
        (field,) = (widget for widget in row if isinstance(widget, Gtk.SpinButton))
        if option.applies is not None:
            config.set_property(option.applies[0], option.applies[1][0])
        for ticked in (True, False, True):
            box.set_active(ticked)
            wait(10)
            told = config.get_property(option.name)
            answer.append([option.name, ticked, field.is_sensitive(), field.get_text(), told, option.typical])
dialog._dialog.destroy()
"""
    for field, ticked, sensitive, text, told, typical in ask(name, code):
        assert sensitive != ticked, field
        if ticked:
            assert (text, told) == ("", 0), field
        else:
            assert float(text) == pytest.approx(told), field
            assert told == pytest.approx(typical), field


def test_graph_cut_is_offered_only_where_it_is_installed(ask):
    code = """
answer = []
for absent in ([], ["graph-cut"]):
    module.missing_methods = lambda: absent
    box = (dialog := opened())._rows["method"].get_widget()
    for row in box.get_model():
        box.get_area().apply_attributes(box.get_model(), row.iter, False, False)
        sensitive = all(cell.get_sensitive() for cell in box.get_cells())
        answer.append([absent, row[0], sensitive])
    dialog._dialog.destroy()
"""
    for absent, nick, sensitive in ask(STITCH, code):
        assert sensitive == (nick not in absent)


def test_the_dice_draws_another_seed(ask):
    code = """
dialog, answer = opened(), []
(dice,) = (widget for widget in inside(dialog._rows["seed"]) if type(widget) is Gtk.Button)
for _ in range(3):
    answer.append(config.get_property("seed"))
    dice.clicked()
    wait(10)
dialog._dialog.destroy()
"""
    assert len(set(ask(MOTIF, code))) == 3


@pytest.mark.parametrize("name", SHOWN)
def test_help_opens_the_entrys_part_of_our_own_page(ask, name):
    code = """
from gi.repository import Gio
launched = []
launcher = type("AppInfo", (), {"launch_default_for_uri": lambda *told: launched.append(told[0])})
module.Gio = type("Gio", (), {"AppInfo": launcher})
dialog = opened()
dialog._help()
module.Gio = Gio
dialog._dialog.destroy()
answer = launched
"""
    (page,) = ask(name, code)
    file, _, section = page.removeprefix("file://").partition("#")
    assert section == name.rpartition("-")[2]
    assert f'id="{section}"' in Path(file).read_text(encoding="utf-8")


def test_the_preview_follows_options_and_can_be_switched_off(ask):
    code = """
Gimp.Selection.none(image_of(number))
dialog = opened()
pane, drawn = dialog._pane, []
show = pane._show
pane._show = lambda found: (drawn.append(found if isinstance(found, str) else found.content), show(found))[1]
pane.start()
came = wait_until(lambda: drawn)
first = len(drawn)
config.set_property("blend", "feather")
for width in (2.0, 4.0, 8.0, 30.0):  # people type and drag; only where they stop is drawn
    config.set_property("blend-width", width)
followed = wait_until(lambda: len(drawn) > first)
wait(1500)
again = len(drawn)
pane._switch.set_active(False)
config.set_property("blend", "multiband")
wait(3000)
off, text = len(drawn), pane._busy.get_text()
pane._switch.set_active(True)
on = wait_until(lambda: len(drawn) > off)
different = len({hash(one) for one in drawn})
sentences = [one for one in drawn if isinstance(one, str)]
pane.close()
dialog._dialog.destroy()
answer = [came, first, followed, again, off, text, on, different, sentences]
"""
    came, first, followed, again, off, text, on, different, sentences = ask(STITCH, code)
    assert (came, followed, on) == (True, True, True)
    assert (first, again, off, text) == (1, 2, 2, "")
    assert different == 3
    assert sentences == []


REFUSED = {
    "fill": ("Gimp.Selection.none(image_of(number))", "select what is to be replaced"),
    "tile": ("image_of(number).select_ellipse(Gimp.ChannelOps.REPLACE, 140, 60, 40, 40)", "not a rectangle"),
    "repeat": ("", "make one with Generate Motif"),
    "loop": ("", "is not of the image's size"),
    "stitch": ("[item(one).set_offsets(0, 0) for one in layers]", "Select → None"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_ok_is_insensitive_beside_the_reason(ask, language, name):
    prepare, reason = REFUSED[name]
    code = f"""
{prepare}
dialog = opened()
ok = dialog._dialog.get_widget_for_response(Gtk.ResponseType.OK)
answer = [dialog._reason.get_text(), ok.is_sensitive(), dialog._reason.get_visible()]
Gimp.Selection.all(image_of(number)) if procedure.endswith("fill") else None
dialog._check()
answer.append(ok.is_sensitive())
dialog._dialog.destroy()
"""
    said, sensitive, visible, later = ask(f"plug-in-toposeam-{name}", code)
    assert said if language != "en" else reason in said
    assert not sensitive
    assert visible
    assert later == (name == "fill")  # as soon as something is selected


def test_layers_on_each_other_are_aligned_automatically(ask):
    code = """
Gimp.Selection.none(image_of(number))
answer = [opened() and config.get_property("places")]
[item(one).set_offsets(0, 0) for one in layers]
opened()
answer.append(config.get_property("places"))
"""
    assert ask(STITCH, code) == ["given", "anywhere"]


def test_a_preview_is_zoomed_and_grows_with_the_window(ask):
    code = """
from gi.repository import Gdk
Gimp.Selection.none(image_of(number))
dialog = opened()
dialog._pane.start()
picture = dialog._pane._picture
wait_until(lambda: dialog._pane._raw)
fitted = picture.get_pixbuf().get_width()
dialog._dialog.resize(1100, 800)
wait(500)
grown = picture.get_pixbuf().get_width()
event = Gdk.Event.new(Gdk.EventType.SCROLL)
event.scroll.direction = Gdk.ScrollDirection.UP
dialog._pane._view._scrolled(picture, event)
answer = [fitted, grown, picture.get_pixbuf().get_width()]
dialog._pane.close()
dialog._dialog.destroy()
"""
    fitted, grown, zoomed = ask(STITCH, code)
    assert fitted < grown < zoomed


def test_a_preview_of_a_hole_shows_its_surroundings(ask):
    code = """
from toposeam_gimp.dialogs import scenes
least, scenes._LEAST_SHOWN = scenes._LEAST_SHOWN, 0  # px, more than this layer has
dialog = opened()
dialog._pane.start()
answer = wait_until(lambda: dialog._pane._raw) and [dialog._pane._raw[0].get_width(), layers]
answer[1] = item(layers[0]).get_width()
scenes._LEAST_SHOWN = least
dialog._pane.close()
dialog._dialog.destroy()
"""
    shown, whole = ask(FILL, code)
    assert shown == whole - (140 - 24) < whole  # from 24 px before a selection of 40 px to the layer's end
