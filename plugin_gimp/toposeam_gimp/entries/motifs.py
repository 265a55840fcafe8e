"""GI-free: the menu entries that invent and repeat motifs."""

from __future__ import annotations

from toposeam_gimp.entries.entry import WALLPAPERS, Option, Procedure, number
from toposeam_gimp.entries.textures import SEED
from toposeam_gimp.texts import _

#: The rules that lay any motif side by side, and the wallpaper groups, as in core (a test compares them). The
#: text before the colon is the short name under a picture.
_RULES = (
    ("reflect", _("Reflection: every other copy mirrored")),
    ("translate", _("Translation: all copies alike")),
    ("rotate", _("Rotation: every other copy by half a turn")),
    ("drop", _("Half-drop: columns shifted by half")),
    ("brick", _("Brick: rows shifted by half")),
)
_GROUPS = (
    ("p1", _("p1: no symmetry")),
    ("p2", _("p2: half turns")),
    ("pm", _("pm: mirrors")),
    ("pg", _("pg: glides")),
    ("cm", _("cm: mirrors and glides")),
    ("pmm", _("pmm: mirrors both ways")),
    ("pmg", _("pmg: mirrors and half turns")),
    ("pgg", _("pgg: glides and half turns")),
    ("cmm", _("cmm: mirrors both ways, staggered")),
    ("p4", _("p4: quarter turns")),
    ("p4m", _("p4m: quarter turns and mirrors")),
    ("p4g", _("p4g: quarter turns and glides")),
    ("p3", _("p3: third turns")),
    ("p3m1", _("p3m1: third turns, all on mirrors")),
    ("p31m", _("p31m: third turns, some on mirrors")),
    ("p6", _("p6: sixth turns")),
    ("p6m", _("p6m: sixth turns and mirrors")),
)
_PALETTES = (
    ("spring", _("Spring")),
    ("summer", _("Summer")),
    ("fall", _("Fall")),
    ("winter", _("Winter")),
    ("indigo", _("Indigo")),
    ("sumi", _("Sumi")),
    ("terracotta", _("Terracotta")),
    ("botanic", _("Botanic")),
    ("sea", _("Sea")),
    ("plum", _("Plum")),
    ("saffron", _("Saffron")),
    ("night", _("Night")),
)

#: The styles, as in core (a test compares them).
_STYLES = (
    ("vein", _("Veins")),
    ("cutout", _("Cut paper")),
    ("chain", _("Chains")),
    ("seed", _("Seeds")),
    ("key", _("Maple keys")),
    ("batik", _("Batik")),
    ("leaf", _("Leaves")),
    ("rosette", _("Watercolour")),
    ("brush", _("Brush strokes")),
    ("folk", _("Folk ornament")),
    ("bone", _("Bones")),
    ("pebble", _("Pebbles")),
    ("fern", _("Ferns")),
    ("thread", _("Threads")),
    ("daisy", _("Flowers")),
    ("thesis", _("As in the thesis")),
)

MOTIF_ENTRIES = (
    Procedure(
        name="plug-in-toposeam-motif",
        label=_("_Generate Motif..."),
        menu=WALLPAPERS,
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
            number("size", _("Si_ze (px)"), _("Width and height of the motif"), 256, (32, 4096)),
            Option(
                name="style",
                label=_("Style of _motif"),
                help=_("The hand in which strokes are drawn"),
                default="random",
                choices=(("random", _("From the seed")), *_STYLES),
            ),
            Option(
                name="repeat",
                label=_("Repeats _by"),
                help=_("The rule by which copies of the motif join"),
                default="random",
                choices=(
                    ("random", _("From the seed")),
                    ("none", _("Nothing: it stays alone")),
                    *_RULES,
                    *_GROUPS,
                ),
                pictures="rule",
            ),
            number(
                "layers",
                _("_Inks"),
                _("Number of layers of ink; 0 leaves it to the style"),
                0,
                (0, 6),
                automatic=_("From the style"),
                typical=3,
            ),
            Option(
                name="palette",
                label=_("_Palette"),
                help=_("The colours of paper and inks"),
                default="random",
                choices=(("random", _("From the seed")), *_PALETTES),
                pictures="palette",
            ),
            number(
                "mass",
                _("In_k (share)"),
                _("How much of the paper each ink covers; 0 leaves it to the seed"),
                0.0,
                (0.0, 0.9),
                automatic=_("From the seed"),
                typical=0.25,
            ),
            Option(
                name="edge",
                label=_("Ho_w strokes end"),
                default="auto",
                choices=(
                    ("auto", _("As fits them")),
                    ("crisp", _("Crisp")),
                    ("ink", _("Crisp, shading inside")),
                    ("soft", _("Soft")),
                ),
                help=_(
                    "How strokes end on the paper; what fits is soft for ink wash, and crisp for the others"
                ),
            ),
            number(
                "penalty",
                _("Disti_nctness"),
                _(
                    "The penalty exponent p: 1 looks like ink wash, 3 gives distinct strokes; 0 leaves it to "
                    "the style"
                ),
                0.0,
                (0.0, 6.0),
                automatic=_("From the style"),
                typical=3,
                advanced=True,
            ),
            number(
                "iterations",
                _("I_terations"),
                _("Strokes become finer and more distinct with each; 0 leaves it to the style"),
                0,
                (0, 1000),
                automatic=_("From the style"),
                typical=40,
                advanced=True,
            ),
            SEED,
            Option(
                name="use-layer",
                label=_("Shape the strokes after this la_yer"),
                default=False,
                engine=False,
                help=_("Strokes keep to the bright parts of the selected layer, a logo or a photograph"),
            ),
            number(
                "base-strength",
                _("Stren_gth of its shape"),
                _("How strongly the layer shows; below 0 the strokes keep to its dark parts"),
                0.7,
                (-1.0, 1.0),
                applies=("use-layer", (True,)),
            ),
        ),
        returns=("layer", "The group of inks"),
        preview="motif",
    ),
    Procedure(
        name="plug-in-toposeam-repeat",
        label=_("Repeat _Motif..."),
        menu=WALLPAPERS,
        work="motifs.repeat",
        check="check_motif",
        needs="layers",
        blurb=_("Lay copies of a motif side by side by its own rule"),
        help=_(
            "Works on an image that Generate Motif has made, in the colours and with the masks that it "
            "has now, or in the colours of a palette. The result is a new image."
        ),
        options=(
            number("rows", _("Ro_ws"), _("Number of motifs from top to bottom"), 4, (1, 200)),
            number("columns", _("Colu_mns"), _("Number of motifs from left to right"), 4, (1, 200)),
            Option(
                name="repeat",
                label=_("Repeat _by"),
                help=_("The rule by which copies join; only by the motif's own do strokes run on everywhere"),
                default="own",
                choices=(("own", _("The motif's own rule")), *_RULES),
                pictures="rule",
            ),
            Option(
                name="palette",
                label=_("_Palette"),
                help=_("The colours of paper and inks"),
                default="own",
                choices=(("own", _("The colours it has")), *_PALETTES),
                pictures="palette",
            ),
        ),
        returns=("layer", "The group of inks"),
        preview="pattern",
    ),
)
