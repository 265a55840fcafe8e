"""GI-free: the menu entries that join layers."""

from __future__ import annotations

from toposeam_gimp.entries.entry import LAYERS, Option, Procedure, number
from toposeam_gimp.texts import _

_METHOD = Option(
    name="method",
    label=_("_Method"),
    default="auto",
    help=_(
        "How the seam is found: by the exact method that is fastest, by heat, by the dissertation's "
        "algorithm, or by one of the classical methods"
    ),
    choices=(
        ("auto", _("Automatic (exact and fastest)")),
        ("heat", _("Heat")),
        ("thesis", _("Heat, as in the dissertation (slow)")),
        ("shortest-path", _("Shortest path (exact)")),
        ("dp", _("Dynamic programming (never turns back)")),
        ("graph-cut", _("Graph cut (needs PyMaxflow)")),
    ),
    advanced=True,
)
_LAW = Option(
    name="law",
    label=_("Seam _goes round"),
    default="natural",
    help=_("What the seam must not cross; the first keeps people, posts and letters whole"),
    choices=(
        ("natural", _("What eyes notice")),
        ("gradient", _("Differences, but for edges")),
        ("colour", _("Differences of colour")),
    ),
    advanced=True,
)
_BLEND = Option(
    name="blend",
    label=_("_Blend"),
    default="none",
    help=_(
        "What happens across the seams; anything but a hard cut is put into a layer of its own above the "
        "others"
    ),
    choices=(
        ("none", _("Hard cut")),
        ("feather", _("Feather along the seam")),
        ("soft", _("Soft, as the heat flows")),
        ("multiband", _("Multiband (coarse shades far, detail close)")),
        ("gradient", _("Gradient domain (no step in tone)")),
    ),
)
_WIDTH = number(
    "blend-width",
    _("Blend _width (px)"),
    _("How far feather, multiband and gradient reach; 0 is the usual width"),
    0.0,
    (0.0, 512.0),
    automatic=_("Usual width"),
    typical=16,
    applies=("blend", ("feather", "multiband", "gradient")),
)
_TONES = Option(
    name="match-tones",
    label=_("Match _tones first"),
    default=False,
    help=_(
        "Remove a step in exposure or white balance: each layer's copy gets a gain per channel so that the "
        "overlaps agree"
    ),
)
_SHADING = Option(
    name="match-shading",
    label=_("Match sh_ading too"),
    default=False,
    help=_(
        "Also remove that lenses darken towards their corners: each layer's copy gets a smooth field of gain"
    ),
    advanced=True,
)
_PLACES = Option(
    name="places",
    label=_("_Positions"),
    default="given",
    help=_(
        "Whether the copies move. Aligned, they go by up to 32 px to where their overlaps agree. Found out, "
        "they may lie anywhere, and be turned by up to 3° and scaled by up to 3 %; the canvas grows if need "
        "be. The lowest layer stays as it is"
    ),
    choices=(
        ("given", _("As the layers lie")),
        ("near", _("Align them (within 32 px)")),
        ("anywhere", _("Find out where they belong")),
    ),
)
_KEEP = Option(
    name="keep-layers",
    label=_("_Keep the selected layers, hidden"),
    default=True,
    engine=False,
    help=_(
        "Leave the layers you selected where they are, invisible; otherwise the stitched copies replace them"
    ),
)
_MERGE = Option(
    name="merge",
    label=_("Merge into one la_yer"),
    default=False,
    engine=False,
    help=_("Make one layer of the result instead of a group of layers with masks"),
)
_CORE = number(
    "core",
    _("Core that m_ust show"),
    _(
        "The share of the patch's depth, from its innermost point outwards, that the seam must leave to the "
        "patch"
    ),
    0.5,
    (0.05, 1.0),
)
_SHOW = Option(
    name="show-seam",
    label=_("Show the s_eam"),
    default=False,
    engine=False,
    help=_("Make the paths of the seams visible; they are in the Paths dialog in any case"),
)

SEAM_ENTRIES = (
    Procedure(
        name="plug-in-toposeam-stitch",
        label=_("_Stitch Layers..."),
        menu=LAYERS,
        work="seams.stitch_layers",
        needs="several",
        blurb=_("Join the selected layers where they overlap, along seams that nobody sees"),
        help=_(
            "Select two or more layers that overlap, or would: where they belong can be found out. A group "
            "appears with a copy of each layer under a layer mask, opaque and in Normal mode, and two paths "
            "per seam. If there is a selection, the seams stay within it. Bend a path with the path tool and "
            "use Re-stitch from Paths to apply it."
        ),
        options=(_BLEND, _WIDTH, _PLACES, _TONES, _SHOW, _MERGE, _KEEP, _SHADING, _METHOD, _LAW),
        returns=("group", "The group of stitched layers, or the merged layer"),
        preview="stitch",
    ),
    Procedure(
        name="plug-in-toposeam-restitch",
        label=_("_Re-stitch from Paths"),
        menu=LAYERS,
        work="seams.restitch",
        needs="layers",
        blurb=_("Apply the seams of a stitched group again after you have bent their paths"),
        help=_(
            "Select a group that Stitch Layers has made, a layer in it, or a patch. Its masks are made anew "
            "from its paths, or from the path that is selected in the Paths dialog: curves are followed, "
            "ends that stop short of the overlap's border are extended. What you have not bent gives exactly "
            "the seam that was found."
        ),
        returns=("group", "The group of stitched layers"),
    ),
    Procedure(
        name="plug-in-toposeam-patch",
        label=_("Stitch Selection as _Patch..."),
        menu=LAYERS,
        work="seams.patch_selection",
        blurb=_(
            "Lay the selected part of this layer on what is below it, within a closed seam that nobody sees"
        ),
        help=_(
            "Select generously round what you want to lay on the picture below: a face, a cloud, a cloned "
            "spot. The seam runs within the selection where the two pictures differ least. A floating "
            "selection, or without any selection the whole layer, is a patch too. The patch becomes a layer "
            "with a mask, and the seam a path; the layer it was cut from is hidden."
        ),
        options=(_BLEND, _WIDTH, _CORE, _SHOW, _METHOD, _LAW),
        returns=("patch", "The layer with the patch"),
        preview="patch",
    ),
)
