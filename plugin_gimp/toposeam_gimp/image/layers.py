"""Layers and paths of an image: which are meant, and how results are put beside them in one undo step."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from gi.repository import Gimp

from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.engine.turns import turn
from toposeam_gimp.image import curves, pixels
from toposeam_gimp.image import path_choice as choosing
from toposeam_gimp.texts import _

#: Name of the parasite on a stitched group: its layers, and its seams exactly.
PARASITE = "toposeam-seam"
#: On the paths that a stitched group has made: their own tattoo, so that a copy is known to be one.
PATH_PARASITE = "toposeam-path"
#: On a stitched group, packed: which layer showed where when its masks were written.
SHOWN_PARASITE = "toposeam-shown"
#: On a layer with strokes: the tattoo of the group they are for.
HINTS_PARASITE = "toposeam-hints"
_PARASITE_VERSION = 3
#: Saved with the file, and part of the undo step; without the latter GIMP complains when it is undone.
KEPT = Gimp.PARASITE_PERSISTENT | Gimp.PARASITE_UNDOABLE


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


def all_alike(drawables: Sequence[Gimp.Drawable]) -> bool:
    """Test whether the middles of drawables lie on each other, as those of files that were opened as
    layers.
    """
    middles = set()
    for one in drawables:
        _nothing, left, top = one.get_offsets()
        middles.add((left + one.get_width() // 2, top + one.get_height() // 2))
    return len(drawables) > 1 and len(middles) == 1


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
    """Group the block into one undo step; if it fails, call the list's functions, last first. Blocks of other
    entries wait: GIMP would make one step of both.
    """
    undone: list[Callable[[], Any]] = []
    with turn():
        image.undo_group_start()
        try:
            yield undone
        except BaseException:
            if image.is_valid():
                for step in reversed(undone):
                    step()
            raise
        finally:
            if image.is_valid():
                image.undo_group_end()


def draw_seam(image: Gimp.Image, seam: dict[str, Any], *, visible: bool) -> tuple[Gimp.Path, dict[str, Any]]:
    """GIMP's path for a seam, smooth and to be bent, and what has to be remembered of it: what each of its
    curves stands for exactly.
    """
    path = Gimp.Path.new(image, _("Seam {name}").format(name=seam["name"]))
    image.insert_path(path, None, 0)
    mark = list(str(path.get_tattoo()).encode())
    path.attach_parasite(Gimp.Parasite.new(PATH_PARASITE, KEPT, mark))
    lines = []
    for line in seam["lines"]:
        closed = line["closed"]
        stroke = curves.stroke_of(line["curves"], closed)
        path.stroke_new_from_points(Gimp.PathStrokeType.BEZIER, stroke, closed)
        lines.append({"stroke": stroke, "closed": closed, "pieces": line["pieces"]})
    path.set_visible(visible)
    memory = {"name": seam["name"], "pair": seam["pair"], "lines": lines, "path": path.get_tattoo()}
    return path, memory


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
    candidates = []
    own = image.get_path_by_tattoo(seam["path"])
    if own is not None:
        found, touched = curves.lines_of(strokes_of(own), seam["lines"])
        candidates.append(_candidate(own, selected, own=True, touched=touched, lines=found))
    for path in others:
        found, _touched = curves.lines_of(strokes_of(path), ())
        newer = path.get_tattoo() > seam["path"]  # GIMP counts them up
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
    """Return the paths of an image that belong to no stitched group and have a line: a click of the path tool
    leaves a path without one.
    """
    own = {seam["path"] for seam in seams}
    found = []
    for path in image.get_paths():
        mark = path.get_parasite(PATH_PARASITE)
        of_a_group = mark is not None and bytes(mark.get_data()).decode() == str(path.get_tattoo())
        drawn = any(len(points) > 6 for points, _closed in strokes_of(path))
        if drawn and path.get_tattoo() not in own and not of_a_group:
            found.append(path)
    return found


def _candidate(path: Gimp.Path, selected: set[int], **about: Any) -> choosing.Candidate:
    return choosing.Candidate(name=path.get_name(), selected=path.get_id() in selected, **about)


def strokes_of(path: Gimp.Path) -> Iterator[tuple[list[float], bool]]:
    """Control points of each stroke of a path, and whether it is closed."""
    for stroke in path.get_strokes():
        _kind, points, closed = path.stroke_get_points(stroke)
        yield list(points), closed


def remember(
    folder: RequestFolder | None,
    group: Gimp.Layer,
    layers: Sequence[Gimp.Layer],
    seams: Sequence[dict[str, Any]],
    blended: Gimp.Layer | None,
    about: Mapping[str, Any],
    answer: Mapping[str, Any],
    hints: Gimp.Layer | None = None,
) -> None:
    """Attach to a stitched group, or to a patch, what Re-stitch needs; it is saved with the file.

    `about` holds its kind and the options; of the answer it is what shows where, packed, so that what is
    painted on masks later is known. Without a folder that stays as it was.
    """
    memory = {
        "version": _PARASITE_VERSION,
        **about,
        "layers": [layer.get_tattoo() for layer in layers],
        "blended": answer.get("blended") if folder is None else blended and blended.get_tattoo(),
        "hints": hints and hints.get_tattoo(),
        "labels": answer["labels"],
        "masks": answer.get("masks") if folder is None else sums_of(folder, layers, answer["masks"]),
        "seams": seams,
    }
    text = json.dumps(memory, separators=(",", ":"))
    group.attach_parasite(Gimp.Parasite.new(PARASITE, KEPT, list(text.encode())))
    if folder is not None:
        # GIMP's binding takes characters up to 127.
        packed = base64.b64encode(zlib.compress((folder.path / answer["labels"]["file"]).read_bytes(), 1))
        group.attach_parasite(Gimp.Parasite.new(SHOWN_PARASITE, KEPT, list(packed)))


def sums_of(
    folder: RequestFolder, layers: Sequence[Gimp.Layer], masks: Sequence[dict[str, Any] | None]
) -> list[list[int]]:
    """Return the place of each layer and the checksum of its mask, as it lies in a folder: they say whether
    somebody has painted on masks.
    """
    return [
        [
            *pixels.place_of(layer),
            0 if mask is None else zlib.crc32((folder.path / mask["file"]).read_bytes()),
        ]
        for layer, mask in zip(layers, masks[-len(layers) :], strict=True)
    ]


def send_shown(folder: RequestFolder, group: Gimp.Layer, memory: Mapping[str, Any]) -> dict[str, Any] | None:
    """Write what showed where when the masks were written; None where that is not known."""
    packed = group.get_parasite(SHOWN_PARASITE)
    if packed is None:
        return None
    (folder.path / "written.raw").write_bytes(zlib.decompress(base64.b64decode(bytes(packed.get_data()))))
    return {**memory["labels"], "file": "written.raw"}


def stitched_group(image: Gimp.Image, layers: Sequence[Gimp.Layer]) -> tuple[Gimp.Layer, dict[str, Any]]:
    """Return the stitched group or patch that is meant by the selected layers, and what it remembers; strokes
    for a group mean it, too.
    """
    for layer in layers:
        mark = layer.get_parasite(HINTS_PARASITE)
        item = layer if mark is None else image.get_layer_by_tattoo(int(bytes(mark.get_data())))
        while item is not None:
            parasite = item.get_parasite(PARASITE)
            if parasite is not None:
                return item, _memory(parasite)
            item = item.get_parent()
    raise RefusedError(
        _(
            "Select a group that Panorama from Layers or Stitch Layers has made, a layer in it, or a "
            "patch, then try again."
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
