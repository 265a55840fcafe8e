"""GI-free: the table of everything in Filters → TopoSeam. A menu entry is an entry here and a function in :mod:`toposeam_gimp.work`."""

from __future__ import annotations

from dataclasses import dataclass

from toposeam_gimp.texts import _


@dataclass(frozen=True, kw_only=True)
class Option:
    """A field of a dialog, an argument of a procedure."""

    name: str
    label: str
    help: str
    #: Its type says what the option is: bool, int, float, or one of `choices`.
    default: bool | int | float | str
    low: float = 0
    high: float = 1
    #: Pairs of what scripts write and what people read.
    choices: tuple[tuple[str, str], ...] = ()
    #: Whether it goes to the engine as it is; the others are for the plug-in.
    engine: bool = True


@dataclass(frozen=True, kw_only=True)
class Procedure:
    """A menu entry and its procedure."""

    name: str
    #: Menu entry, with its mnemonic.
    label: str
    blurb: str
    help: str
    #: Function in :mod:`toposeam_gimp.work`.
    work: str
    options: tuple[Option, ...] = ()
    #: What is selected when the entry can be used: one layer, or several.
    several: bool = False
    #: Name and blurb of the layer it returns.
    returns: tuple[str, str] = ("layer", "The new layer")


_METHOD = Option(
    name="method", label=_("_Method"), default="heat",
    help=_("How the seam is found: by heat, by the dissertation's algorithm, or by one of the classical methods"),
    choices=(
        ("heat", _("Heat")), ("thesis", _("Heat, as in the dissertation (slow)")), ("shortest-path", _("Shortest path (exact)")),
        ("dp", _("Dynamic programming (never turns back)")), ("graph-cut", _("Graph cut (needs PyMaxflow)")),
    ),
)  # fmt: skip
_GRADIENT = Option(
    name="gradient", label=_("Compare _gradients too"), default=True,
    help=_("Also count how much the pictures differ in their gradients, so that the seam does not cut across edges"),
)  # fmt: skip
_BLEND = Option(
    name="blend", label=_("_Blend"), default="none",
    help=_("What happens across the seams; anything but a hard cut is put into a layer of its own above the others"),
    choices=(
        ("none", _("Hard cut")), ("feather", _("Feather along the seam")), ("soft", _("Soft, as the heat flows")),
        ("multiband", _("Multiband (coarse shades far, detail close)")), ("gradient", _("Gradient domain (no step in tone)")),
    ),
)  # fmt: skip
_WIDTH = Option(
    name="blend-width", label=_("Blend _width (px, 0: automatic)"), default=0.0, low=0.0, high=512.0,
    help=_("How far feather, multiband and gradient reach"),
)  # fmt: skip
_TONES = Option(
    name="match-tones", label=_("Match _tones first"), default=False,
    help=_("Remove a step in exposure or white balance: each layer's copy gets a gain per channel so that the overlaps agree"),
)  # fmt: skip
_KEEP = Option(
    name="keep-layers", label=_("_Keep the selected layers, hidden"), default=True, engine=False,
    help=_("Leave the layers you selected where they are, invisible; otherwise the stitched copies replace them"),
)  # fmt: skip
_MERGE = Option(
    name="merge", label=_("Merge into _one layer"), default=False, engine=False,
    help=_("Make one layer of the result instead of a group of layers with masks"),
)  # fmt: skip
_CORE = Option(
    name="core", label=_("_Core that must show"), default=0.5, low=0.05, high=1.0,
    help=_("The share of the patch's depth, from its innermost point outwards, that the seam must leave to the patch"),
)  # fmt: skip
_SHOW = Option(
    name="show-seam", label=_("_Show the seam"), default=False, engine=False,
    help=_("Make the paths of the seams visible; they are in the Paths dialog in any case"),
)  # fmt: skip

PROCEDURES = {
    entry.name: entry
    for entry in (
        Procedure(
            name="plug-in-toposeam-stitch", label=_("_Stitch Layers..."), work="stitch_layers", several=True,
            blurb=_("Join the selected layers where they overlap, along seams that nobody sees"),
            help=_(
                "Select two or more layers that overlap; the lowest comes first. A group appears with a copy of each layer under a layer "
                "mask, and one path per seam. If there is a selection, the seams stay within it. Bend a path with the path tool and use "
                "Re-stitch from Paths to apply it."
            ),
            options=(_METHOD, _GRADIENT, _BLEND, _WIDTH, _TONES, _KEEP, _MERGE, _SHOW),
            returns=("group", "The group of stitched layers, or the merged layer"),
        ),
        Procedure(
            name="plug-in-toposeam-restitch", label=_("_Re-stitch from Paths"), work="restitch",
            blurb=_("Apply the seams of a stitched group again after you have bent their paths"),
            help=_(
                "Select a group that Stitch Layers has made, or a layer in it. Its masks are made anew from its paths: curves are "
                "followed, ends that stop short of the overlap's border are extended. A path you have not touched gives exactly the "
                "seam that was found."
            ),
            returns=("group", "The group of stitched layers"),
        ),
        Procedure(
            name="plug-in-toposeam-patch", label=_("Stitch Selection as _Patch..."), work="patch_selection",
            blurb=_("Lay the selected part of this layer on what is below it, within a closed seam that nobody sees"),
            help=_(
                "Select generously round what you want to lay on the picture below: a face, a cloud, a cloned spot. The seam runs within "
                "the selection where the two pictures differ least. A floating selection, or without any selection the whole layer, is a "
                "patch too. The patch becomes a layer with a mask, and the seam a path; the layer it was cut from is hidden."
            ),
            options=(_CORE, _METHOD, _GRADIENT, _BLEND, _WIDTH, _SHOW), returns=("patch", "The layer with the patch"),
        ),
    )
}  # fmt: skip
