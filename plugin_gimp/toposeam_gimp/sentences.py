"""GI-free: what the engine says, in GIMP's words and the user's language.

The engine speaks of masks and pixels as the library does; who sits at GIMP has selections and layers. What is
not in the table is shown as it came.
"""

from __future__ import annotations

import re

from toposeam_gimp.texts import _

#: What the engine's sentence holds, and what to say instead; named groups come along.
_SENTENCES = (
    (
        r"(?P<name>.+) \(at -?\d+,-?\d+\): the patches do not overlap",
        _("“{name}” does not overlap the other layers; move it onto them."),
    ),
    (r"the patches do not overlap", _("The layers do not overlap; move one of them onto the other.")),
    (
        r"(?:.+ \(at -?\d+,-?\d+\): )?no seam avoids the pixels you excluded",
        _("The selection leaves the seam no way through the overlap; select more of it, from end to end."),
    ),
    (
        r"nothing divides the patches",
        _(
            "Where the layers overlap, one covers all of the other, or is too thin to hold a seam; let each "
            "reach beyond the other, or one lie well inside the other."
        ),
    ),
    (
        r"(?:(?P<name>.+): )?the path does not separate the patches",
        _(
            "The path does not separate the layers; draw it right across the overlap, from border to border, "
            "and round every place that only one layer covers."
        ),
    ),
    (
        r"(?P<name>.+) cannot be aligned: within (?P<radius>\d+) px",
        _(
            "“{name}” cannot be aligned: within {radius} px of where it lies it agrees with none of the "
            "other layers. Move it closer to its place, or let “Positions” find out where it belongs."
        ),
    ),
    (
        r"(?P<name>.+) fits none of the other pictures",
        _(
            "“{name}” shows nothing that the other layers show too, so where it belongs cannot be found out. "
            "Select the others without it, or lay it where it belongs and switch “Positions” back."
        ),
    ),
    (
        r"(?P<name>.+?) and (?P<others>.+) show something else than the other pictures",
        _(
            "“{name}” and {others} show something else than the other layers; select the layers that belong "
            "together."
        ),
    ),
    (
        r"(?P<names>.+) fit none of the other pictures",
        _(
            "{names} show nothing that the other layers show too, so where they belong cannot be found out. "
            "Select the others without them, or lay them where they belong and switch “Positions” back."
        ),
    ),
    (
        r"(?P<names>.+) do not fit where the other pictures place them: up to (?P<off>[\d.]+) px",
        _(
            "{names} do not fit on each other: up to {off} px are left between them. Moving and turning do "
            "not undo a lens or a change of perspective; lay the layers by hand, and switch “Positions” back."
        ),
    ),
    (
        r"(?P<names>.+) (?:match|agree) where the other (?:pictures|layers) do not place them",
        _(
            "{names} match where the other layers do not place them, and which is right cannot be told: what "
            "repeats itself matches in several places. Lay the layers by hand, and switch “Positions” back."
        ),
    ),
    (
        r"(?P<name>.+) cannot be placed exactly",
        _(
            "“{name}” shares too little with the other layers to be placed exactly; lay it by hand, and "
            "switch “Positions” back."
        ),
    ),
    (
        r"nothing is left to copy from: the mask covers the whole picture",
        _("The selection covers the whole layer; select only what is to be replaced."),
    ),
    (
        r"nothing is left to copy from",
        _("Around the selection there is nothing to copy from; choose to copy from the whole layer."),
    ),
    (
        r"the mask is empty, or the picture transparent there",
        _(
            "The layer is transparent where you have selected, so there is nothing to replace; "
            "select a part that shows."
        ),
    ),
    (
        r"no place (?:outside|in) the mask has room for a patch of (?P<width>\d+) × (?P<height>\d+) px",
        _(
            "No part of what may be copied has room for a patch of {width} × {height} px; use "
            "smaller patches."
        ),
    ),
    (
        r"the (?:source|sample|exemplar) is (?P<width>\d+) × (?P<height>\d+) px, smaller than a "
        r"patch of (?P<patch>\d+) px",
        _("The layer is {width} × {height} px, smaller than a patch of {patch} px; use smaller patches."),
    ),
    (
        r"the (?:image|source) is (?P<width>\d+) × (?P<height>\d+) px; to .* at least (?P<least>\d+) px",
        _("The layer is {width} × {height} px; at least {least} px in each direction are needed."),
    ),
    (
        r"band is .*; for (?P<width>\d+) × (?P<height>\d+) px give a whole number from "
        r"(?P<least>\d+) to (?P<most>\d+)",
        _("The band is too wide or too narrow for {width} × {height} px; choose from {least} to {most} px."),
    ),
    (
        r"overlap is .* with patches of (?P<patch>\d+) px; give a whole number from "
        r"(?P<least>\d+) to (?P<most>\d+)",
        _("The overlap does not fit patches of {patch} px; choose from {least} to {most} px."),
    ),
    (
        r".* has one value everywhere",
        _(
            "The layer has one colour everywhere, so there is nothing to make a texture of; use a "
            "picture with structure."
        ),
    ),
    (
        r"nothing of .* may be sampled",
        _("The layer is transparent wherever it is selected; select a part that shows."),
    ),
    (
        r".*(?:PyMaxflow|maxflow)",
        _("Graph cut needs PyMaxflow beside TopoSeam, which is not installed there; choose another method."),
    ),
    (
        r"the clip has (?P<count>\d+) frames; from frame .* use a length of at most (?P<most>-?\d+)",
        _(
            "The animation has {count} frames, too few for such a loop; ask for fewer frames or a shorter "
            "transition."
        ),
    ),
    (
        r"a loop of at most (?P<most>\d+) frames is shorter than its transition of (?P<transition>\d+)",
        _("The transition takes {transition} frames, and the loop has {most}; use a shorter transition."),
    ),
    (
        r"transition is (?P<transition>\d+) frames, and the clip has (?P<count>\d+)"
        r": .* at most (?P<most>\d+)",
        _("The transition takes {transition} of {count} frames; use {most} at most."),
    ),
    (
        r"the frame (?P<name>.+) is transparent in places",
        _(
            "“{name}” is transparent in places; put it on a background first (Filters → Animation → "
            "Unoptimize)."
        ),
    ),
    (
        r"repeat (?P<rule>.+) needs even sizes, this cell is .*; use \d+ × (?P<size>\d+)",
        _("This rule needs an even size; use {size} px."),
    ),
    (
        r".* span .* megapixels|a texture of .* has more than .* megapixels|the pattern would have",
        _("That would be too large a picture; make a smaller one."),
    ),
    (
        r".+ \(at -?\d+,-?\d+\): nothing divides the patches",
        _(
            "Where the layers overlap, one covers all of the other, or is too thin to hold a seam; let each "
            "reach beyond the other, or one lie well inside the other."
        ),
    ),
    (
        r"(?:image|source|frames) has NaN or infinite values",
        _("The layer holds pixels that are no numbers, or infinite; replace these first."),
    ),
    (
        r"(?P<name>.+) has NaN or infinite values",
        _("“{name}” holds pixels that are no numbers, or infinite; replace these first."),
    ),
    (
        r"(?:nowhere is the picture opaque and free|no place that shows has room) for a patch of "
        r"(?P<width>\d+) × (?P<height>\d+) px",
        _(
            "No part of the layer that is opaque has room for a patch of {width} × {height} px; fill its "
            "holes first, or use smaller patches."
        ),
    ),
    (
        r"(?:image|source) is transparent everywhere",
        _("The layer is transparent everywhere; choose one that shows something."),
    ),
    (
        r"the image is transparent all along its borders",
        _(
            "The layer is transparent all along its borders, so it repeats as it is; crop it to what it "
            "shows first."
        ),
    ),
    (
        r"(?:.+: )?method dp handles only",
        _("Dynamic programming joins only layers that lie side by side; choose another method."),
    ),
    (
        r"patch is \d+; it must be a whole number of at least (?P<least>\d+)",
        _("The patches are too small; use patches of at least {least} px."),
    ),
    (
        r"1 layer was given",
        _("Select at least two layers."),
    ),
    (
        r"something went wrong inside TopoSeam \((?P<what>.*)\); set TOPOSEAM_DEBUG",
        _("Something went wrong inside TopoSeam ({what}). Nothing was changed; please report it."),
    ),
)


def in_gimps_words(message: str) -> str:
    """An engine's sentence as it makes sense in GIMP."""
    for pattern, text in _SENTENCES:
        found = re.match(pattern, message)
        if found:
            return text.format(**{name: part or "" for name, part in found.groupdict().items()})
    return message
