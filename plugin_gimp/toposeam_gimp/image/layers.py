"""Layers and paths of an image: which are meant, and how results are put beside them in one undo step."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from gi.repository import Gimp

from toposeam_gimp.image import curves
from toposeam_gimp.image import path_choice as choosing
from toposeam_gimp.texts import _

#: Name of the parasite on a stitched group: its layers, and its seams exactly.
PARASITE = "toposeam-seam"
#: On the paths that a stitched group has made: their own tattoo, so that a copy is known to be one.
PATH_PARASITE = "toposeam-path"
_PARASITE_VERSION = 2
#: Saved with the file, and part of the undo step; without the latter GIMP complains when it is undone.
_KEPT = Gimp.PARASITE_PERSISTENT | Gimp.PARASITE_UNDOABLE


class RefusedError(Exception):
    """The request makes no sense for this image; the text says what to do."""


def chosen_layers(image: Gimp.Image, drawables: Sequence[Gimp.Drawable]) -> list[Gimp.Layer]:
    """Return the selected drawables, which must be layers of an image that is not indexed."""
    if image.get_base_type() == Gimp.ImageBaseType.INDEXED:
        raise RefusedError(
            _(
                "This image has a palette (Indexed mode), in which new colours cannot be mixed. Choose Image "
                "→ Mode → RGB first."
            )
        )
    if not all(isinstance(drawable, Gimp.Layer) for drawable in drawables):
        raise RefusedError(
            _("A mask or channel is selected; click on the layers themselves in the Layers dialog.")
        )
    return list(drawables)


def lowest_first(image: Gimp.Image, layers: Sequence[Gimp.Layer]) -> list[Gimp.Layer]:
    """Sort layers in the order of the stack, from below; a group together with what is in it is refused."""
    chosen = {layer.get_id() for layer in layers}
    ordered: list[Gimp.Layer] = []

    def visit(level: Sequence[Gimp.Layer], inside: bool) -> None:
        for layer in level:
            picked = layer.get_id() in chosen
            if picked and inside:
                raise RefusedError(
                    _("“{name}” is inside a group that is selected too; select either of them.").format(
                        name=layer.get_name()
                    )
                )
            if picked:
                ordered.append(layer)
            if layer.is_group():
                visit(layer.get_children(), inside or picked)

    visit(image.get_layers(), False)
    return ordered[::-1]


def check_selection(image: Gimp.Image, options: Mapping[str, Any]) -> None:
    """Refuse a selection, which says where seams may run, while it is not known where the layers will be."""
    if options["places"] == "anywhere" and not Gimp.Selection.is_empty(image):
        raise RefusedError(
            _(
                "A selection says where the seams may run, but where the layers belong is not known yet. "
                "Choose Select → None, or leave the layers where they lie."
            )
        )


@contextmanager
def one_undo_step(image: Gimp.Image) -> Iterator[list[Callable[[], Any]]]:
    """Group the block into one undo step; if it fails, call the list's functions, last first."""
    undone: list[Callable[[], Any]] = []
    image.undo_group_start()
    try:
        yield undone
    except BaseException:
        for step in reversed(undone):
            step()
        raise
    finally:
        image.undo_group_end()


def draw_seam(
    image: Gimp.Image, seam: dict[str, Any], *, visible: bool
) -> tuple[list[Gimp.Path], dict[str, Any]]:
    """GIMP paths for a seam, a smooth one to bend above the exact one, and what has to be remembered of
    them.
    """
    exact = _new_path(image, _("Seam {name}, exact").format(name=seam["name"]))
    smooth = _new_path(image, _("Seam {name}, to bend").format(name=seam["name"]))
    lines = []
    for line in seam["lines"]:
        closed = line["closed"]
        stroke = curves.stroke_of(line["curves"], closed)
        smooth.stroke_new_from_points(Gimp.PathStrokeType.BEZIER, stroke, closed)
        exact.stroke_new_from_points(
            Gimp.PathStrokeType.BEZIER, curves.straight_stroke(line["points"]), closed
        )
        lines.append({"stroke": stroke, "closed": closed, "pieces": line["pieces"], "points": line["points"]})
    smooth.set_visible(visible)
    memory = {"name": seam["name"], "pair": seam["pair"], "lines": lines}
    return [smooth, exact], {**memory, "smooth": smooth.get_tattoo(), "exact": exact.get_tattoo()}


def _new_path(image: Gimp.Image, name: str) -> Gimp.Path:
    path = Gimp.Path.new(image, name)
    image.insert_path(path, None, 0)
    mark = list(str(path.get_tattoo()).encode())
    path.attach_parasite(Gimp.Parasite.new(PATH_PARASITE, _KEPT, mark))
    return path


def lines_to_apply(
    image: Gimp.Image, seam: dict[str, Any], others: Sequence[Gimp.Path]
) -> tuple[list[dict[str, Any]], bool, str | None]:
    """Return the lines that the paths of an image say for a seam, whether they differ from what was found,
    and what people should know about it.

    Parameters
    ----------
    seam : dict
        As :func:`draw_seam` remembers it.
    others : sequence of Path
        Paths that are not the group's own and could be meant too.
    """
    selected = {path.get_id() for path in image.get_selected_paths()}
    known = {
        "smooth": seam["lines"],
        "exact": [_straight(line["points"], line["closed"]) for line in seam["lines"]],
    }
    candidates = []
    for kind, lines in known.items():
        path = image.get_path_by_tattoo(seam[kind])
        if path is not None:
            found, touched = curves.lines_of(strokes_of(path), lines)
            candidates.append(_candidate(path, selected, own=True, touched=touched, lines=found))
    made = max(seam["smooth"], seam["exact"])
    for path in others:
        found, _touched = curves.lines_of(strokes_of(path), ())
        newer = path.get_tattoo() > made  # GIMP counts them up
        candidates.append(_candidate(path, selected, own=False, touched=True, newer=newer, lines=found))
    if not candidates:
        raise RefusedError(
            _("The path of the seam {name} is gone; undo its deletion, or stitch the layers again.").format(
                name=seam["name"]
            )
        )
    meant, remark = choosing.chosen(candidates, seam["name"])
    applied = [line for candidate in meant for line in candidate.lines]
    if not applied:
        text = _("The path “{name}” is empty; draw the seam from border to border of the overlap.")
        raise RefusedError(text.format(name=meant[0].name))
    return applied, any(candidate.touched for candidate in meant), remark


def other_paths(image: Gimp.Image, seams: Sequence[dict[str, Any]]) -> list[Gimp.Path]:
    """Return the paths of an image that belong to no stitched group."""
    own = {seam[kind] for seam in seams for kind in ("smooth", "exact")}
    found = []
    for path in image.get_paths():
        mark = path.get_parasite(PATH_PARASITE)
        of_a_group = mark is not None and bytes(mark.get_data()).decode() == str(path.get_tattoo())
        if path.get_tattoo() not in own and not of_a_group:
            found.append(path)
    return found


def _candidate(path: Gimp.Path, selected: set[int], **about: Any) -> choosing.Candidate:
    return choosing.Candidate(name=path.get_name(), selected=path.get_id() in selected, **about)


def _straight(points: Sequence[float], closed: bool) -> dict[str, Any]:
    stroke = curves.straight_stroke(points)
    pieces = [[*curve[:2], *curve[6:]] for curve in curves.curves_of(stroke, closed)]
    return {"stroke": stroke, "closed": closed, "pieces": pieces}


def strokes_of(path: Gimp.Path) -> Iterator[tuple[list[float], bool]]:
    """Control points of each stroke of a path, and whether it is closed."""
    for stroke in path.get_strokes():
        _kind, points, closed = path.stroke_get_points(stroke)
        yield list(points), closed


def remember(
    kind: str,
    group: Gimp.Layer,
    layers: Sequence[Gimp.Layer],
    seams: Sequence[dict[str, Any]],
    blended: Gimp.Layer | None,
    options: dict[str, Any],
) -> None:
    """Attach to a stitched group, or to a patch, what Re-stitch from Paths needs; it is saved with the
    file.
    """
    tattoos = {
        "layers": [layer.get_tattoo() for layer in layers],
        "blended": None if blended is None else blended.get_tattoo(),
    }
    memory = {"version": _PARASITE_VERSION, "kind": kind, **tattoos, "seams": seams, "options": options}
    text = json.dumps(memory, separators=(",", ":"))
    group.attach_parasite(Gimp.Parasite.new(PARASITE, _KEPT, list(text.encode())))


def stitched_group(layers: Sequence[Gimp.Layer]) -> tuple[Gimp.Layer, dict[str, Any]]:
    """Return the stitched group or patch that is meant by the selected layers, and what it remembers."""
    for layer in layers:
        item = layer
        while item is not None:
            parasite = item.get_parasite(PARASITE)
            if parasite is not None:
                return item, _memory(parasite)
            item = item.get_parent()
    raise RefusedError(
        _(
            "Select a group that Stitch Layers has made, a layer in it, or a patch, then choose Re-stitch "
            "from Paths again."
        )
    )


def _memory(parasite: Gimp.Parasite) -> dict[str, Any]:
    try:
        memory: dict[str, Any] = json.loads(bytes(parasite.get_data()))
        if memory["version"] == _PARASITE_VERSION:
            return memory
    except (ValueError, KeyError, TypeError):
        pass
    raise RefusedError(_("This group was stitched by another version of TopoSeam; stitch its layers again."))
