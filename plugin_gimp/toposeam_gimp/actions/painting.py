"""Paint Seam Hints: a layer for strokes, and what its window does while people paint."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from gi.repository import Gimp

from toposeam_gimp.actions.patches import patch_selection
from toposeam_gimp.actions.restitching import joined_again, layers_of, names_of, restitch
from toposeam_gimp.actions.seams import stitch_layers
from toposeam_gimp.engine.call import Call, GoneError
from toposeam_gimp.engine.folder import FolderError
from toposeam_gimp.engine.process import EngineError, keep
from toposeam_gimp.entries.table import PROCEDURES
from toposeam_gimp.image import hints, pixels
from toposeam_gimp.image.layers import (
    RefusedError,
    chosen_layers,
    mark_place,
    one_undo_step,
    remember,
    stitched_group,
    sums_of,
    under_masks,
)
from toposeam_gimp.image.path_choice import UnclearError
from toposeam_gimp.texts import _

Told = Callable[[float], object]
#: Difference of two colours below which they count as one, of 1.
_ALIKE = 0.01


def paint_hints(call: Call) -> Gimp.Layer:
    """Show and select the layer of hints, on which people paint where each layer shall show, and how far each
    layer reaches; choose a colour, but for somebody who has just painted. Make the layer if there is none.
    """
    image = call.image
    selected = _joined(call, chosen_layers(image, under_masks(call.drawables)))
    group, memory = stitched_group(image, selected)
    layers = layers_of(image, memory)
    keep()
    below = memory["kind"] == "patch"
    if len(layers) + below > len(hints.COLOURS):
        raise RefusedError(
            _(
                "There are colours for {count} layers, and this group has more; paint on the layers' masks "
                "instead, and choose Re-stitch."
            ).format(count=len(hints.COLOURS))
        )
    strokes: Any = hints.hints_of(image, memory)
    is_new = strokes is None
    with one_undo_step(image):
        if is_new:
            boxes = [pixels.layer_box(layer) for layer in layers]
            strokes = hints.new_hints(image, group, pixels.around(boxes))
            kept = ("kind", "options", "names", "masks", "margin")
            about = {name: memory[name] for name in kept if name in memory}
            remember(None, group, layers, memory["seams"], None, about, memory, strokes)
        for index, layer in enumerate(layers, start=int(below)):
            layer.set_color_tag(hints.COLOURS[index][1])
        hints.show_reach(image, strokes, layers, int(below))
        strokes.set_visible(True)
        image.set_selected_layers([strokes])
    chosen = {layer.get_id() for layer in selected}
    if strokes.get_id() in chosen and not call.interactive:
        return strokes
    meant = [index for index, layer in enumerate(layers) if layer.get_id() in chosen] or [len(layers) - 1]
    Gimp.context_set_foreground(hints.colour(image, meant[-1] + below))
    if len(layers) + below == 2:
        Gimp.context_set_background(hints.colour(image, 1 - meant[-1] - below))
    if is_new and not call.interactive:
        call.tell(
            _(
                "Paint on “Seam hints” where “{name}” shall show: that is the foreground colour now. Each "
                "layer has the colour of its tag in the Layers dialog; of two, X swaps them. Then choose "
                "Re-stitch."
            ).format(name=names_of(memory, layers)[meant[-1]])
        )
    return strokes


def _joined(call: Call, selected: list[Gimp.Layer]) -> list[Gimp.Layer]:
    """Return the selected layers. Of several that are not stitched yet, or of one of which a part is
    selected, make the first result by the usual options, and return that.
    """
    try:
        stitched_group(call.image, selected)
    except RefusedError:
        if len(selected) > 1:
            name, work = "plug-in-toposeam-stitch", stitch_layers
        elif not Gimp.Selection.is_empty(call.image):
            name, work = "plug-in-toposeam-patch", patch_selection
        else:
            raise
        entry = PROCEDURES[name]
        usual = {option.name: option.default for option in entry.options}
        return [work(replace(call, entry=entry, options=usual))]
    return selected


class Painting:
    """What can be done with the strokes of a stitched group while somebody paints.

    Parameters
    ----------
    call : Call
        Of :func:`paint_hints`.
    strokes : Layer
        What it returned.
    """

    def __init__(self, call: Call, strokes: Gimp.Layer) -> None:
        self._call, self.strokes = call, strokes
        self._group, memory = stitched_group(call.image, [strokes])
        below = [_("What lies below")] if memory["kind"] == "patch" else []
        #: Names of the layers, the lowest first.
        self.names = [*below, *names_of(memory, layers_of(call.image, memory))]
        self._marked: list[list[int]] = []
        self._tiles = pixels.tiles_of(strokes)
        #: What each stroke covered, by the corner of the tile.
        self._before: list[dict[str, bytes]] = []

    @property
    def goes_on(self) -> bool:
        """True while the image and the strokes exist."""
        return bool(self._call.image.is_valid() and self.strokes.is_valid())

    def colour_of(self, index: int) -> tuple[int, int, int]:
        """Return the colour of a layer, 8 bits."""
        return hints.colours_in(self._call.image)[index]

    def is_chosen(self, index: int) -> bool:
        """Test whether the foreground colour is that of a layer."""
        chosen, own = Gimp.context_get_foreground(), hints.colour(self._call.image, index)
        return all(abs(a - b) < _ALIKE for a, b in zip(chosen.get_rgba(), own.get_rgba(), strict=True))

    def choose(self, index: int) -> None:
        """Paint with the colour of a layer, on the strokes."""
        Gimp.context_set_foreground(hints.colour(self._call.image, index))
        self._call.image.set_selected_layers([self.strokes])
        Gimp.displays_flush()

    def show(self, shown: bool) -> None:
        """Show the strokes, or make them transparent, so that they can still be painted on; no undo step."""
        self._call.image.undo_freeze()
        self.strokes.set_opacity(hints.OPACITY if shown else 0.0)
        self._call.image.undo_thaw()
        Gimp.displays_flush()

    def restitch(self, show_progress: Told, *, news_only: bool = False) -> str:
        """Join the layers again, perhaps only if the strokes have changed; return what is said about it."""
        return self._do(restitch, show_progress, {"painting": True, "news-only": news_only})

    def note_stroke(self) -> None:
        """Note what the last stroke has changed, for :meth:`undo_stroke`."""
        now = pixels.tiles_of(self.strokes)
        corners = {corner for corner in {**self._tiles, **now} if self._tiles.get(corner) != now.get(corner)}
        self._tiles, before = now, {corner: self._tiles.get(corner, b"") for corner in corners}
        if self._before and self._before[-1] == {corner: now.get(corner, b"") for corner in corners}:
            self._before.pop()  # Ctrl+Z took the last one back
        elif corners:
            self._before.append(before)

    def undo_stroke(self, show_progress: Told) -> str:
        """Take back the last stroke that was painted while the window was open, and join the layers again;
        return what is said about it.
        """
        self.note_stroke()
        if not self._before:
            return _("There is no stroke of this window left.")
        with one_undo_step(self._call.image):
            pixels.put_tiles(self.strokes, self._before.pop())
        self._tiles = pixels.tiles_of(self.strokes)
        return self.restitch(show_progress)

    def next_place(self, show_progress: Told) -> str:
        """Let guides cross at the next place where a seam may be noticed; return what is said about it."""
        return self._do(self._mark_next, show_progress, {})

    def finish(self) -> None:
        """Hide strokes and outlines."""
        with one_undo_step(self._call.image):
            hints.hide_reach(self._call.image, self.strokes)
            self.strokes.set_visible(False)
            self.strokes.set_opacity(hints.OPACITY)
            if self._group.is_valid():
                self._call.image.set_selected_layers([self._group])

    def _do(self, work: Callable[[Call], object], show_progress: Told, options: Mapping[str, Any]) -> str:
        chosen = self._call.image.get_selected_drawables()
        painted = [one for one in chosen if isinstance(one, Gimp.LayerMask)]
        call = replace(
            self._call,
            drawables=painted or [self.strokes],
            options=options,
            remarks=[],
            show_progress=show_progress,
            show_step=lambda _text: None,
        )
        try:
            work(call)
        except (RefusedError, UnclearError, GoneError, EngineError, FolderError) as error:
            return str(error)
        Gimp.displays_flush()
        return " ".join(call.remarks)

    def _mark_next(self, call: Call) -> None:
        places = _places(call, self.strokes)
        if not places:
            call.tell(_("No place is likely to be noticed."))
            return
        left = [place for place in places if place not in self._marked]
        if not left:  # begin anew
            self._marked.clear()
            left = places
        self._marked.append(left[0])
        mark_place(call.image, left[0])
        (x, y), count = left[0], len(left) - 1
        call.tell(_("Guides cross at {x},{y}; {count} more such places.").format(x=x, y=y, count=count))


def _places(call: Call, strokes: Gimp.Layer) -> list[list[int]]:
    """Return the places of the canvas where the seams, as they are shown, may be noticed."""
    group, memory = stitched_group(call.image, [strokes])
    layers = layers_of(call.image, memory)
    with joined_again(call, group, layers, memory, sums_of(layers)) as (folder, request):
        answer = call.ask(folder, {"operation": "restitch", "look": True, **request})
    places: list[list[int]] = answer["places"]
    return places
