"""GI-free: the classes of a menu entry and of a field of its dialog."""

from __future__ import annotations

import re
from dataclasses import dataclass

from toposeam_gimp.texts import _

#: The submenus. GIMP gives plug-ins no separators, and sorts submenus by their names, which keep this order.
LAYERS, TEXTURES, WALLPAPERS = _("_Layers"), _("_Textures"), _("_Wallpapers")


@dataclass(frozen=True, kw_only=True)
class Option:
    """A field of a dialog, an argument of a procedure."""

    name: str
    label: str
    help: str
    #: Its type is that of the option: bool, int, float, or str for one of `choices`; None for a drawable.
    default: bool | int | float | str | None
    low: float = 0
    high: float = 1
    #: Pairs of a value for scripts and its label.
    choices: tuple[tuple[str, str], ...] = ()
    #: Whether it is passed to the engine unchanged; the others are for the plug-in.
    engine: bool = True
    #: Meaning of 0, and label of the check box that sets it; unticked, it sets `typical`.
    automatic: str | None = None
    typical: float = 1
    #: Another option, and those of its values with which this one has an effect; else it is insensitive.
    applies: tuple[str, tuple[bool | str, ...]] | None = None
    #: Whether it is under “Advanced”.
    advanced: bool = False
    #: Whether it has no field, as it is set on the preview.
    hidden: bool = False
    #: Label of no mask or channel, for one that may be missing.
    none: str = ""
    #: Prefix of the names of the choices' pictures in ``pictures``; "" for choices without pictures.
    pictures: str = ""

    @property
    def title(self) -> str:
        """The label without mnemonic."""
        return _plain(self.label)


def number(
    name: str,
    label: str,
    about: str,
    default: float,
    within: tuple[float, float],
    *,
    automatic: str | None = None,
    typical: float = 1,
    applies: tuple[str, tuple[bool | str, ...]] | None = None,
    advanced: bool = False,
) -> Option:
    """Return an option for a size in pixels, a count or a share: an integer if its default is one; see
    :class:`Option`.
    """
    return Option(
        name=name,
        label=label,
        help=about,
        default=default,
        low=within[0],
        high=within[1],
        automatic=automatic,
        typical=typical,
        applies=applies,
        advanced=advanced,
    )


@dataclass(frozen=True, kw_only=True)
class Procedure:
    """A menu entry and its procedure."""

    name: str
    #: Menu entry, with its mnemonic.
    label: str
    #: Its submenu.
    menu: str
    #: A blurb, with words in brackets for which people search.
    blurb: str
    help: str
    #: Module of this package and its function that does the work.
    work: str
    #: The module's function that refuses what cannot work, with a reason for the dialog; "" if GIMP checks
    #: enough.
    check: str = ""
    #: Another place in GIMP's menu where people look for the entry.
    also: str = ""
    options: tuple[Option, ...] = ()
    #: Selection that the entry needs: "layer" for one layer, "layers" for one or more, "several" for two or
    #: more, "nothing" for none.
    needs: str = "layer"
    #: Name and blurb of the layer it returns.
    returns: tuple[str, str] = ("layer", "The new layer")
    #: The function of :mod:`toposeam_gimp.dialogs.scenes` that collects the pixels of its preview; None
    #: without a preview.
    preview: str | None = None

    #: Whether a window stays open afterwards, for who paints on the layer it returns.
    paints: bool = False

    @property
    def title(self) -> str:
        """The label without mnemonic and dots; Korean labels have the mnemonic as “(_S)”."""
        return _plain(self.label).rstrip(".")


def _plain(label: str) -> str:
    return re.sub(r"\(_\w\)|_", "", label)
