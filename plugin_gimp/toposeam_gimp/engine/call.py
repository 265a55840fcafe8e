"""GI-free: one call of a procedure, as the functions that do the work get it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from toposeam_gimp.entries.entry import Procedure


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
