"""GI-free: the engine's errors in GIMP's terms and the user's language.

The engine's sentences are about masks and pixels; users of GIMP have selections and layers. An error has a
kind, perhaps a parameter, and data. Errors that are not in the table are shown in the engine's words.
"""

from __future__ import annotations

from collections.abc import Mapping
from string import Formatter
from typing import Any

from toposeam_gimp.texts import _

_MOST = _("“{parameter}” is {value}; choose a number, {most} at most.")

#: By kind, or by kind and parameter: the sentence, or several, of which the first is taken whose fields the
#: data can fill.
_SENTENCES = {
    "apart": (
        _("“{name}” overlaps no other layer; move it onto one."),
        _("The layers do not overlap; move one of them onto the other."),
    ),
    "blocked": (
        _(
            "The selection, or what the seam keeps away from, leaves it no way through the overlap; select "
            "more, from end to end, or paint less white."
        ),
    ),
    "nothing between": (
        _(
            "One layer covers all of the other, so there is nothing between which a seam could run. If "
            "they are photographs to be placed, choose Panorama from Layers; otherwise let each reach "
            "beyond the other, or one lie well inside the other."
        ),
    ),
    "path not across": (
        _(
            "The path does not separate the layers; draw it right across the overlap, from border to border, "
            "and round every place that only one layer covers."
        ),
    ),
    "not aligned": (
        _(
            "“{name}” cannot be aligned: within {radius} px of where it lies it agrees with none of the "
            "other layers. Move it closer to its place, or choose “Align automatically” as Positions."
        ),
    ),
    "fits none": (
        _(
            "“{name}” shows nothing that the other layers show too, so where it belongs cannot be found out. "
            "Select the others without it; or lay it where it belongs, and choose Stitch Layers with the "
            "Positions “As the layers lie”."
        ),
    ),
    "fit none": (
        _(
            "These layers show nothing that the others show too, so where they belong cannot be found out: "
            "{names}. Select layers that overlap; or lay them where they belong, and choose Stitch Layers "
            "with the Positions “As the layers lie”."
        ),
    ),
    "apart in groups": (
        _(
            "“{name}” and {others} show something else than the other layers; select the layers that belong "
            "together."
        ),
    ),
    "misfit": (
        _(
            "These layers do not fit on each other exactly: {names}. Up to {off} px are left between them. "
            "They are no exact scans; choose Panorama from Layers with “Photographs”, which warps them."
        ),
    ),
    "ambiguous": (
        _(
            "It cannot be found out where these layers belong: {names}. What repeats itself matches in "
            "several places. Lay the layers by hand, and choose Stitch Layers with the Positions “As the "
            "layers lie”."
        ),
    ),
    "inexact": (
        _(
            "These layers share too little with the others to be placed exactly: {name}. Choose Panorama "
            "from Layers with “Photographs”, or lay them by hand and choose Stitch Layers."
        ),
    ),
    "small preview": (
        _(
            "The layers could not be placed in the small preview. OK looks at them in full size, and says "
            "what cannot be placed."
        ),
    ),
    "few layers": (_("Select at least two layers."),),
    "all to replace": (_("The selection covers the whole layer; select only what is to be replaced."),),
    "nothing to copy": (
        _("Around the selection there is nothing to copy from; choose to copy from the whole layer."),
    ),
    "nothing to replace": (
        _(
            "The layer is transparent where you have selected, so there is nothing to replace; "
            "select a part that shows."
        ),
    ),
    "nothing to sample": (_("The layer is transparent wherever it is selected; select a part that shows."),),
    "no room": (
        _(
            "No part of what may be copied has room for a patch of {width} × {height} px; use "
            "smaller patches."
        ),
    ),
    "no opaque room": (
        _(
            "No part of the layer that is opaque has room for a patch of {width} × {height} px; fill its "
            "holes first, or use smaller patches."
        ),
    ),
    "smaller than patch": (
        _("The layer is {width} × {height} px, smaller than a patch of {patch} px; use smaller patches."),
    ),
    "small": (_("The layer is {width} × {height} px; at least {least} px in each direction are needed."),),
    "whole number band": (
        _("The band is too wide or too narrow for {width} × {height} px; choose from {least} to {most} px."),
    ),
    "whole number overlap": (
        _("The overlap does not fit patches of {patch} px; choose from {least} to {most} px."),
    ),
    "whole number patch": (_("The patches are too small; use patches of at least {least} px."),),
    "whole number": (
        _("“{parameter}” is {value}; choose a whole number from {least} to {most}."),
        _("“{parameter}” is {value}; choose a whole number, {least} at least."),
        _MOST,
    ),
    "number": (
        _("“{parameter}” is {value}; choose a number from {least} to {most}."),
        _("“{parameter}” is {value}; choose a number above {above}, {most} at most."),
        _("“{parameter}” is {value}; choose a number, {least} at least."),
        _("“{parameter}” is {value}; choose a number above {above}."),
        _MOST,
    ),
    "choice": (_("“{parameter}” is {value}; choose one of {allowed}."),),
    "plain": (
        _(
            "The layer has one colour everywhere, so there is nothing to make a texture of; use a "
            "picture with structure."
        ),
    ),
    "transparent": (_("The layer is transparent everywhere; choose one that shows something."),),
    "transparent borders": (
        _(
            "The layer is transparent all along its borders, so it repeats as it is; crop it to what it "
            "shows first."
        ),
    ),
    "transparent frame": (
        _(
            "“{name}” is transparent in places; put it on a background first (Filters → Animation → "
            "Unoptimize)."
        ),
    ),
    "not finite": (
        _("“{name}” holds pixels that are no numbers, or infinite; replace these first."),
        _("The layer holds pixels that are no numbers, or infinite; replace these first."),
    ),
    "no PyMaxflow": (
        _("Graph cut needs PyMaxflow beside TopoSeam, which is not installed there; choose another method."),
    ),
    "not side by side": (
        _("Dynamic programming joins only layers that lie side by side; choose another method."),
    ),
    "short clip": (
        _(
            "The animation has {count} frames, too few for such a loop; ask for fewer frames or a shorter "
            "transition."
        ),
    ),
    "short loop": (
        _("The transition takes {transition} frames, and the loop has {most}; use a shorter transition."),
    ),
    "long transition": (_("The transition takes {transition} of {count} frames; use {most} at most."),),
    "odd size": (_("This rule needs an even size; use {size} px."),),
    "too large": (_("That would be too large a picture; make a smaller one."),),
    "internal": (_("Something went wrong inside TopoSeam ({what}). Nothing was changed; please report it."),),
}


def in_gimps_words(error: Mapping[str, Any]) -> str:
    """Return the sentence for an error of the engine in GIMP's terms.

    Parameters
    ----------
    error : mapping
        ``message``, the engine's own sentence; and ``kind``, ``parameter`` and ``data``, a mapping of texts.
    """
    data = dict(error.get("data") or {})
    kind, parameter = str(error.get("kind")), error.get("parameter")
    if parameter is not None:
        data["parameter"] = parameter
    for key in (f"{kind} {parameter}", kind):
        for text in _SENTENCES.get(key, ()):
            if all(field in data for _literal, field, _spec, _conversion in Formatter().parse(text) if field):
                return text.format(**data)
    return str(error["message"])
