"""GI-free: one call of a procedure, the argument of the functions in ``actions``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from toposeam_gimp.engine import process
from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.entries.entry import Procedure
from toposeam_gimp.texts import _

#: What the engine does next.
_STEPS = {
    "places": _("Finding where the layers belong …"),
    "seams": _("Finding the seams …"),
    "blending": _("Blending …"),
}


class GoneError(Exception):
    """The image or a layer was deleted meanwhile; the text says so."""


def check_there(image: Any, drawables: Sequence[Any]) -> None:
    """Refuse an image or layers that were deleted.

    Raises
    ------
    GoneError
    """
    if any(not item.is_valid() for item in (image, *drawables) if item is not None):
        raise GoneError(
            _("The image was closed, or a layer deleted, while TopoSeam worked on it; nothing was done.")
        )


@dataclass(frozen=True, kw_only=True)
class Call:
    """A request of the user or of a script."""

    #: The image and its selected drawables; None and empty for procedures that need no image.
    image: Any
    drawables: Sequence[Any]
    #: Values of the options, by their names in the table.
    options: Mapping[str, Any]
    entry: Procedure
    #: Whether GIMP has a display, on which new images are shown.
    interactive: bool
    #: Remarks about the result, shown in the interface.
    remarks: list[str] = field(default_factory=list)
    #: GIMP's progress bar.
    show_progress: Callable[[float], object] = lambda _share: None
    #: The text of that bar.
    show_step: Callable[[str], object] = lambda _text: None

    def ask(self, folder: RequestFolder, request: Mapping[str, Any]) -> dict[str, Any]:
        """Let the engine work on a request; return its answer, if the image still exists.

        Raises
        ------
        EngineError, GoneError
        """
        answer = process.ask(
            folder, request, self.progress, step=lambda name: self.show_step(_STEPS.get(name, ""))
        )
        self.check_image()
        return answer

    def progress(self, share: float) -> None:
        """Show the share of the work done, if the image still exists."""
        self.check_image()
        self.show_progress(share)

    def check_image(self) -> None:
        """Refuse to go on if the image or a selected layer was deleted.

        Raises
        ------
        GoneError
        """
        check_there(self.image, self.drawables)

    def tell(self, remark: str) -> None:
        """Add a remark."""
        self.remarks.append(remark)

    @property
    def for_engine(self) -> dict[str, Any]:
        """The options for the engine, by the names of its keywords."""
        return renamed(
            {option.name: self.options[option.name] for option in self.entry.options if option.engine}
        )


def renamed(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options by the names of Python's keywords."""
    return {name.replace("-", "_"): value for name, value in options.items()}
