"""GI-free: what a menu entry is, and a field of its dialog."""

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
    #: Its type says what the option is: bool, int, float, one of `choices`; None a layer, mask or channel.
    default: bool | int | float | str | None
    low: float = 0
    high: float = 1
    #: Pairs of what scripts write and what people read.
    choices: tuple[tuple[str, str], ...] = ()
    #: Whether it goes to the engine unchanged; the others are for the plug-in.
    engine: bool = True
    #: What 0 stands for in scripts; people tick a box of this name, and get `typical` when they untick it.
    automatic: str | None = None
    typical: float = 1
    #: Another option, and the values of it with which this one means something; else it is insensitive.
    applies: tuple[str, tuple[bool | str, ...]] | None = None
    #: Whether it waits under “Advanced” until it is looked for.
    advanced: bool = False
    #: Of one that is a mask or a channel and may be none: what none is called.
    none: str = ""
    #: How the names of the files in ``pictures`` begin that show the choices; "" where words do.
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
    """Return a size in pixels, a count, or a share: whole where its default is; see :class:`Option`."""
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
    #: The submenu it is in.
    menu: str
    #: A blurb, with the words in brackets that people search for.
    blurb: str
    help: str
    #: Module of this package, and its function.
    work: str
    #: Its function that refuses what cannot work; the dialog shows why. "" where GIMP itself can tell.
    check: str = ""
    #: Another place in GIMP's menu, where people look for it.
    also: str = ""
    options: tuple[Option, ...] = ()
    #: When the entry can be used: "layer" when one is selected, "layers" for one or more, "several" for two
    #: or more, "nothing" always.
    needs: str = "layer"
    #: Name and blurb of the layer it returns.
    returns: tuple[str, str] = ("layer", "The new layer")
    #: The function of :mod:`toposeam_gimp.dialogs.scenes` that collects what its preview shows; None without
    #: one.
    preview: str | None = None

    @property
    def title(self) -> str:
        """The label without mnemonic and dots; Korean ones write it as “(_S)”."""
        return _plain(self.label).rstrip(".")


def _plain(label: str) -> str:
    return re.sub(r"\(_\w\)|_", "", label)
