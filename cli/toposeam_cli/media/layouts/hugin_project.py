"""Hugin's project files (.pto): pictures, their cameras, and the panorama.

Angles are degrees. A camera turns by the yaw y to the right, then by the pitch p upwards, then by the roll r
clockwise. Fields of view v are horizontal, of the whole width in pixels. The middle of the panorama is 0,0 on
the canvas; pixels of a panorama of even size have half-integer coordinates there.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import toposeam as ts
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.transforms import CameraTransform, Projection, angles_of, turned_camera
from toposeam_cli.files.regular import real_path
from toposeam_cli.files.tables import read_text

#: Largest project that is read, bytes: a quarter of a million control points fit.
_LARGEST_BYTES = 16 * 2**20
#: Characters of a line that are read; the rest is ignored.
_LONGEST_LINE = 20_000
_MOST_PICTURES = 1000
_LONGEST_PX = 10**6
#: Hugin's number of a projection, and the widest field of view, degrees. 19 is the general Panini projection;
#: 12, which Hugin calls Panini, draws heights by another law.
_PROJECTIONS: dict[Projection, tuple[int, float]] = {
    "flat": (0, 179.0),
    "cylinder": (1, 360.0),
    "sphere": (2, 360.0),
    "panini": (19, 319.0),
}
#: Parameters of the general Panini projection that make it the plain one, to 1/10000.
_PLAIN_PANINI = "100 0 0"
#: Parameters of a line: default (NaN: it is required), least and greatest value.
_PANORAMA = {
    **dict.fromkeys("wh", (math.nan, 1, _LONGEST_PX)),
    "f": (2, 0, 999),
    "v": (math.nan, 1e-3, 360),
}
_PICTURE = {
    **_PANORAMA,
    "f": (0, 0, 999),
    "j": (0, 0, 1e9),
    **dict.fromkeys("ypr", (0, -36000, 36000)),
    **dict.fromkeys("abc", (0, -1, 1)),
    **dict.fromkeys("de", (0, -_LONGEST_PX, _LONGEST_PX)),
    "Eev": (0, -100, 100),
    **dict.fromkeys(("g", "t", "TrX", "TrY", "TrZ"), (0, -1e9, 1e9)),
}
#: Parameters that no transform supports unless they are 0, and what they mean of a picture.
_UNKNOWN = {
    "f": "not flat",
    **dict.fromkeys("gt", "sheared"),
    **dict.fromkeys(("TrX", "TrY", "TrZ"), "taken from another place"),
}
_REMEDY = "let nona -m TIFF_m warp the pictures, and join them by toposeam enblend"
#: A panorama, a picture, or what Hugin notes of a picture.
_LINE = re.compile(r"^(?:[pi] |#-hugin ).*", re.MULTILINE)
_TOKEN = re.compile(r'(?:^|\s)([A-Za-z]+)("[^"]*"|\S*)')
#: Characters that no name in a project can have; surrogates stand for bytes that are not UTF-8.
_UNNAMED = re.compile(r'[\x00-\x1f\x7f"\ud800-\udfff]')
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectPicture:
    """A picture of a project."""

    file: Path
    #: Width and height, px.
    size: tuple[int, int]
    transform: CameraTransform
    #: Exposure value: one more is half of the light.
    exposure: float | None = None
    #: The part that may show; None is the whole picture.
    crop: Box | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class HuginProject:
    """A panorama and its pictures, in the order of the file."""

    pictures: tuple[ProjectPicture, ...]
    projection: Projection
    #: Width and height of the panorama, px.
    size: tuple[int, int]
    #: px per radian in the middle.
    radius: float
    #: Whether its left and right edges are the same line.
    whole_turn: bool
    #: The part that Hugin would render, in px of the panorama; None is all of it.
    crop: Box | None
    #: Names of pictures that do not belong to the panorama, with the reasons.
    left_out: tuple[tuple[str, str], ...]

    @property
    def origin(self) -> tuple[float, float]:
        """Position of the panorama's upper left pixel on the canvas, px."""
        return (1 - self.size[0]) / 2, (1 - self.size[1]) / 2


def read_project(path: Path) -> HuginProject:
    """Read a project; control points, masks and all parameters but those of geometry and exposure are
    ignored.

    Raises
    ------
    OptionError
        If it cannot be read or needs what no :class:`CameraTransform` can do; the text names the place.
    """
    lines = _LINE.findall(read_text(path, "a Hugin project", _LARGEST_BYTES).replace("\r", "\n"))
    panorama = next((_tokens(line) for line in lines if line.startswith("p ")), None)
    listed = [line for line in lines if line.startswith("i ")]
    if panorama is None or not listed:
        missing = "panorama (a line p)" if panorama is None else "pictures (lines i)"
        raise ts.OptionError(f"'{path}' has no {missing}, so it is not a Hugin project; check its name")
    if len(listed) > _MOST_PICTURES:
        raise ts.OptionError(f"'{path}' has {len(listed)} pictures; keep to {_MOST_PICTURES} at most")
    whole = f"'{path}', line p,"
    values = _values(whole, panorama, _PANORAMA)
    projection = _projection(whole, panorama, values)
    size = _even(projection, (int(values["w"]), int(values["h"])))
    radius = _radius(projection, size[0], values["v"])
    marks = [line for line in lines if line.startswith("#-hugin ")]
    pictures: list[ProjectPicture] = []
    left_out = []
    known: list[dict[str, float]] = []
    stacks = set()
    for index, line in enumerate(listed):
        entry = _tokens(line)
        name = entry.get("n", "").strip('"')
        if not name.strip() or _UNNAMED.search(name):
            raise ts.OptionError(f"'{path}', picture {index} has no file name; write it as n\"picture.jpg\"")
        where = f"'{path}', picture {index} ({name[:80]}),"
        known.append(_values(where, entry, _PICTURE, known))
        if len(marks) == len(listed) and "disabled" in marks[index]:
            left_out.append((name, "disabled in Hugin"))
            continue
        if known[index]["j"] in stacks:
            raise ts.OptionError(
                f"{where} belongs to a stack, pictures taken in one direction; disable all but one in Hugin, "
                f"or {_REMEDY}"
            )
        stacks.add(known[index]["j"])
        transform = _transform(where, known[index], projection, radius)
        pictures.append(
            ProjectPicture(
                file=path.parent / name,
                size=transform.size,
                transform=transform,
                exposure=known[index]["Eev"] if "Eev" in entry else None,
                crop=_crop(where, entry, transform.size),
            )
        )
    if not pictures:
        raise ts.OptionError(f"'{path}' has disabled pictures only; enable those to be joined in Hugin")
    return HuginProject(
        pictures=tuple(pictures),
        projection=projection,
        size=size,
        radius=radius,
        whole_turn=projection in ("cylinder", "sphere") and values["v"] > 360 - 1e-9,
        crop=_crop(whole, panorama, size),
        left_out=tuple(left_out),
    )


def project_text(
    folder: Path,
    pictures: Sequence[ProjectPicture],
    projection: Projection,
    size: tuple[int, int],
    radius: float,
    *,
    crop: Box | None = None,
) -> str:
    """Return a project for Hugin and :func:`read_project`; files are named from the folder.

    Pictures of the same size and lens as an earlier one are linked to it, as Hugin does.

    Parameters
    ----------
    folder : Path
        Folder of the project.
    pictures : sequence of ProjectPicture
        The pictures; projection and radius of their transforms are replaced by the panorama's.
    projection : str
    size : (int, int)
        Width and height of the panorama, px; that of a sphere is made even, as in Hugin.
    radius : float
        px per radian in its middle. If a sphere of odd width is a whole turn, the radius grows with its
        width.
    crop : Box, optional
        The part that Hugin renders, in px of the panorama.

    Raises
    ------
    OptionError
        For names that no project can hold, and panoramas wider than a project may have.
    """
    number, widest = _PROJECTIONS[projection]
    size = _even(projection, size)
    turn = _turn(projection, size[0], radius)
    if turn > widest * (1 + 2 / size[0]):
        raise ts.OptionError(
            f"a Hugin project shows {widest:g} degrees at most in this projection, not {turn:.1f}; crop the "
            "panorama, or choose another projection"
        )
    turn = min(turn, widest)
    exposures = [picture.exposure for picture in pictures if picture.exposure is not None]
    usual = sum(exposures) / len(exposures) if exposures else 0.0
    shape = f' P"{_PLAIN_PANINI}"' if projection == "panini" else ""
    lines = [
        "# hugin project file",
        "#hugin_ptoversion 2",
        f"p f{number} w{size[0]} h{size[1]} v{turn:.12g}  k0 E{usual:.12g} R0"
        f'{_crop_text(crop)}{shape} n"TIFF_m c:LZW r:CROP"',
        "m i0",
        "",
        "# image lines",
    ]
    lenses: dict[tuple[object, ...], int] = {}
    for index, picture in enumerate(pictures):
        name = Path(os.path.relpath(real_path(picture.file), real_path(folder))).as_posix()
        if _UNNAMED.search(name):
            raise ts.OptionError(
                f"a Hugin project cannot name {name!r}, for a quote, a control character or what is not "
                "UTF-8; rename the file"
            )
        (width, height), camera = picture.size, picture.transform
        of_lens = {
            "v": math.degrees(2 * math.atan(width / 2 / camera.focal)),
            **dict(zip("abcde", camera.lens + camera.shift, strict=True)),
            **dict.fromkeys(("Ra", "Rb", "Rc", "Rd", "Re", "g", "t", "Vb", "Vc", "Vd", "Vx", "Vy"), 0.0),
            "Va": 1.0,
        }
        first = lenses.setdefault((width, height, *of_lens.values()), index)
        lens = " ".join(
            f"{key}={first}" if first < index else f"{key}{value:.12g}" for key, value in of_lens.items()
        )
        yaw, pitch, roll = angles_of(camera.rotation)
        exposure = usual if picture.exposure is None else picture.exposure
        lines += [
            "#-hugin  cropFactor=1",
            f"i w{width} h{height} f0 {lens} Eev{exposure:.12g} Er1 Eb1 r{roll:.12g} p{pitch:.12g} "
            f'y{yaw:.12g} TrX0 TrY0 TrZ0 Tpy0 Tpp0 j0 Vm5{_crop_text(picture.crop)} n"{name}"',
        ]
    return "\n".join([*lines, ""])


def _tokens(line: str) -> dict[str, str]:
    """Parse the parameters of a line; of several of one name the first counts."""
    return dict(reversed(_TOKEN.findall(line[1:_LONGEST_LINE])))


def _values(
    where: str,
    entry: dict[str, str],
    limits: Mapping[str, tuple[float, float, float]],
    earlier: Sequence[dict[str, float]] = (),
) -> dict[str, float]:
    """Return the numbers of a line; some may be links to earlier pictures.

    Pictures of a stack have the same j.
    """
    values = {}
    for key, (usual, low, high) in limits.items():
        text = entry.get(key)
        if text is not None and text.startswith("="):
            if not re.fullmatch(r"\d{1,4}", text[1:], re.ASCII) or int(text[1:]) >= len(earlier):
                raise ts.OptionError(
                    f"{where} has {key}{text[:40]}; link it to an earlier picture, as {key}=0, or write a "
                    "number"
                )
            values[key] = earlier[int(text[1:])][key]
            continue
        value = usual if text is None else float(text) if _NUMBER.fullmatch(text) else math.nan
        if not low <= value <= high or (key in "wh" and value != int(value)):
            found = f"no {key}" if text is None else key + text[:40]
            kind = "whole number" if key in "wh" else "number"
            raise ts.OptionError(f"{where} has {found}; write {key} and a {kind} from {low:g} to {high:g}")
        values[key] = float(len(earlier) if key == "j" else value)
    return values


def _projection(where: str, panorama: dict[str, str], values: dict[str, float]) -> Projection:
    for projection, (number, widest) in _PROJECTIONS.items():
        if number != values["f"]:
            continue
        parameters = panorama.get("P", _PLAIN_PANINI).strip('"')
        if projection == "panini" and parameters.split() != _PLAIN_PANINI.split():
            raise ts.OptionError(
                f"{where} bends the general Panini projection by {parameters[:40]}; set its parameters in "
                f"Hugin to {_PLAIN_PANINI}"
            )
        if values["v"] > widest:
            raise ts.OptionError(
                f"{where} is {values['v']:g} degrees wide, and this projection shows {widest:g} at most; "
                "choose equirectangular in Hugin"
            )
        return projection
    raise ts.OptionError(
        f"{where} has projection f{values['f']:g}; choose rectilinear, cylindrical, equirectangular or "
        "general Panini in Hugin"
    )


def _transform(
    where: str, values: dict[str, float], projection: Projection, radius: float
) -> CameraTransform:
    for key, what in _UNKNOWN.items():
        if values[key] != 0:
            raise ts.OptionError(f"{where} is {what} ({key}{values[key]:g}); {_REMEDY}")
    if not values["v"] < 180:
        raise ts.OptionError(
            f"{where} has v{values['v']:g}; a flat picture sees less than 180, so correct it"
        )
    size = int(values["w"]), int(values["h"])
    return CameraTransform(
        size=size,
        rotation=turned_camera(values["y"], values["p"], values["r"]),
        focal=_radius("flat", size[0], values["v"]),
        projection=projection,
        radius=radius,
        lens=(values["a"], values["b"], values["c"]),
        shift=(values["d"], values["e"]),
    )


def _crop(where: str, entry: dict[str, str], size: tuple[int, int]) -> Box | None:
    """Return the crop S of a picture or panorama, None if there is none."""
    if "S" not in entry:
        return None
    numbers = entry["S"].split(",")
    if len(numbers) != 4 or not all(re.fullmatch(r"-?\d{1,9}", number, re.ASCII) for number in numbers):
        raise ts.OptionError(f"{where} S is {entry['S'][:40]!r}; write left,right,top,bottom in pixels")
    left, right, top, bottom = map(int, numbers)
    whole = Box(0, 0, size[1], size[0])
    crop = Box(top, left, bottom, right).shared(whole)
    if min(crop.shape) <= 0:
        raise ts.OptionError(f"{where} S is {entry['S']!r}, which leaves nothing; remove the crop in Hugin")
    return None if crop == whole else crop


def _crop_text(crop: Box | None) -> str:
    return "" if crop is None else f" S{crop.left},{crop.right},{crop.top},{crop.bottom}"


def _even(projection: Projection, size: tuple[int, int]) -> tuple[int, int]:
    """Return a panorama's size in Hugin, where spheres have an even width."""
    return size[0] + (size[0] % 2 if projection == "sphere" else 0), size[1]


def _radius(projection: Projection, width: int, turn: float) -> float:
    """Return px per radian in the middle of a picture of that width, px, and field of view, degrees."""
    half = math.radians(turn) / 2
    if projection == "flat":
        return width / 2 / math.tan(half)
    return width / 4 / math.tan(half / 2) if projection == "panini" else width / 2 / half


def _turn(projection: Projection, width: int, radius: float) -> float:
    """Invert :func:`_radius`."""
    across = width / 2 / radius
    if projection == "flat":
        return math.degrees(2 * math.atan(across))
    return math.degrees(4 * math.atan(across / 2) if projection == "panini" else 2 * across)
