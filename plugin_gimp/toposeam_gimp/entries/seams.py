"""GI-free: the menu entries that join layers."""

from __future__ import annotations

from dataclasses import replace

from toposeam_gimp.entries.entry import LAYERS, Option, Procedure, number
from toposeam_gimp.texts import _

_METHOD = Option(
    name="method",
    label=_("_Method"),
    default="auto",
    help=_("How the seam is found; the first choice is exact and the fastest for the overlap"),
    choices=(
        ("auto", _("Automatic (exact and fastest)")),
        ("heat", _("Heat")),
        ("shortest-path", _("Shortest path (exact)")),
        ("dp", _("Dynamic programming (never turns back)")),
        ("graph-cut", _("Graph cut (needs PyMaxflow)")),
    ),
    advanced=True,
)
_LAW = Option(
    name="law",
    label=_("Seam avo_ids"),
    default="natural",
    help=_("What the seam must not cross; the first keeps people, posts and letters whole"),
    choices=(
        ("natural", _("What eyes notice")),
        ("gradient", _("Cutting across edges")),
        ("colour", _("Differences of colour")),
    ),
    advanced=True,
)
_BLEND = Option(
    name="blend",
    label=_("_Blend"),
    default="none",
    help=_("What happens across the seams; what it changes is put into a layer of its own above the others"),
    choices=(
        ("auto", _("Automatic")),
        ("none", _("No blending")),
        ("feather", _("Soft edge")),
        ("soft", _("Soft edge, wider where it does not show")),
        ("multiband", _("Seamless (multi-band)")),
        ("gradient", _("Seamless (colour too)")),
    ),
)
_WIDTH = number(
    "blend-width",
    _("Blend _width (px)"),
    _("How far blending reaches from the seam; 0 chooses a width by itself"),
    0.0,
    (0.0, 512.0),
    automatic=_("Automatic"),
    typical=16,
    applies=("blend", ("auto", "feather", "multiband", "gradient")),
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
    label=_("Correct vig_netting"),
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
        "Whether the copies move. The first choice joins the layers where they lie. Aligned, they go by up "
        "to 32 px to where their overlaps agree. Automatically aligned, they may lie anywhere, as files "
        "opened as layers do, and are turned and warped where needed; the canvas grows if need be"
    ),
    choices=(
        ("given", _("As the layers lie")),
        ("near", _("Align (within 32 px)")),
        ("anywhere", _("Align automatically (panorama)")),
    ),
)
_KEEP = Option(
    name="keep-layers",
    label=_("_Keep the original layers, hidden"),
    default=True,
    engine=False,
    help=_(
        "Leave the layers you selected where they are, invisible; otherwise the stitched copies replace them"
    ),
    advanced=True,
)
_MERGE = Option(
    name="merge",
    label=_("Mer_ge into one layer"),
    default=False,
    engine=False,
    help=_("Make one layer of the result instead of a group of layers with masks"),
    advanced=True,
)
_CORE = number(
    "core",
    _("Share that m_ust show"),
    _(
        "How much of the patch the seam must leave, from its middle outwards: 0.9 is nearly all of it, 0.05 "
        "hardly more than its middle. 0 leaves what stands out in it, as somebody on a square"
    ),
    0.0,
    (0.0, 1.0),
    automatic=_("What stands out"),
    typical=0.5,
)
_SHOW = Option(
    name="show-seam",
    label=_("Show the s_eam"),
    default=True,
    engine=False,
    help=_(
        "Make the paths of the seams visible, so that the path tool takes them; they are in the Paths dialog "
        "in any case"
    ),
)
_AVOID = Option(
    name="avoid",
    label=_("Keep awa_y from"),
    default=None,
    engine=False,
    none=_("Nothing"),
    help=_("A channel or a mask: where it is white, as on a face that shall stay whole, no seam runs"),
)
_PHOTOGRAPHS = ("pictures", ("photographs",))
_CAMERA = ("model", ("auto", "rotation"))

SEAM_ENTRIES = (
    Procedure(
        name="plug-in-toposeam-panorama",
        label=_("Pa_norama from Layers..."),
        menu=LAYERS,
        work="seams.panorama",
        check="check_layers",
        also="<Image>/Filters/Combine",
        needs="several",
        blurb=_(
            "Find out where overlapping photographs belong, warp them, even them out and join them "
            "(photomerge, auto-align and auto-blend layers, photo stitching)"
        ),
        help=_(
            "Open the photographs by File → Open as Layers, select them all in the Layers dialog, and "
            "choose this entry. They may lie anywhere and in any order. A group appears with a warped copy "
            "of each under a layer mask, and a path per seam; your layers stay, hidden. Photographs that "
            "show nothing that the others show are left out and named. What is left between the others is "
            "told: the seams go round it."
        ),
        options=(
            Option(
                name="pictures",
                label=_("_Pictures are"),
                default="photographs",
                help=_(
                    "Photographs are warped, evened out and blended; scans and screenshots are only moved, "
                    "turned by up to 3° and scaled by up to 3 %, exactly, and keep their pixels"
                ),
                choices=(("photographs", _("Photographs")), ("scans", _("Scans, exact"))),
            ),
            Option(
                name="crop",
                label=_("Tr_ansparent corners"),
                default="fit",
                help=_(
                    "Fit: the border is bent a little and slivers are filled, on a layer of their own, so "
                    "that most is kept. Crop: the canvas is the largest rectangle without holes. Layers keep "
                    "what lies beyond the canvas: Image → Fit Canvas to Layers shows it again"
                ),
                choices=(("fit", _("Fit")), ("crop", _("Crop")), ("keep", _("Keep"))),
            ),
            replace(_TONES, default=True, applies=_PHOTOGRAPHS),
            replace(_SHADING, default=True, applies=("match-tones", (True,)), advanced=False),
            replace(_BLEND, default="auto", applies=_PHOTOGRAPHS),
            _SHOW,
            Option(
                name="model",
                label=_("Laid out b_y"),
                default="auto",
                help=_(
                    "What brings the photographs together; the first choice takes the simplest that "
                    "explains them"
                ),
                choices=(
                    ("auto", _("Automatic")),
                    ("shift", _("Moving")),
                    ("similarity", _("Moving, turning and scaling")),
                    ("plane", _("Perspective of something flat")),
                    ("rotation", _("A camera that turned")),
                ),
                applies=_PHOTOGRAPHS,
                advanced=True,
            ),
            Option(
                name="projection",
                label=_("Pro_jection"),
                default="auto",
                help=_("How the panorama shows what a camera saw that turned; by its field of view"),
                choices=(
                    ("auto", _("Automatic")),
                    ("flat", _("Flat (straight lines stay straight)")),
                    ("cylinder", _("Cylinder (wide panoramas)")),
                    ("sphere", _("Sphere (also far up and down)")),
                    ("panini", _("Panini (wide rooms)")),
                ),
                applies=_CAMERA,
                advanced=True,
            ),
            Option(
                name="level",
                label=_("Level the hori_zon"),
                default=True,
                help=_("Lay the horizon level; otherwise the photograph in the middle stays upright"),
                applies=_PHOTOGRAPHS,
                advanced=True,
            ),
            _LAW,
            replace(_WIDTH, advanced=True),
            _MERGE,
            _KEEP,
        ),
        returns=("group", "The group of stitched layers, or the merged layer"),
        preview="panorama",
    ),
    Procedure(
        name="plug-in-toposeam-stitch",
        label=_("_Stitch Layers..."),
        menu=LAYERS,
        work="seams.stitch_layers",
        check="check_layers",
        needs="several",
        blurb=_(
            "Join the selected layers where they overlap, along seams that nobody sees (auto-blend layers)"
        ),
        help=_(
            "Select two or more layers that overlap. A group appears with a copy of each layer, opaque and "
            "in Normal mode, under layer masks that only hide where a lower layer is to be seen, and a "
            "path per seam. If there is a selection, the seams stay within it. Bend a path with the path "
            "tool, paint on a mask, or paint seam hints, and choose Re-stitch. For photographs that do not "
            "lie where they belong, choose Panorama from Layers."
        ),
        options=(_PLACES, _BLEND, _WIDTH, _TONES, _AVOID, _SHOW, _MERGE, _KEEP, _SHADING, _METHOD, _LAW),
        returns=("group", "The group of stitched layers, or the merged layer"),
        preview="stitch",
    ),
    Procedure(
        name="plug-in-toposeam-hints",
        label=_("Paint Seam _Hints"),
        menu=LAYERS,
        work="painting.paint_hints",
        needs="layers",
        blurb=_(
            "Get a layer to paint on which layer of a panorama or stitched group shall show where: a face "
            "from one photograph, the rest from another"
        ),
        help=_(
            "Select a layer in a group that Panorama from Layers or Stitch Layers has made. The layer "
            "“Seam hints” appears above the group, and the foreground colour is the one of the selected "
            "layer, like its tag in the Layers dialog. Paint roughly what shall be seen of that layer, "
            "with any paint tool, and choose Re-stitch: the seam finds itself round the strokes. Erase "
            "strokes that shall no longer count. Several layers that are not stitched yet are stitched "
            "first, and a selected part of one layer is laid on what is below it."
        ),
        returns=("hints", "The layer to paint on"),
        paints=True,
    ),
    Procedure(
        name="plug-in-toposeam-restitch",
        label=_("_Re-stitch"),
        menu=LAYERS,
        work="restitching.restitch",
        needs="layers",
        blurb=_(
            "Let the seams of a panorama, stitched group or patch follow bent paths, seam hints, and what "
            "was painted on masks"
        ),
        help=_(
            "Select a group that Panorama from Layers or Stitch Layers has made, a layer in it, its seam "
            "hints, or a patch. Curves that you have bent are followed; ends that stop short of the "
            "overlap's border are extended. Round what you have painted on “Seam hints” or on a mask, the "
            "seam is found anew; elsewhere it stays. A path that is selected in the Paths dialog counts "
            "before the group's own."
        ),
        returns=("group", "The group of stitched layers"),
    ),
    Procedure(
        name="plug-in-toposeam-patch",
        label=_("Stitch Selection as _Patch..."),
        menu=LAYERS,
        work="patches.patch_selection",
        blurb=_(
            "Lay the selected part of this layer on what is below it, within a closed seam that nobody sees "
            "(clone, swap a face or a sky)"
        ),
        help=_(
            "Select generously round what you want to lay on the picture below: a face, a cloud, a cloned "
            "spot. The seam runs within the selection where the two pictures differ least. A floating "
            "selection, or without any selection the whole layer, is a patch too. The patch becomes a layer "
            "with a mask, and the seam a path; the layer it was cut from is hidden."
        ),
        options=(replace(_BLEND, default="multiband"), _WIDTH, _CORE, _AVOID, _SHOW, _METHOD, _LAW),
        returns=("patch", "The layer with the patch"),
        preview="patch",
    ),
)
