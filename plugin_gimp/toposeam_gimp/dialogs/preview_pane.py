"""The preview in a dialog: a picture, or an animation, that follows the options."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gi.repository import GdkPixbuf, Gimp, Gio, GLib, Gtk

from toposeam_gimp.dialogs import scenes
from toposeam_gimp.dialogs.rehearsal import Preview, Rehearsal
from toposeam_gimp.dialogs.variants import Variants
from toposeam_gimp.dialogs.zoomed_view import ZoomedView
from toposeam_gimp.engine.call import GoneError, check_there
from toposeam_gimp.engine.folder import FolderError, RequestFolder
from toposeam_gimp.entries.entry import Procedure
from toposeam_gimp.image.layers import RefusedError
from toposeam_gimp.texts import _

_SIZE, _LARGE = (360, 300), (540, 520)
#: Radius of the brush for what may be copied, as a share of the picture's longer side; its colour.
_BRUSH, _BRUSH_COLOUR = 0.04, 0x3584E4FF
#: The engine's names of previews that show seams.
_WITH_SEAMS = ("stitch", "patch")
#: The engine's names of previews that can show the state before.
_WITH_BEFORE = ("panorama", "stitch", "patch", "tile", "hole")
#: Pause after the last change of an option before a preview is asked for, ms, as people type and drag.
_REST_MS = 150
#: Largest enlargement of small pictures, and of animations, which have fewer pixels.
_MOST_ENLARGED, _MOST_ENLARGED_FRAMES = 2.0, 3.0
#: Interval at which the folder with the pixels is marked as in use, s.
_ALIVE_S = 120
_MOST_SEED = 2_147_483_647


class PreviewPane:
    """A pane with the preview, and a check box that switches it off."""

    def __init__(
        self,
        config: Gimp.ProcedureConfig,
        entry: Procedure,
        image: Gimp.Image | None,
        drawables: Sequence[Gimp.Drawable],
    ) -> None:
        self._config, self._entry, self._image, self._drawables = config, entry, image, drawables
        self._variants = Variants(self._take) if entry.preview == "hole" else None
        self._picture = Gtk.Image(halign=Gtk.Align.CENTER, valign=Gtk.Align.CENTER)
        self._text = Gtk.Label(wrap=True, max_width_chars=34, justify=Gtk.Justification.CENTER)
        self._switch = Gtk.CheckButton.new_with_mnemonic(_("Pre_view"))
        self._switch.set_active(True)
        self._switch.connect("toggled", lambda _box: self.changed())
        self._busy = Gtk.Label()
        self._seam = Gtk.CheckButton.new_with_label(_("Seam line"))
        self._seam.set_active(True)
        self._seam.connect("toggled", lambda _box: self.changed())
        self._before = Gtk.CheckButton.new_with_label(_("Before"))
        self._before.connect("toggled", lambda _box: self.changed())
        self._copied = Gtk.CheckButton.new_with_label(_("Copied from"))
        self._copied.set_tooltip_text(
            _("Shows what is copied into the hole: all that is not dark. Paint on it to copy only from there")
        )
        self._copied.connect("toggled", lambda _box: self.changed())
        self._everywhere = Gtk.Button.new_with_label(_("Everywhere again"))
        self._everywhere.connect("clicked", lambda _button: config.set_property("only", ""))
        self._discs: list[str] = []
        self._view = ZoomedView(
            self._picture, _LARGE if entry.preview == "hole" else _SIZE, self._refresh, self._paint
        )
        self._stack = Gtk.Stack()
        for name, widget in (("picture", self._view.widget), ("text", self._text)):
            self._stack.add_named(widget, name)
        frame = Gtk.Frame()
        frame.add(self._stack)
        below = Gtk.Box(spacing=12)
        below.pack_start(self._switch, False, False, 0)
        if scenes.OF[str(entry.preview)] in _WITH_SEAMS:
            below.pack_start(self._seam, False, False, 0)
        if entry.preview in _WITH_BEFORE:
            below.pack_start(self._before, False, False, 0)
        if self._variants is not None:
            for widget in (self._copied, self._everywhere, self._variants.widget):
                below.pack_start(widget, False, False, 0)
        below.pack_start(self._busy, False, False, 0)
        self.widget = Gtk.Box(orientation=Gtk.Orientation.VERTICAL, spacing=6)
        self.widget.pack_start(frame, True, True, 0)
        self.widget.pack_start(below, False, False, 0)
        of = scenes.OF[str(entry.preview)]
        self._rehearsal = Rehearsal(lambda found: GLib.idle_add(self._show, found), of)
        self._folder: RequestFolder | None = None
        self._scene: tuple[Any, dict[str, Any]] | None = None
        self._timer = self._clock = self._sign = 0
        self._asked: tuple[dict[str, Any], dict[str, Any], Path] | None = None
        self._raw: list[GdkPixbuf.Pixbuf] = []
        self._frames: list[GdkPixbuf.Pixbuf] = []
        self._open = self._taking = False

    def start(self) -> None:
        """Start the previews, as the dialog appears."""
        self._open = True
        self._rehearsal.warm_up()
        self._sign = GLib.timeout_add_seconds(_ALIVE_S, self._stay)
        self.changed()

    def close(self) -> None:
        """Stop the previews, as the dialog closes."""
        self._open = False
        self._stop()
        if self._clock:
            GLib.source_remove(self._clock)
        if self._sign:
            GLib.source_remove(self._sign)
        self._rehearsal.close()
        if self._folder is not None:
            self._folder.__exit__(None, None, None)

    def changed(self) -> None:
        """Mark the preview as out of date."""
        if not self._open or self._taking:
            return
        self._rehearsal.cancel()
        self._busy.set_text("")
        self._stop()
        if self._variants is not None:
            self._everywhere.set_visible(bool(self._config.get_property("only")))
        if self._switch.get_active():
            self._busy.set_text(_("drawing …"))
            self._timer = GLib.timeout_add(_REST_MS, self._ask)

    def _ask(self) -> bool:
        self._timer = 0
        options = {option.name: self._config.get_property(option.name) for option in self._entry.options}
        name = str(self._entry.preview)
        wanted = scenes.key(name, options)
        try:
            check_there(self._image, self._drawables)
            folder = self._folder = self._folder or RequestFolder()
            if self._scene is None or self._scene[0] != wanted:
                made = scenes.scene(name, folder, self._image, self._drawables, options)
                self._scene = (wanted, made)
        except (RefusedError, GoneError, FolderError) as error:
            self._show(str(error))
            return False
        sent = {
            option.name.replace("-", "_"): options[option.name]
            for option in self._entry.options
            if option.engine
        }
        boxes = {"seam_line": self._seam, "before": self._before, "copied": self._copied}
        shown = {name: box.get_active() for name, box in boxes.items()}
        if self._variants is not None:
            sent["seed"] = self._variants.begin(options["seed"], _MOST_SEED)
        self._ask_for({**self._scene[1], **shown}, sent, folder.path)
        return False

    @property
    def _chooses(self) -> bool:
        """Whether the preview shows variants of the result, of which one can be chosen."""
        return not (self._before.get_active() or self._copied.get_active())

    def _take(self, seed: int) -> None:
        """Choose a variant."""
        self._taking = True
        self._config.set_property("seed", seed)
        self._taking = False
        self._refresh()

    def _paint(self, across: float, down: float, ends: bool) -> bool:
        """Paint what may be copied at shares of the picture's width and height, if it shows that; return
        whether it does.
        """
        if self._variants is None or not self._copied.get_active() or not self._raw or self._scene is None:
            return False
        picture, raster, scale = self._raw[0], self._scene[1]["layer"], self._scene[1]["scale"]
        width, height = picture.get_width(), picture.get_height()
        x, y, radius = round(across * width), round(down * height), round(_BRUSH * max(width, height)) + 1
        left, top = max(x - radius, 0), max(y - radius, 0)
        right, bottom = min(x + radius, width), min(y + radius, height)
        if right > left and bottom > top:
            picture.new_subpixbuf(left, top, right - left, bottom - top).fill(_BRUSH_COLOUR)
            place = (raster["at"][0] + across * raster["width"], raster["at"][1] + down * raster["height"])
            size = _BRUSH * max(raster["width"], raster["height"])
            self._discs.append(",".join(f"{value / scale:.0f}" for value in (*place, size)))
            self._refresh()
        if ends:
            known = self._config.get_property("only")
            self._config.set_property("only", ";".join([*([known] if known else []), *self._discs]))
            self._discs = []
        return True

    def _stop(self) -> None:
        """Cancel the timer of the next preview."""
        if self._timer:
            GLib.source_remove(self._timer)
            self._timer = 0

    def _stay(self) -> bool:
        """Mark the folder as in use, so that it is not removed as the remains of a crash."""
        if self._folder is not None:
            self._folder.touch()
        return True

    def _show(self, found: Preview | str) -> bool:
        if not self._open:
            return False
        self._busy.set_text("")
        if self._clock:
            GLib.source_remove(self._clock)
            self._clock = 0
        if isinstance(found, str):
            self._text.set_text(found)
            self._stack.set_visible_child_name("text")
            return False
        self._raw = _pixbufs(found)
        if found.rough and self._asked is not None:
            scene, options, pixels = self._asked
            self._ask_for({**scene, "exact": True}, options, pixels)
        elif self._variants is not None and self._chooses:
            self._next_variant(self._variants)
        if self._variants is not None and self._view.zoom == 1.0:
            self._view.zoom = max(1.0, 1 / self._fitting(self._raw[0]))
            GLib.timeout_add(_REST_MS, self._view.centre)
        self._refresh()
        if len(self._frames) > 1 and self._scene is not None:
            self._clock = GLib.timeout_add(max(int(self._scene[1]["delay"]), 20), self._next)
        self._stack.set_visible_child_name("picture")
        return False

    def _next_variant(self, variants: Variants) -> None:
        """Add the picture to the variants, and ask for the next one."""
        seed = variants.add(self._raw[0])
        if seed is not None and self._asked is not None:
            scene, options, pixels = self._asked
            self._ask_for(scene, {**options, "seed": seed}, pixels)

    def _ask_for(self, scene: dict[str, Any], options: dict[str, Any], pixels: Path) -> None:
        """Ask the engine for a preview."""
        self._asked = scene, options, pixels
        self._busy.set_text(_("drawing …"))
        self._rehearsal.show(scene, options, pixels)

    def _refresh(self) -> None:
        """Scale and draw the pictures for the present room and zoom."""
        if not self._raw:
            return
        chosen = None
        if self._variants is not None and self._chooses:
            chosen = self._variants.picture(self._config.get_property("seed"))
        self._frames = list(map(self._scaled, self._raw if chosen is None else [chosen]))
        self._draw(self._frames[0])

    def _next(self) -> bool:
        """Advance by one frame."""
        self._frames = [*self._frames[1:], self._frames[0]]
        self._draw(self._frames[0])
        return True

    def _fitting(self, pixbuf: GdkPixbuf.Pixbuf) -> float:
        """Return the scale at which a picture fits the room."""
        dots, (across, down) = self._picture.get_scale_factor(), self._view.room
        most = _MOST_ENLARGED_FRAMES if len(self._raw) > 1 else _MOST_ENLARGED
        width, height = pixbuf.get_width(), pixbuf.get_height()
        return float(min(across * dots / width, down * dots / height, most * dots))

    def _scaled(self, pixbuf: GdkPixbuf.Pixbuf) -> GdkPixbuf.Pixbuf:
        """Scale the picture to the room and zoom, with checks where it is transparent."""
        dots, scale = self._picture.get_scale_factor(), self._fitting(pixbuf) * self._view.zoom
        size = (max(round(side * scale), 1) for side in (pixbuf.get_width(), pixbuf.get_height()))
        return pixbuf.composite_color_simple(
            *size, GdkPixbuf.InterpType.BILINEAR, 255, 8 * dots, 0x999999, 0x666666
        )

    def _draw(self, pixbuf: GdkPixbuf.Pixbuf) -> None:
        """Show a picture."""
        dots = self._picture.get_scale_factor()
        if dots == 1:
            self._picture.set_from_pixbuf(pixbuf)
            return
        # A pixbuf would be shown at the scale of an ordinary screen, and blurred.
        _done, content = _squared(pixbuf).save_to_bufferv("png", [], [])
        self._picture.set_from_gicon(Gio.BytesIcon.new(GLib.Bytes.new(content)), Gtk.IconSize.DIALOG)
        self._picture.set_pixel_size(max(pixbuf.get_width(), pixbuf.get_height()) // dots)


def _squared(pixbuf: GdkPixbuf.Pixbuf) -> GdkPixbuf.Pixbuf:
    """Centre a picture in a transparent square, as icons are laid out as squares."""
    width, height = pixbuf.get_width(), pixbuf.get_height()
    side = max(width, height)
    square = GdkPixbuf.Pixbuf.new(GdkPixbuf.Colorspace.RGB, True, 8, side, side)
    square.fill(0)
    pixbuf.copy_area(0, 0, width, height, square, (side - width) // 2, (side - height) // 2)
    return square


def _pixbufs(picture: Preview) -> list[GdkPixbuf.Pixbuf]:
    """Convert a preview of RGBA, or gray and opacity, to a pixbuf for each frame."""
    content = picture.content
    if picture.channels == 2:
        gray, opacity = content[::2], content[1::2]
        wide = bytearray(4 * len(gray))
        wide[0::4] = wide[1::4] = wide[2::4] = gray
        wide[3::4] = opacity
        content = bytes(wide)
    width, height = picture.width, picture.height // picture.frames
    size = 4 * width * height
    return [
        GdkPixbuf.Pixbuf.new_from_bytes(
            GLib.Bytes.new(content[start : start + size]),
            GdkPixbuf.Colorspace.RGB,
            True,
            8,
            width,
            height,
            4 * width,
        )
        for start in range(0, size * picture.frames, size)
    ]
