"""GI-free: the table of everything in Filters → TopoSeam. A menu entry is an entry here and a function."""

from __future__ import annotations

import re
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
    #: Module of this package, and its function.
    work: str
    options: tuple[Option, ...] = ()
    #: When the entry can be used: "layer" when one is selected, "layers" for one or more, "nothing" always.
    needs: str = "layer"
    #: Name and blurb of the layer it returns.
    returns: tuple[str, str] = ("layer", "The new layer")

    @property
    def title(self) -> str:
        """The label without mnemonic and dots; Korean ones write it as “(_S)”."""
        return re.sub(r"\(_\w\)|_", "", self.label).rstrip(".")


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
    name="merge", label=_("Merge into one la_yer"), default=False, engine=False,
    help=_("Make one layer of the result instead of a group of layers with masks"),
)  # fmt: skip
_CORE = Option(
    name="core", label=_("Core that m_ust show"), default=0.5, low=0.05, high=1.0,
    help=_("The share of the patch's depth, from its innermost point outwards, that the seam must leave to the patch"),
)  # fmt: skip
_SEED = Option(
    name="seed", label=_("S_eed"), default=0, low=0, high=2_147_483_647,
    help=_("The same seed gives the same picture; another one, another picture"),
)  # fmt: skip
_PATCH = Option(
    name="patch", label=_("_Patch (px, 0: by the texture's scale)"), default=40, low=0, high=1024,
    help=_("Side of the patches that are laid; larger than the elements of the texture"),
)  # fmt: skip
_OVERLAP = Option(
    name="overlap", label=_("O_verlap (px, 0: a quarter of the patch)"), default=0, low=0, high=512,
    help=_("How far neighbouring patches overlap; the seams run there"),
)  # fmt: skip
_BORDERS = (("both", _("On both axes")), ("x", _("Left and right")), ("y", _("Top and bottom")))
_SHOW = Option(
    name="show-seam", label=_("Show the s_eam"), default=False, engine=False,
    help=_("Make the paths of the seams visible; they are in the Paths dialog in any case"),
)  # fmt: skip

#: Wallpaper groups, and palettes; the same as core's (a test compares them).
_GROUPS = ("p1", "p2", "pm", "pg", "cm", "pmm", "pmg", "pgg", "cmm", "p4", "p4m", "p4g", "p3", "p3m1", "p31m", "p6", "p6m")
_PALETTES = (
    "spring", "summer", "fall", "winter", "indigo", "sumi", "terracotta", "botanic", "sea", "plum", "saffron", "night",
)  # fmt: skip

PROCEDURES = {
    entry.name: entry
    for entry in (
        Procedure(
            name="plug-in-toposeam-stitch", label=_("_Stitch Layers..."), work="seams.stitch_layers", needs="layers",
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
            name="plug-in-toposeam-restitch", label=_("_Re-stitch from Paths"), work="seams.restitch", needs="layers",
            blurb=_("Apply the seams of a stitched group again after you have bent their paths"),
            help=_(
                "Select a group that Stitch Layers has made, or a layer in it. Its masks are made anew from its paths: curves are "
                "followed, ends that stop short of the overlap's border are extended. A path you have not touched gives exactly the "
                "seam that was found."
            ),
            returns=("group", "The group of stitched layers"),
        ),
        Procedure(
            name="plug-in-toposeam-patch", label=_("Stitch Selection as _Patch..."), work="seams.patch_selection",
            blurb=_("Lay the selected part of this layer on what is below it, within a closed seam that nobody sees"),
            help=_(
                "Select generously round what you want to lay on the picture below: a face, a cloud, a cloned spot. The seam runs within "
                "the selection where the two pictures differ least. A floating selection, or without any selection the whole layer, is a "
                "patch too. The patch becomes a layer with a mask, and the seam a path; the layer it was cut from is hidden."
            ),
            options=(_CORE, _METHOD, _GRADIENT, _BLEND, _WIDTH, _SHOW), returns=("patch", "The layer with the patch"),
        ),
        Procedure(
            name="plug-in-toposeam-synthesize", label=_("S_ynthesize Texture..."), work="textures.synthesize",
            blurb=_("Grow a texture of any size from this layer, or from the selected part of it"),
            help=_(
                "Patches of the layer are laid where they fit best and cut along seams found by heat. With a "
                "selection, only what is selected "
                "is copied; it need not be a rectangle."
            ),
            options=(
                Option(name="width", label=_("_Width (px)"), help=_("Width of the texture"), default=512, low=16, high=65536),
                Option(name="height", label=_("He_ight (px)"), help=_("Height of the texture"), default=512, low=16, high=65536),
                _PATCH, _OVERLAP,
                Option(
                    name="tileable", label=_("_Tileable"), help=_("Whether the texture continues at its opposite border"), default="none",
                    choices=(("none", _("No")), *_BORDERS),
                ),
                _SEED,
                Option(
                    name="destination", label=_("I_nto"), help=_("Where the texture goes"), default="image", engine=False,
                    choices=(("image", _("A new image")), ("layer", _("A new layer"))),
                ),
            ),
        ),
        Procedure(
            name="plug-in-toposeam-tile", label=_("Make Seamless _Tile..."), work="textures.make_tileable",
            blurb=_("Make this layer, or the selected rectangle of it, repeat without a visible border"),
            help=_(
                "Only a band along the borders changes: patches of the picture itself are laid over them and cut along "
                "seams found by heat. The "
                "result is a new layer."
            ),
            options=(
                Option(
                    name="band", label=_("_Band (px, 0: an eighth of the shorter side)"), help=_("How much along each border may change"),
                    default=0, low=0, high=4096,
                ),
                Option(name="tileable", label=_("Re_peat"), help=_("Which borders are to match"), default="both", choices=_BORDERS),
                _SEED,
            ),
        ),
        Procedure(
            name="plug-in-toposeam-fill", label=_("_Fill Selection..."), work="textures.fill",
            blurb=_("Replace what is selected by what the rest of this layer is like"),
            help=_(
                "The hole is filled from outside inwards with patches of the layer, cut along seams found by heat that "
                "may run through a band "
                "round the selection. The result is a new layer that covers what was selected."
            ),
            options=(
                Option(
                    name="patch", label=_("_Patch (px, 0: by the picture's scale)"), help=_PATCH.help, default=0, low=0, high=1024
                ),
                _OVERLAP,
                Option(
                    name="band", label=_("_Band (px, 0: the overlap)"), default=0, low=0, high=1024,
                    help=_("Width of the band round the selection that may change as well"),
                ),
                _SEED,
            ),
        ),
        Procedure(
            name="plug-in-toposeam-motif", label=_("_Generate Motif..."), work="motifs.generate", needs="nothing",
            blurb=_("Invent a motif that repeats: layers of ink, each drawn by heat on its way from sources to sinks"),
            help=_(
                "A new image appears with a layer of paper and one layer per ink in Multiply mode; the masks are the "
                "strokes. Fill a layer with "
                "another colour and the motif follows. Repeat Motif makes a pattern of it."
            ),
            options=(
                Option(name="size", label=_("Si_ze (px)"), help=_("Width and height of the motif"), default=256, low=32, high=4096),
                Option(
                    name="repeat", label=_("Repeats _by"), help=_("The rule by which copies of the motif join"), default="translate",
                    choices=(
                        ("none", _("Nothing")), ("reflect", _("Reflection")), ("translate", _("Translation")), ("rotate", _("Half turns")),
                        *((group, group) for group in _GROUPS),
                    ),
                ),
                Option(name="layers", label=_("_Inks"), help=_("Number of layers of ink"), default=3, low=1, high=6),
                Option(
                    name="palette", label=_("_Palette"), help=_("The colours of paper and inks"), default="random",
                    choices=(("random", _("From the seed")), *((name, name.capitalize()) for name in _PALETTES)),
                ),
                Option(
                    name="mass", label=_("In_k (share of the area, 0: from the seed)"), help=_("How much of the paper each ink covers"),
                    default=0.0, low=0.0, high=0.9,
                ),
                Option(
                    name="penalty", label=_("_Distinctness"), default=3.0, low=1.0, high=6.0,
                    help=_("The penalty exponent p: 1 looks like ink wash, 3 gives distinct strokes"),
                ),
                Option(
                    name="iterations", label=_("I_terations"), help=_("Strokes become finer and more distinct with each"),
                    default=40, low=1, high=1000,
                ),
                _SEED,
                Option(
                    name="use-layer", label=_("Shape the strokes after this la_yer"), default=False, engine=False,
                    help=_("Strokes keep to the bright parts of the selected layer, a logo or a photograph"),
                ),
                Option(
                    name="base-strength", label=_("Stren_gth of its shape"), default=0.7, low=-1.0, high=1.0,
                    help=_("How strongly the layer shows; below 0 the strokes keep to its dark parts"),
                ),
            ),
            returns=("layer", "The group of inks"),
        ),
        Procedure(
            name="plug-in-toposeam-repeat", label=_("Repeat _Motif..."), work="motifs.repeat", needs="layers",
            blurb=_("Lay copies of a motif side by side by its own rule"),
            help=_(
                "Works on an image that Generate Motif has made, in the colours and with the masks that it has now. The result "
                "is a new image."
            ),
            options=(
                Option(name="rows", label=_("Ro_ws"), help=_("Number of motifs from top to bottom"), default=4, low=1, high=200),
                Option(name="columns", label=_("Colu_mns"), help=_("Number of motifs from left to right"), default=4, low=1, high=200),
            ),
            returns=("layer", "The group of inks"),
        ),
    )
}  # fmt: skip
