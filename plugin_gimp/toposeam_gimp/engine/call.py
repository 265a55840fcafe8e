"""GI-free: one call of a procedure, as the functions that do the work get it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from toposeam_gimp.engine import process
from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.entries.entry import Procedure
from toposeam_gimp.texts import _


class GoneError(Exception):
    """What is worked on is gone; the text says so."""


def check_there(image: Any, drawables: Sequence[Any]) -> None:
    """Refuse an image or layers that are gone.

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
    """Request of the user or of a script."""

    #: The image and its selected drawables; None and nothing where a procedure needs no image.
    image: Any
    drawables: Sequence[Any]
    #: By the names in the table.
    options: Mapping[str, Any]
    entry: Procedure
    #: Whether a display is open: new images are shown then.
    interactive: bool
    #: What people should know about the result; shown in the interface.
    remarks: list[str] = field(default_factory=list)
    #: GIMP's progress bar.
    show_progress: Callable[[float], object] = lambda _share: None

    def ask(self, folder: RequestFolder, request: Mapping[str, Any]) -> dict[str, Any]:
        """Let the engine work on a request; return its answer, if the image is still there.

        Raises
        ------
        EngineError, GoneError
        """
        answer = process.ask(folder, request, self.progress)
        self.check_image()
        return answer

    def progress(self, share: float) -> None:
        """Show the share of the work done, if the image is still there."""
        self.check_image()
        self.show_progress(share)

    def check_image(self) -> None:
        """Stop where the image, or a layer that was selected, is gone.

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
        """The options that go to the engine, by the names of its keywords."""
        return renamed(
            {option.name: self.options[option.name] for option in self.entry.options if option.engine}
        )


def renamed(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options by the names of Python's keywords."""
    return {name.replace("-", "_"): value for name, value in options.items()}
