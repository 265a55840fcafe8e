"""GI-free: the menu entries that grow textures."""

from __future__ import annotations

from toposeam_gimp.entries.entry import TEXTURES, Option, Procedure, number
from toposeam_gimp.texts import _

SEED = number(
    "seed",
    _("S_eed"),
    _("The same seed gives the same picture; another one, another picture"),
    0,
    (0, 2_147_483_647),
)
_PATCH = number(
    "patch",
    _("_Patch (px)"),
    _("Side of the patches that are laid; larger than the elements of the texture. 0 measures the texture"),
    0,
    (0, 1024),
    automatic=_("By the texture's scale"),
    typical=40,
    applies=("setting", ("auto",)),
)
_OVERLAP = number(
    "overlap",
    _("Overl_ap (px)"),
    _("How far neighbouring patches overlap; the seams run there. 0 is a quarter of the patch"),
    0,
    (0, 512),
    automatic=_("A quarter of the patch"),
    typical=10,
    advanced=True,
)
_BORDERS = (("both", _("On both axes")), ("x", _("Left and right")), ("y", _("Top and bottom")))

TEXTURE_ENTRIES = (
    Procedure(
        name="plug-in-toposeam-synthesize",
        label=_("S_ynthesize Texture..."),
        menu=TEXTURES,
        work="textures.synthesize",
        blurb=_("Grow a texture or pattern of any size from this layer, or from the selected part of it"),
        help=_(
            "Patches of the layer are laid where they fit best and cut along the best seams. With a "
            "selection, only what is selected is copied; it need not be a rectangle."
        ),
        options=(
            number("width", _("_Width (px)"), _("Width of the texture"), 512, (16, 65536)),
            number("height", _("He_ight (px)"), _("Height of the texture"), 512, (16, 65536)),
            Option(
                name="tileable",
                label=_("_Tileable"),
                help=_("Whether the texture continues at its opposite border"),
                default="none",
                choices=(("none", _("No")), *_BORDERS),
            ),
            Option(
                name="setting",
                label=_("Settin_g"),
                help=_(
                    "How large patches are and which are taken. By default small textures are tried and the "
                    "best one's setting is used, unless the patch is given"
                ),
                default="auto",
                choices=(
                    ("auto", _("The best of small trials")),
                    ("coarse", _("Large patches that fit best")),
                    ("coarse-mixed", _("Large patches, mixed")),
                    ("fine", _("Small patches that fit best")),
                    ("fine-mixed", _("Small patches, mixed")),
                    ("varied", _("Small patches, varied")),
                ),
            ),
            _PATCH,
            SEED,
            Option(
                name="destination",
                label=_("I_nto"),
                help=_("Where the texture goes"),
                default="image",
                engine=False,
                choices=(("image", _("A new image")), ("layer", _("A new layer"))),
            ),
            _OVERLAP,
        ),
        preview="sample",
    ),
    Procedure(
        name="plug-in-toposeam-tile",
        label=_("Make Seamless _Tile..."),
        menu=TEXTURES,
        work="textures.make_tileable",
        check="check_tile",
        also="<Image>/Filters/Map",
        blurb=_(
            "Make this layer, or the selected rectangle of it, repeat without a visible border (seamless "
            "pattern)"
        ),
        help=_(
            "Only a band along the borders changes: patches of the picture itself are laid over them and cut "
            "along the best seams. The result is a new layer. A selection must be a rectangle."
        ),
        options=(
            Option(
                name="tileable",
                label=_("Re_peat"),
                help=_("Which borders are to match"),
                default="both",
                choices=_BORDERS,
            ),
            number(
                "band",
                _("_Band (px)"),
                _("How much along each border may change; 0 is an eighth of the shorter side"),
                0,
                (0, 4096),
                automatic=_("An eighth of the shorter side"),
                typical=32,
            ),
            SEED,
        ),
        preview="tile",
    ),
    Procedure(
        name="plug-in-toposeam-fill",
        label=_("_Heal Selection..."),
        menu=TEXTURES,
        work="textures.fill",
        check="check_fill",
        also="<Image>/Filters/Enhance",
        blurb=_(
            "Replace what is selected by what the rest of this layer, or another one, is like (fill "
            "selection, remove object, content-aware fill, inpaint)"
        ),
        help=_(
            "The hole is filled from outside inwards with patches of the layer, cut along the best "
            "seams, which may run through a band round the selection. The result is a new layer that covers "
            "what was selected."
        ),
        options=(
            Option(
                name="from",
                label=_("Copy _from"),
                help=_("What may be copied into the hole"),
                default="layer",
                choices=(
                    ("layer", _("The whole layer")),
                    ("around", _("Around the selection")),
                    ("other", _("Another layer, a mask or a channel")),
                ),
            ),
            Option(
                name="source",
                label=_("So_urce"),
                help=_(
                    "Another layer of this image, which is copied from; or a mask or channel: where that is "
                    "white, this layer may be copied"
                ),
                default=None,
                engine=False,
                applies=("from", ("other",)),
            ),
            Option(
                name="only",
                label=_("Copy only from"),
                help=_(
                    "Where alone may be copied from: discs as x,y,radius in pixels of the image, with ; "
                    "between them; empty for everywhere"
                ),
                default="",
                hidden=True,
            ),
            number(
                "patch",
                _("_Patch (px)"),
                _PATCH.help,
                0,
                (0, 1024),
                automatic=_("By the picture's scale"),
                typical=40,
            ),
            SEED,
            _OVERLAP,
            number(
                "band",
                _("_Band (px)"),
                _("Width of the band round the selection that may change as well; 0 is the overlap"),
                0,
                (0, 1024),
                automatic=_("As wide as the overlap"),
                typical=10,
                advanced=True,
            ),
        ),
        preview="hole",
    ),
)
