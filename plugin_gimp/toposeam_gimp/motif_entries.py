"""GI-free: the menu entries that invent and repeat motifs."""

from __future__ import annotations

from toposeam_gimp.entries import Option, Procedure
from toposeam_gimp.texts import _
from toposeam_gimp.texture_entries import SEED

#: Wallpaper groups, and palettes; the same as core's (a test compares them).
_GROUPS = (
    "p1",
    "p2",
    "pm",
    "pg",
    "cm",
    "pmm",
    "pmg",
    "pgg",
    "cmm",
    "p4",
    "p4m",
    "p4g",
    "p3",
    "p3m1",
    "p31m",
    "p6",
    "p6m",
)
_PALETTES = (
    "spring",
    "summer",
    "fall",
    "winter",
    "indigo",
    "sumi",
    "terracotta",
    "botanic",
    "sea",
    "plum",
    "saffron",
    "night",
)

MOTIF_ENTRIES = (
    Procedure(
        name="plug-in-toposeam-motif",
        label=_("_Generate Motif..."),
        work="motifs.generate",
        needs="nothing",
        blurb=_(
            "Invent a motif that repeats: layers of ink, each drawn by heat on its way from sources to sinks"
        ),
        help=_(
            "A new image appears with a layer of paper and one layer per ink in Multiply mode; the masks "
            "are the strokes. Fill a layer with another colour and the motif follows. Repeat Motif makes "
            "a pattern of it."
        ),
        options=(
            Option(
                name="size",
                label=_("Si_ze (px)"),
                help=_("Width and height of the motif"),
                default=256,
                low=32,
                high=4096,
            ),
            Option(
                name="repeat",
                label=_("Repeats _by"),
                help=_("The rule by which copies of the motif join"),
                default="translate",
                choices=(
                    ("none", _("Nothing")),
                    ("reflect", _("Reflection")),
                    ("translate", _("Translation")),
                    ("rotate", _("Half turns")),
                    ("drop", _("Half-drop (columns shifted by half)")),
                    ("brick", _("Brick (rows shifted by half)")),
                    *((group, group) for group in _GROUPS),
                ),
            ),
            Option(
                name="layers",
                label=_("_Inks"),
                help=_("Number of layers of ink"),
                default=3,
                low=1,
                high=6,
            ),
            Option(
                name="palette",
                label=_("_Palette"),
                help=_("The colours of paper and inks"),
                default="random",
                choices=(
                    ("random", _("From the seed")),
                    *((name, name.capitalize()) for name in _PALETTES),
                ),
            ),
            Option(
                name="mass",
                label=_("In_k (share)"),
                help=_("How much of the paper each ink covers; 0 leaves it to the seed"),
                default=0.0,
                low=0.0,
                high=0.9,
                automatic=_("From the seed"),
                typical=0.25,
            ),
            Option(
                name="penalty",
                label=_("Disti_nctness"),
                advanced=True,
                default=3.0,
                low=1.0,
                high=6.0,
                help=_("The penalty exponent p: 1 looks like ink wash, 3 gives distinct strokes"),
            ),
            Option(
                name="iterations",
                label=_("I_terations"),
                advanced=True,
                help=_("Strokes become finer and more distinct with each"),
                default=40,
                low=1,
                high=1000,
            ),
            SEED,
            Option(
                name="use-layer",
                label=_("Shape the strokes after this la_yer"),
                default=False,
                engine=False,
                help=_("Strokes keep to the bright parts of the selected layer, a logo or a photograph"),
            ),
            Option(
                name="base-strength",
                label=_("Stren_gth of its shape"),
                applies=("use-layer", (True,)),
                default=0.7,
                low=-1.0,
                high=1.0,
                help=_("How strongly the layer shows; below 0 the strokes keep to its dark parts"),
            ),
        ),
        returns=("layer", "The group of inks"),
        preview="motif",
    ),
    Procedure(
        name="plug-in-toposeam-repeat",
        label=_("Repeat _Motif..."),
        work="motifs.repeat",
        needs="layers",
        blurb=_("Lay copies of a motif side by side by its own rule"),
        help=_(
            "Works on an image that Generate Motif has made, in the colours and with the masks that it "
            "has now. The result is a new image."
        ),
        options=(
            Option(
                name="rows",
                label=_("Ro_ws"),
                help=_("Number of motifs from top to bottom"),
                default=4,
                low=1,
                high=200,
            ),
            Option(
                name="columns",
                label=_("Colu_mns"),
                help=_("Number of motifs from left to right"),
                default=4,
                low=1,
                high=200,
            ),
        ),
        returns=("layer", "The group of inks"),
    ),
)
