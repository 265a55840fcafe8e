"""Options that ``synth``, ``tile`` and ``fill`` share, and the files that belong to a texture."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
import numpy.typing as npt
from click.core import ParameterSource

import toposeam as ts
from toposeam_cli.app.command import option
from toposeam_cli.app.options import (
    FILE,
    MEGAPIXELS,
    OUTPUT,
    FiniteRange,
    Length,
    LengthType,
    force_option,
    grouped,
    quiet_option,
    refuse_besides,
)
from toposeam_cli.files.regular import real_path
from toposeam_cli.files.writing import (
    TEXTURE_SUFFIXES,
    all_or_nothing,
    atomic_write,
    check_output,
    new_folder,
)
from toposeam_cli.media.pictures.openexr import check_openexr
from toposeam_cli.media.pictures.picture import (
    Picture,
    check_values,
    match_pictures,
    read_picture,
    write_picture,
)
from toposeam_cli.textures.maps import Maps, map_outputs
from toposeam_cli.textures.material_folder import maps_of_all, weights_of


class PatchType(click.ParamType):  # type: ignore[type-arg]
    """A number of pixels, or ``auto`` (None in Python)."""

    name = "N|auto"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int | None:
        """Parse the text."""
        if value == "auto":
            return None
        if isinstance(value, str) and not re.fullmatch(r"\d{1,9}", value):
            self.fail(f"{value!r} is not a patch size; write pixels, like 40, or auto", param, ctx)
        return int(value)


class LatticeType(click.ParamType):  # type: ignore[type-arg]
    """Periods across and down and a shift of rows, as core takes them: down, right, shift."""

    name = "WIDTHxHEIGHT[,SHIFT]"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, ...]:
        """Parse the text."""
        if isinstance(value, tuple):
            return value
        number = r"(\d{1,6}(?:\.\d{1,6})?)"
        found = re.fullmatch(rf"{number}x{number}(?:,(-?{number[1:-1]}))?", str(value).strip())
        if found is None:
            self.fail(
                f"{value!r} is no lattice; write its periods across and down, px, and how far each row is "
                "shifted, like 64x48 or 80x24,40",
                param,
                ctx,
            )
        right, down, shift = found.groups()
        return (float(down), float(right)) if shift is None else (float(down), float(right), float(shift))


#: What a variation, and a setting, stand for.
VARIED = ("tolerance", "candidates", "most", "variety")


class WeightsType(click.ParamType):  # type: ignore[type-arg]
    """Numbers separated by commas."""

    name = "W,W,…"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, ...]:
        """Parse the text."""
        if isinstance(value, tuple):
            return value
        try:
            return tuple(float(part) for part in value.split(","))
        except ValueError:
            self.fail(f"{value!r} is not a list of weights; write numbers, like 1,0.5", param, ctx)


@dataclass(frozen=True, slots=True, kw_only=True)
class Patches:
    """Size and overlap of patches."""

    patch: int | None
    overlap: Length | None

    def keywords(self) -> dict[str, Any]:
        """Return the keywords of ``synthesize`` and ``fill``.

        Raises
        ------
        OptionError
            For an overlap of 100 %.
        """
        overlap: float | None = None
        if self.overlap is not None:
            if self.overlap.percent and self.overlap.value >= 100:
                raise ts.OptionError("overlap is 100%; of a patch give less, usually 25%")
            overlap = self.overlap.value / 100 if self.overlap.percent else int(self.overlap.value)
        return {"patch": self.patch, "overlap": overlap}


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """Options of the choice, cutting and mixing of patches."""

    also: tuple[Path, ...]
    normal: tuple[Path, ...]
    weights: tuple[float, ...] | None
    seed: int
    smooth: int
    tolerance: float
    candidates: int
    context: int
    most: float
    variety: float
    method: ts.typing.Method

    def keywords(self, instead: str | None = None) -> dict[str, Any]:
        """Return the keywords common to ``synthesize``, ``make_tileable`` and ``fill``.

        Parameters
        ----------
        instead : str, optional
            The option that stands for the choice of patches; what it replaces must not be given.
        """
        context = click.get_current_context()
        if instead is not None:
            every = {str(option.name) for option in context.command.params}
            refuse_besides(instead, every - set(VARIED), "it stands for that as well")
        given = {
            name: getattr(self, name)
            for name in VARIED
            if instead is None and context.get_parameter_source(name) is not ParameterSource.DEFAULT
        }
        return {
            "seed": self.seed,
            "smooth": self.smooth,
            "context": self.context,
            "method": self.method,
            **given,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """Options of further outputs."""

    seams: Path | None
    labels: Path | None
    coordinates: Path | None
    max_megapixels: float
    as_json: bool
    force: bool
    quiet: bool

    def destinations(
        self,
        output: Path,
        search: Search,
        preview: Path | None = None,
        count: int = 1,
        material: Path | None = None,
    ) -> Destinations:
        """Return the checked destinations of all files; `count` is the number of samples, `material` the
        picture of a folder of maps, which makes another such folder.
        """
        maps = map_outputs(output, search.also, search.normal, count)
        if material is not None:
            if output.suffix.lower() in TEXTURE_SUFFIXES:
                raise ts.OptionError(
                    f"'{output}' names a picture, but a folder of maps makes a folder; write -o {output.stem}"
                )
            maps = tuple(output / path.name for path in (*search.also, *search.normal)[::count])
        return Destinations(
            output=output if material is None else output / material.name,
            folder=None if material is None else output,
            maps=maps,
            seams=self.seams,
            labels=self.labels,
            coordinates=self.coordinates,
            preview=preview,
            force=self.force,
        )

    @property
    def max_pixels(self) -> int:
        """Largest picture that is read, pixels."""
        return round(self.max_megapixels * 1e6)


_PATCHES: tuple[Callable[[Any], Any], ...] = (
    option(
        "--patch",
        heading="Patches",
        type=PatchType(),
        default="auto",
        show_default=True,
        help="Side of a patch, px; auto: by the picture's own scale.",
    ),
    option(
        "--overlap",
        heading="Patches",
        type=LengthType(),
        help="How far patches overlap, px or % of the patch; 25% by default.",
    ),
)

_SEARCH: tuple[Callable[[Any], Any], ...] = (
    option(
        "--also",
        heading="Maps",
        type=FILE,
        multiple=True,
        help="A further map of the same size (height, roughness, numbers of materials …), cut alike into "
        "OUTPUT_NAME in its own format; its values are never mixed. May be repeated.",
    ),
    option(
        "--normal",
        heading="Maps",
        type=FILE,
        multiple=True,
        help="A normal map of the same size, cut alike into OUTPUT_NAME, its vectors of length 1.",
    ),
    option(
        "--weights",
        heading="Maps",
        type=WeightsType(),
        help="How much the picture, each map and the normals count in the search; 1 each by default.",
    ),
    option(
        "--seed",
        heading="Patches",
        type=click.IntRange(min=0),
        default=0,
        show_default=True,
        help="The same seed makes the same picture.",
    ),
    option(
        "--smooth",
        heading="Patches",
        type=click.IntRange(0, 8),
        default=1,
        show_default=True,
        help="Mix patches over this many px beside seams, in colours and normals.",
    ),
    option(
        "--tolerance",
        heading="Patches",
        type=FiniteRange(0, 10),
        default=0.1,
        show_default=True,
        help="How much worse than the best a patch may fit to be drawn as well.",
    ),
    option(
        "--candidates",
        heading="Patches",
        type=click.IntRange(1, 1000),
        default=8,
        show_default=True,
        help="How many places are compared for each patch.",
    ),
    option(
        "--context",
        heading="Patches",
        type=click.IntRange(0, 64),
        default=8,
        show_default=True,
        help="px round a patch in which it has to fit too.",
    ),
    option(
        "--most",
        heading="Patches",
        type=FiniteRange(min=1),
        default=2.5,
        show_default=True,
        help="Without a guide no pixel shows more often than this many times the average.",
    ),
    option(
        "--variety",
        heading="Patches",
        type=FiniteRange(0, 100),
        default=0.5,
        show_default=True,
        help="How strongly places that show often already are avoided.",
    ),
    option(
        "--method",
        heading="Patches",
        type=click.Choice(ts.typing.METHODS),
        default="auto",
        show_default=True,
        help="How seams are found; auto takes the exact solver that is fastest.",
    ),
)

_RESULTS: tuple[Callable[[Any], Any], ...] = (
    option("--seams", heading="Output", type=OUTPUT, help="Also write the seams as SVG."),
    option(
        "--labels",
        heading="Output",
        type=OUTPUT,
        help="Also write the patches' numbers, a 16-bit gray picture.",
    ),
    option(
        "--coordinates",
        heading="Output",
        type=OUTPUT,
        help="Also write where each pixel came from, a 16-bit picture: red column, green row, blue exemplar.",
    ),
    option(
        "--max-megapixels",
        heading="Speed and memory",
        type=MEGAPIXELS,
        default=72.0,
        show_default=True,
        help="Refuse larger pictures; the search for patches takes about 30 bytes a pixel.",
    ),
    option(
        "--json",
        "as_json",
        heading="Output",
        is_flag=True,
        help="Print what was made, and how visible joints are, as JSON.",
    ),
    force_option,
    quiet_option,
)


#: Decorators that add the options for the size of patches (``patches``), their choice (``search``) and
#: further outputs (``results``).
patch_options = grouped("patches", Patches, _PATCHES)
search_options = grouped("search", Search, _SEARCH)
result_options = grouped("results", Results, _RESULTS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Destinations:
    """Destinations of a texture and its further files."""

    output: Path
    #: One per further map.
    maps: tuple[Path, ...] = ()
    #: The folder in which these are, if it is to be made with them.
    folder: Path | None = None
    seams: Path | None = None
    labels: Path | None = None
    coordinates: Path | None = None
    preview: Path | None = None
    force: bool = False

    def __post_init__(self) -> None:
        pictures = [path for path in (self.output, *self.maps, self.preview) if path is not None]
        if self.folder is not None and not self.folder.is_dir():
            check_output(self.folder, suffixes=None)
        for path in pictures:
            if self.folder is None or self.folder.is_dir() or path == self.preview:
                check_output(path, self.force, TEXTURE_SUFFIXES)
                check_openexr(path)
        for numbers in (self.labels, self.coordinates):
            if numbers is not None:
                check_output(numbers, self.force, (".png", ".tif", ".tiff"))  # 16 bits without loss
                pictures.append(numbers)
        if self.seams is not None:
            check_output(self.seams, self.force, (".svg",))
            pictures.append(self.seams)
        if len({real_path(path) for path in pictures}) < len(pictures):
            raise ts.OptionError("two outputs have the same name; give each a name of its own")

    def check(self, pictures: Sequence[Picture], maps: Maps) -> None:
        """Refuse pictures and maps that the formats of the outputs cannot hold, before any work.

        Raises
        ------
        ImageError
        """
        for path, owners in zip((self.output, *self.maps), (pictures, *maps.pictures), strict=True):
            for picture in owners:
                check_values(path, picture)

    def write(self, made: ts.texture.Synthesis, picture: Picture, maps: Maps) -> None:
        """Write all requested files, or none.

        Parameters
        ----------
        made : Synthesis
        picture : Picture
            The picture whose profile and resolution the result takes.
        maps : Maps
            Likewise.
        """
        with new_folder(self.folder), all_or_nothing():
            self._write(made, picture, maps)

    def _write(self, made: ts.texture.Synthesis, picture: Picture, maps: Maps) -> None:
        document = None if self.seams is None else made.to_svg()
        shown = dataclasses.replace(picture, pixels=made.image, alpha=made.alpha)
        for path, one in zip((self.output, *self.maps), (shown, *maps.made(made)), strict=True):
            write_picture(path, one, self.force)
        if self.seams is not None and document is not None:
            atomic_write(self.seams, document, self.force)
        if self.labels is not None:
            write_picture(self.labels, Picture(pixels=(made.labels % 65536).astype(np.uint16)), self.force)
        if self.coordinates is not None:
            write_picture(self.coordinates, Picture(pixels=coordinate_picture(made)), self.force)
        if self.preview is not None:
            pixels = np.tile(made.image, (3, 3, 1)[: made.image.ndim])
            alpha = None if made.alpha is None else np.tile(made.alpha, (3, 3))
            write_picture(self.preview, dataclasses.replace(picture, pixels=pixels, alpha=alpha), self.force)


def summary(output: Path, made: ts.texture.Synthesis) -> dict[str, Any]:
    """Return the summary of a texture for JSON."""
    height, width = made.labels.shape
    grown: dict[str, Any] = {
        name: made.settings[name] for name in ("setting", "lattice") if name in made.settings
    }
    if grown.get("lattice") is not None:
        grown["lattice"] = [[round(x, 2), round(y, 2)] for y, x in grown["lattice"]]
    tried = {name: None if verdict is None else verdict.summary() for name, verdict in made.tried.items()}
    return {
        "output": str(output),
        "size": [width, height],
        "patches": made.count,
        "patch": list(made.patch[::-1]),
        **grown,
        **made.verdict.summary(),
        **({"tried": tried} if tried else {}),
    }


def coordinate_picture(made: ts.texture.Synthesis) -> npt.NDArray[np.uint16]:
    """Return the column, row and exemplar of every pixel's source, (H, W, 3)."""
    return np.concatenate([made.source[..., ::-1], made.exemplar[..., np.newaxis]], axis=2).astype(np.uint16)


def read_sources(paths: Sequence[Path], max_megapixels: float) -> list[Picture]:
    """Read exemplars and convert them to one depth and colour space."""
    return match_pictures([read_picture(path, max_pixels=round(max_megapixels * 1e6)) for path in paths])


def alphas(pictures: Sequence[Picture]) -> list[Any] | None:
    """Return the opacity of each picture, or None if all are opaque."""
    return (
        None
        if all(picture.alpha is None for picture in pictures)
        else [picture.alpha for picture in pictures]
    )


def unfolded(given: Sequence[Path], search: Search) -> tuple[tuple[Path, ...], Search, Path | None]:
    """Name the maps of materials that are given as folders.

    Returns
    -------
    tuple of Path
        The pictures.
    Search
        With their further maps, which count together as much as the picture, if nothing else is said.
    Path or None
        The first picture of a folder.

    Raises
    ------
    ImageError, OptionError
    """
    folders = [path for path in given if path.is_dir()]
    if not folders:
        return tuple(given), search, None
    if len(folders) < len(given):
        other = next(path for path in given if path not in folders)
        raise ts.OptionError(
            f"'{folders[0]}' is a folder of maps, but '{other}' is not; give either all of one kind"
        )
    if search.also or search.normal:
        raise ts.OptionError(
            f"'{folders[0]}' is a folder that holds its maps; put further ones into it, instead of --also "
            "and --normal"
        )
    pictures, also, normal = maps_of_all(folders)
    count = (len(also) + len(normal)) // len(folders)
    weights = search.weights or weights_of(count)
    named = dataclasses.replace(search, also=tuple(also), normal=tuple(normal), weights=weights)
    return tuple(pictures), named, pictures[0]


def read_one(image: Path, search: Search, results: Results) -> tuple[Picture, Maps]:
    """Read one picture and its further maps."""
    maps = Maps.read(search.also, search.normal, 1, results.max_pixels)
    return read_sources([image], results.max_megapixels)[0], maps
