"""GI-free: the menu entry for animations."""

from __future__ import annotations

from toposeam_gimp.entries.entry import LAYERS, Option, Procedure, number
from toposeam_gimp.texts import _

ANIMATION_ENTRIES = (
    Procedure(
        name="plug-in-toposeam-loop",
        label=_("_Loop Animation..."),
        menu=LAYERS,
        work="animation.loop",
        check="check_clip",
        also="<Image>/Filters/Animation",
        needs="layers",
        blurb=_(
            "Make the visible layers, as the frames of an animation, repeat without a jump (seamless loop)"
        ),
        help=_(
            "The lowest layer is the first frame. Where the clip comes back best is found, and its end goes "
            "over into its beginning along a surface in time and space, so that every pixel changes when it "
            "shows least. The result is a new image; delays in the layers' names are kept."
        ),
        options=(
            number(
                "length",
                _("_Frames"),
                _("How many frames the loop has; 0 finds out what fits best"),
                0,
                (0, 10000),
                automatic=_("What fits best"),
                typical=24,
            ),
            Option(
                name="level",
                label=_("Even out changes of li_ght"),
                help=_("Spread what the end is lighter or darker than the beginning over the whole loop"),
                default=False,
            ),
            number(
                "transition",
                _("_Transition (frames)"),
                _("In how many frames pixels change over; 0 is a quarter of the clip, 24 at most"),
                0,
                (0, 200),
                automatic=_("As the clip allows"),
                typical=8,
                advanced=True,
            ),
        ),
        returns=("layer", "The last frame"),
        preview="clip",
    ),
)
