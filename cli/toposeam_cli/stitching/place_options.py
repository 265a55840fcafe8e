"""Options that say how places are found, and what follows for photographs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click

import toposeam as ts
from toposeam.layers.canvas.transforms import PROJECTIONS, CameraTransform, PlaneTransform, Transform
from toposeam.layers.registration.find_places import PlaceOptions
from toposeam.layers.registration.placement import MODELS
from toposeam_cli.app.options import FiniteRange
from toposeam_cli.stitching.inputs import PlaceFinding
from toposeam_cli.stitching.outputs import Outputs
from toposeam_cli.stitching.search_options import SeamOptions

KINDS = ("photographs", "scans")


def finding_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Return the options that say how places are found."""
    options = (
        click.option(
            "--model",
            type=click.Choice(("auto", *MODELS)),
            default="auto",
            show_default=True,
            help="What brings pictures together: moves; turns and scales, too; the perspective of one plane; "
            "a camera that turns. auto takes the poorest that explains them.",
        ),
        click.option(
            "--exact", is_flag=True, help="Refuse what moves, turns and scales do not place exactly."
        ),
        click.option(
            "--focal",
            type=FiniteRange(0, min_open=True),
            metavar="MM",
            help="Focal length of the camera, as of film of 24 x 36 mm; found by default.",
        ),
        click.option(
            "--lens",
            type=FiniteRange(-0.5, 0.5),
            metavar="B",
            help="Radial distortion of the lens, Hugin's b; found by default, 0 for none.",
        ),
        click.option(
            "--projection",
            type=click.Choice(("auto", *PROJECTIONS)),
            default="auto",
            show_default=True,
            help="How the joined picture shows what a camera saw; by its field of view.",
        ),
        click.option("--level/--no-level", default=True, help="Lay the horizon level, the default."),
        click.option("--centre", metavar="PICTURE", help="The picture in the middle: its number or name."),
        click.option(
            "--as",
            "kind",
            type=click.Choice(KINDS),
            help="photographs: match shading, blend in bands, crop to what has no holes, the default where "
            "pictures were warped; scans: nothing of it, the default elsewhere.",
        ),
    )
    for option in reversed(options):
        command = option(command)
    return command


@dataclass(frozen=True, slots=True, kw_only=True)
class FindingOptions:
    """How places are found, as given."""

    model: str
    exact: bool
    focal: float | None
    lens: float | None
    projection: str
    level: bool
    centre: str | None
    kind: str | None

    def of(self, files: Sequence[Path]) -> PlaceFinding:
        """Return what they mean for some files.

        Raises
        ------
        OptionError
            When they mean nothing together, or no file is called as the one in the middle.
        """
        if self.exact and self.model in ("plane", "rotation"):
            raise ts.OptionError(
                f"--exact is for moves, turns and scales, not for --model {self.model}; leave one of them out"
            )
        of_cameras = {
            "--focal": self.focal is not None,
            "--lens": self.lens is not None,
            "--projection": self.projection != "auto",
            "--no-level": not self.level,
            "--centre": self.centre is not None,
        }
        asked = [name for name, given in of_cameras.items() if given]
        if asked and (self.exact or self.model not in ("auto", "rotation")):
            other = "--exact" if self.exact else f"--model {self.model}"
            raise ts.OptionError(
                f"{asked[0]} is for a camera that turns, not for {other}; leave one of them out"
            )
        if self.exact:
            asked.append("--exact")
        if self.model != "auto":
            asked.append("--model")
        centre = None
        if self.centre is not None:
            names = [path.name for path in files]
            named = self.centre.isdecimal() and int(self.centre) < len(files)
            if self.centre not in names and not named:
                raise ts.OptionError(
                    f"--centre {self.centre} is none of the pictures; give a number from 0 to "
                    f"{len(files) - 1}, or a name, like {names[0]}"
                )
            centre = names.index(self.centre) if self.centre in names else int(self.centre)
        options = PlaceOptions(
            model=self.model,
            exact=self.exact,
            lens=self.lens,
            projection=self.projection,
            level=self.level,
            centre=centre,
        )
        return PlaceFinding(options=options, focal_mm=self.focal, named=tuple(asked))


def is_perspective(transform: Transform) -> bool:
    """Test whether a transform is more than a move, a turn and a scale."""
    if isinstance(transform, CameraTransform):
        return True
    return isinstance(transform, PlaneTransform) and bool(transform.matrix[2, :2].any())


def with_defaults(
    find: SeamOptions, out: Outputs, transforms: Sequence[Transform], kind: str | None
) -> tuple[SeamOptions, Outputs]:
    """Return the options with the defaults for photographs or for scans where nothing is given."""
    photographs = kind == "photographs" or (kind is None and any(map(is_perspective, transforms)))
    tones, shading = find.match_tones, find.match_shading
    if tones is None and shading is None:
        shading = photographs
    find = replace(
        find,
        match_tones=bool(tones),
        match_shading=bool(shading),
        blend=find.blend or ("multiband" if photographs else "none"),
    )
    if photographs and out.crop is None and out.background is None and out.output.suffix.lower() != ".ora":
        out = replace(out, crop="inside")
    return find, out
