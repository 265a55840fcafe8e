"""Options of finding places, and the defaults that follow for photographs."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import toposeam as ts
from toposeam.typing import MODELS, PROJECTIONS
from toposeam_cli.app.command import option
from toposeam_cli.app.options import FILE, FiniteRange
from toposeam_cli.files.tables import read_text

if TYPE_CHECKING:
    import numpy as np

    from toposeam.layers.canvas.transforms import Transform
    from toposeam_cli.stitching.inputs import Horizon, PlaceFinding
    from toposeam_cli.stitching.outputs import Outputs
    from toposeam_cli.stitching.search_options import SeamOptions

KINDS = ("photographs", "scans")


def _horizon(context: click.Context, parameter: click.Parameter, text: str | None) -> Horizon | None:
    """Parse ``PICTURE=X,Y,X,Y``: two points of a picture."""
    if text is None:
        return None
    picture, _, points = text.rpartition("=")
    try:
        x, y, u, v = map(float, points.split(","))
    except ValueError:
        x = y = u = v = math.nan
    if not picture or not all(abs(one) < 1e9 for one in (x, y, u, v)):
        raise click.BadParameter(
            f"{text!r} is no line of a picture; write its number or name, and two points of it, like "
            "0=12,340,980,352"
        )
    return picture, ((x, y), (u, v))


def finding_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of finding places."""
    options = (
        option(
            "--model",
            heading="Finding places",
            type=click.Choice(("auto", *MODELS)),
            default="auto",
            show_default=True,
            help="How pictures may be placed: moved; also turned and scaled; by the perspective of one "
            "plane; by a camera that turns. auto takes the simplest that explains them.",
        ),
        option(
            "--exact",
            heading="Finding places",
            is_flag=True,
            help="Refuse what moves, turns and scales do not place exactly.",
        ),
        option(
            "--focal",
            heading="Finding places",
            type=FiniteRange(0, min_open=True),
            metavar="MM",
            help="Focal length of the camera, as of film of 24 x 36 mm; found by default.",
        ),
        option(
            "--lens",
            heading="Finding places",
            type=FiniteRange(-0.5, 0.5),
            metavar="B",
            help="Radial distortion of the lens, Hugin's b; found by default, 0 for none.",
        ),
        option(
            "--projection",
            heading="Finding places",
            type=click.Choice(("auto", *PROJECTIONS)),
            default="auto",
            show_default=True,
            help="How the joined picture shows what a camera saw; by its field of view.",
        ),
        option(
            "--level/--no-level",
            heading="Finding places",
            default=True,
            help="Level the horizon, the default.",
        ),
        option(
            "--centre",
            heading="Finding places",
            metavar="PICTURE",
            help="The picture in the middle: its number or name.",
        ),
        option(
            "--fov",
            heading="Finding places",
            type=FiniteRange(0, 360, min_open=True),
            metavar="DEGREES",
            help="Show at most this many degrees across of what a camera saw; all by default.",
        ),
        option(
            "--horizon",
            heading="Finding places",
            metavar="PICTURE=X,Y,X,Y",
            callback=_horizon,
            help="Two points of a picture (its number or name): the line between them comes to lie level, or "
            "upright if it is nearer to that.",
        ),
        option(
            "--straighten",
            heading="Finding places",
            is_flag=True,
            help="Turn scans until lines of text, rules and edges of paper lie level and upright.",
        ),
        option(
            "--points",
            heading="Finding places",
            type=FILE,
            help="Points that two pictures share, where nothing is found: a .csv of lines picture, x, y, "
            "picture, x, y; at least four for a pair.",
        ),
        option(
            "--groups/--one",
            heading="Finding places",
            default=None,
            help="Also join pictures that show something else, into OUTPUT-2, OUTPUT-3, ..., the default "
            "where no option names pictures; or join only the largest group.",
        ),
        option(
            "--as",
            "kind",
            heading="Finding places",
            kept=True,
            type=click.Choice(KINDS),
            help="photographs: match shading, blend in bands, fit to a rectangle, the default where "
            "pictures were warped; scans: none of that, the default elsewhere and with --exact.",
        ),
    )
    for each in reversed(options):
        command = each(command)
    return command


@dataclass(frozen=True, slots=True, kw_only=True)
class FindingOptions:
    """The options of finding places, as given."""

    model: str
    exact: bool
    focal: float | None
    lens: float | None
    projection: str
    level: bool
    centre: str | None
    fov: float | None
    horizon: Horizon | None
    straighten: bool
    points: Path | None
    groups: bool | None
    kind: str | None

    @property
    def is_plane(self) -> bool:
        """Whether pictures are asked to lie on one plane, as no turning camera takes them."""
        return self.exact or self.model in ("shift", "similarity", "plane")

    def with_groups(self, named: Sequence[str]) -> FindingOptions:
        """Join one group only where options, `named`, name pictures of it.

        Raises
        ------
        OptionError
            If both are asked for.
        """
        if self.groups and named:
            raise ts.OptionError(f"{named[0]} names pictures of one group; leave it or --groups out")
        return replace(self, groups=False) if named else self

    def without_names(self, files: Sequence[Path], members: Sequence[Path]) -> FindingOptions:
        """Return the options for a part of the files, without references to others."""

        def among(name: str, said: str) -> str | None:
            named = files[_number(files, name, said)]
            return str(members.index(named)) if named in members else None

        centre = None if self.centre is None else among(self.centre, "--centre")
        horizon = self.horizon
        if horizon is not None:
            picture = among(horizon[0], "--horizon")
            horizon = None if picture is None else (picture, horizon[1])
        return replace(self, centre=centre, horizon=horizon, points=None)

    def of(self, files: Sequence[Path]) -> PlaceFinding:
        """Check the options and translate them for some files.

        Raises
        ------
        OptionError
            If they conflict, or the central picture is not one of the files.
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
            "--fov": self.fov is not None,
        }
        given = [name for name, is_given in of_cameras.items() if is_given]
        if given and (self.exact or self.model not in ("auto", "rotation")):
            other = "--exact" if self.exact else f"--model {self.model}"
            raise ts.OptionError(
                f"{given[0]} is for a camera that turns, not for {other}; leave one of them out"
            )
        if self.straighten and (given or self.model == "rotation"):
            other = given[0] if given else "--model rotation"
            raise ts.OptionError(f"--straighten is for scans, not for {other}; leave one of them out")
        if self.straighten and self.horizon is not None:
            raise ts.OptionError("--straighten and --horizon both turn the picture; leave one of them out")
        if self.exact:
            given.append("--exact")
        if self.model != "auto":
            given.append("--model")
        given += [
            f"--{name}" for name in ("horizon", "straighten", "points", "groups") if getattr(self, name)
        ]
        from toposeam.layers.registration.find_places import PlaceOptions
        from toposeam_cli.stitching.inputs import PlaceFinding

        centre = None if self.centre is None else _number(files, self.centre, f"--centre {self.centre}")
        options = PlaceOptions(
            model=self.model,
            exact=self.exact,
            lens=self.lens,
            projection=self.projection,
            level=self.level,
            centre=centre,
            fov=self.fov,
            straighten=self.straighten,
            points={} if self.points is None else _read_points(self.points, files),
        )
        return PlaceFinding(
            options=options,
            focal_mm=self.focal,
            horizon=self.horizon,
            named=tuple(given),
            takes_groups=self.groups is not False,
        )


def _number(files: Sequence[Path], name: str, said: str) -> int:
    """Find a picture by its name or number."""
    from toposeam_cli.stitching.inputs import picture_number

    number = picture_number(name, {index: path.name for index, path in enumerate(files)}, len(files))
    if number is not None:
        return number
    raise ts.OptionError(
        f"{said} is none of the pictures; give a number from 0 to {len(files) - 1}, or a name, like "
        f"{files[0].name}"
    )


def _read_points(path: Path, files: Sequence[Path]) -> dict[tuple[int, int], np.ndarray]:
    """Read the points that pairs of pictures have in common."""
    import numpy as np

    text = read_text(path, "a table of points")
    points: dict[tuple[int, int], list[list[float]]] = {}
    try:
        for number, row in enumerate(csv.reader(io.StringIO(text, newline=""), skipinitialspace=True), 1):
            if not row or row[0].startswith("#"):
                continue
            line = f"'{path}', line {number}"
            try:
                first, x, y, second, u, v = row
                numbers = [float(value) for value in (x, y, u, v)]
            except ValueError as error:
                raise ts.OptionError(
                    f"{line} is not picture, x, y, picture, x, y, like {files[0].name},812,340,"
                    f"{files[-1].name},15.5,352"
                ) from error
            pair = _number(files, first, f"{line}: {first}"), _number(files, second, f"{line}: {second}")
            if pair[0] > pair[1]:
                pair, numbers = pair[::-1], numbers[2:] + numbers[:2]
            points.setdefault(pair, []).append(numbers)
    except csv.Error as error:
        raise ts.OptionError(f"'{path}' is no table of points; write lines of text (.csv)") from error
    return {pair: np.array(found) for pair, found in points.items()}


def _is_similarity(transform: Transform) -> bool:
    """Test whether a transform is a translation, rotation and scaling."""
    from toposeam.layers.canvas.transforms import PlaneTransform

    return isinstance(transform, PlaneTransform) and not transform.matrix[2, :2].any()


def kind_of(transforms: Sequence[Transform], finding: FindingOptions, *, found: bool) -> str:
    """Tell photographs from scans, unless somebody said it; places may have been `found` or given."""
    if finding.kind is not None:
        return finding.kind
    from toposeam.layers.canvas.transforms import is_move

    moved_only = found and not (finding.exact or finding.straighten)
    return KINDS[all(map(is_move if moved_only else _is_similarity, transforms))]


def is_fitted(transforms: Sequence[Transform], finding: FindingOptions, out: Outputs, *, found: bool) -> bool:
    """Test whether the boundary of a canvas is bent towards a rectangle."""
    return _crop(out, kind_of(transforms, finding, found=found)) == "fit"


def _crop(out: Outputs, kind: str) -> str | None:
    """Return what is kept of a picture: what is asked for, or the default of its kind, if it has one."""
    holes = out.background is not None or out.output.suffix.lower() == ".ora"
    if out.crop is not None or kind != "photographs" or holes:
        return out.crop
    return "fit" if out.fill_edges is None else "inside"


def with_defaults(find: SeamOptions, out: Outputs, kind: str) -> tuple[SeamOptions, Outputs]:
    """Fill in the defaults for photographs or for scans."""
    photographs = kind == "photographs"
    tones, shading = find.of_stitch("match_tones"), find.of_stitch("match_shading")
    if tones is None and shading is None:
        shading = photographs
    find = find.with_stitch(
        match_tones=bool(tones),
        match_shading=bool(shading),
        blend=find.of_stitch("blend") or ("auto" if photographs else "none"),
    )
    return find, replace(out, crop=_crop(out, kind))
