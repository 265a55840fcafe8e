"""Layers and paths of an image: their choice, and results put beside them in one undo step."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from gi.repository import Gimp

from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.engine.turns import turn
from toposeam_gimp.image import curves, pixels
from toposeam_gimp.image import path_choice as choosing
from toposeam_gimp.texts import _

#: Name of the parasite on a stitched group: its layers and its exact seams.
PARASITE = "toposeam-seam"
#: Name of the parasite on the paths of a stitched group: their own tattoo, which a copy does not match.
PATH_PARASITE = "toposeam-path"
#: Name of the parasite on a stitched group: the label map, compressed, when its masks were written.
SHOWN_PARASITE = "toposeam-shown"
#: Name of the parasite on a layer with strokes: the tattoo of their group.
HINTS_PARASITE = "toposeam-hints"
#: Name of the parasite on an image: the guides at the place that was marked last.
_GUIDES_PARASITE = "toposeam-guides"
_PARASITE_VERSION = 3
#: Flags of the parasites: saved with the file, and part of the undo step, as GIMP reports an error on undo
#: otherwise.
KEPT = Gimp.PARASITE_PERSISTENT | Gimp.PARASITE_UNDOABLE


class RefusedError(Exception):
    """The request is impossible for this image; the text says what to do."""


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


def under_masks(drawables: Sequence[Gimp.Drawable]) -> list[Gimp.Drawable]:
    """Return the layers of masks, which are selected while somebody paints on them; others as they are."""
    return [Gimp.Layer.from_mask(one) if isinstance(one, Gimp.LayerMask) else one for one in drawables]


def lowest_first(image: Gimp.Image, layers: Sequence[Gimp.Layer]) -> list[Gimp.Layer]:
    """Sort layers in the order of the stack, from below. A group together with its own layers is refused."""
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
    """Test whether the centres of drawables coincide, as those of files that were opened as layers."""
    middles = set()
    for one in drawables:
        _nothing, left, top = one.get_offsets()
        middles.add((left + one.get_width() // 2, top + one.get_height() // 2))
    return len(drawables) > 1 and len(middles) == 1


def check_selection(image: Gimp.Image, options: Mapping[str, Any]) -> None:
    """Refuse a selection, which limits the seams, while the places of the layers are unknown."""
    if options["places"] == "anywhere" and not Gimp.Selection.is_empty(image):
        raise RefusedError(
            _(
                "A selection says where the seams may run, but where the layers belong is not known yet. "
                "Choose Select → None, or leave the layers where they lie."
            )
        )


@contextmanager
def one_undo_step(image: Gimp.Image) -> Iterator[list[Callable[[], Any]]]:
    """Make the block one undo step. If it fails, call the functions in the yielded list, last first. Blocks
    of other entries wait, as GIMP would join their steps.
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


def mark_place(image: Gimp.Image, place: Sequence[int]) -> None:
    """Let two guides cross at a place of the canvas; those of the last place go."""
    mark = image.get_parasite(_GUIDES_PARASITE)
    old = [] if mark is None else list(map(int, bytes(mark.get_data()).decode().split(",")))
    guide, known = image.find_next_guide(0), []
    while guide:
        known.append(guide)
        guide = image.find_next_guide(guide)
    for guide in old:
        if guide in known:
            image.delete_guide(guide)
    x, y = (
        min(max(at, 0), size) for at, size in zip(place, (image.get_width(), image.get_height()), strict=True)
    )
    new = image.add_vguide(x), image.add_hguide(y)
    image.attach_parasite(Gimp.Parasite.new(_GUIDES_PARASITE, 0, list(",".join(map(str, new)).encode())))


def draw_seam(image: Gimp.Image, seam: dict[str, Any], *, visible: bool) -> tuple[Gimp.Path, dict[str, Any]]:
    """Draw a seam as a smooth path of GIMP that can be bent; return the path and its record, the exact line
    of each curve.
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
    """Return the lines of an image's paths for a seam, whether they differ from the found ones, and a remark
    for the user.

    Parameters
    ----------
    seam : dict
        The record of :func:`draw_seam`.
    others : sequence of Path
        Other paths, not the group's own, that may be for this seam.
    """
    selected = {path.get_id() for path in image.get_selected_paths()}
    candidates = []
    own = image.get_path_by_tattoo(seam["path"])
    if own is not None:
        found, touched = curves.lines_of(strokes_of(own), seam["lines"])
        candidates.append(_candidate(own, selected, own=True, touched=touched, lines=found))
    for path in others:
        found, _touched = curves.lines_of(strokes_of(path), ())
        newer = path.get_tattoo() > seam["path"]  # tattoos increase
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
    """Return the paths of an image that belong to no stitched group and have a line; a click of the path tool
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
    """Return the control points of each stroke of a path, and whether it is closed."""
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
    """Attach the record that Re-stitch needs to a stitched group or a patch; it is saved with the file.

    `about` holds its kind, the options, the layers' names in those of seams, and perhaps the checksums of
    strokes and masks. The answer's label map is attached compressed, so that later changes of masks are
    known; without a folder the old one stays.
    """
    memory = {
        "version": _PARASITE_VERSION,
        **about,
        "group": group.get_tattoo(),
        "layers": [layer.get_tattoo() for layer in layers],
        "blended": answer.get("blended") if folder is None else blended and blended.get_tattoo(),
        "hints": hints and hints.get_tattoo(),
        "labels": answer["labels"],
        "margin": answer.get("margin"),
        "masks": about.get("masks") or sums_of(layers),
        "seams": seams,
    }
    text = json.dumps(memory, separators=(",", ":"))
    group.attach_parasite(Gimp.Parasite.new(PARASITE, KEPT, list(text.encode())))
    if folder is not None:
        # GIMP's binding takes ASCII only.
        packed = base64.b64encode((folder.path / answer["labels"]["file"]).read_bytes())
        group.attach_parasite(Gimp.Parasite.new(SHOWN_PARASITE, KEPT, list(packed)))


def sums_of(
    layers: Sequence[Gimp.Layer], known: Sequence[Any] | None = None, window: pixels.Box | None = None
) -> list[list[Any]]:
    """Return the place of each layer and the checksums of its mask's tiles, which show whether and where it
    was painted; beyond a window of the canvas the known ones are kept.
    """
    found = []
    for index, layer in enumerate(layers):
        box = pixels.in_own_pixels(layer, window)
        sums = pixels.tile_sums(layer.get_mask(), known[index][2] if known else None, box)
        found.append([*pixels.place_of(layer), sums])
    return found


def send_shown(folder: RequestFolder, group: Gimp.Layer, memory: Mapping[str, Any]) -> dict[str, Any] | None:
    """Write the packed label map of the time when the masks were written; None if it is unknown."""
    packed = group.get_parasite(SHOWN_PARASITE)
    if packed is None:
        return None
    (folder.path / "written.z").write_bytes(base64.b64decode(bytes(packed.get_data())))
    return {**memory["labels"], "file": "written.z"}


def stitched_group(image: Gimp.Image, layers: Sequence[Gimp.Layer]) -> tuple[Gimp.Layer, dict[str, Any]]:
    """Return the stitched group or patch of the selected layers, or of selected strokes, and its record."""
    for layer in layers:
        mark = layer.get_parasite(HINTS_PARASITE)
        item = layer if mark is None else image.get_layer_by_tattoo(int(bytes(mark.get_data())))
        while item is not None:
            parasite = item.get_parasite(PARASITE)
            if parasite is not None:
                memory = _memory(parasite)
                if memory.get("group", item.get_tattoo()) != item.get_tattoo():
                    raise RefusedError(_("This is a copy of a stitched group; stitch its layers again."))
                return item, memory
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
