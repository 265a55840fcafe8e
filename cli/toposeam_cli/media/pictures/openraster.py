"""OpenRaster files (``.ora``), which GIMP, Krita and MyPaint read and write: layers in, layers with their
masks out.

A zip archive of one PNG per layer and a ``stack.xml`` with their places, topmost first (OpenRaster 0.0.6).
Files are not trusted: nothing is unpacked under a name from the archive, sizes are limited before and during
unpacking, and the XML may neither declare entities nor name a DTD.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import toposeam as ts
from toposeam.images import full_scale
from toposeam.sentence import printable
from toposeam_cli.files.temporary import private_folder
from toposeam_cli.files.writing import replacing
from toposeam_cli.media.pictures.colour import to_depth
from toposeam_cli.media.pictures.decode import refuse_together
from toposeam_cli.media.pictures.libvips import channels
from toposeam_cli.media.pictures.picture import Picture, encode_png, read_picture

#: Largest stack.xml, bytes, and most layers that are read.
LARGEST_STACK_BYTES, MOST_LAYERS = 16 * 2**20, 1000
#: Greatest ratio of unpacked to compressed bytes; deflate reaches 1032.
_LARGEST_RATIO = 1100
_DEEPEST = 64
#: Most bytes of a layer's PNG besides its pixels: profile, texts.
_BESIDE_PIXELS = 2**25
_PNG = b"\x89PNG\r\n\x1a\n"
_MIMETYPE = b"image/openraster"
_SECOND = (1980, 1, 1, 0, 0, 0)  # the same layers make the same bytes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OraLayer:
    """A visible layer of an OpenRaster file."""

    picture: Picture
    #: Column and row of its upper left pixel.
    at: tuple[int, int]
    name: str


@dataclass(frozen=True, slots=True)
class _Entry:
    source: str
    at: tuple[int, int]
    name: str
    opacity: float


def read_ora(path: Path, max_pixels: int) -> list[OraLayer]:
    """Return the visible layers of an OpenRaster file, bottommost first; groups are taken apart.

    A layer's opacity, and that of its groups, is multiplied into its alpha. Hidden layers, and hidden groups
    with all they hold, are left out.

    Parameters
    ----------
    path : Path
    max_pixels : int
        Width times height above which a layer is refused.

    Raises
    ------
    ImageError
        If there is no such file, or it is no OpenRaster file, damaged or hostile, or uses blend modes, which
        seams do not support.
    """
    try:
        with zipfile.ZipFile(path) as archive, private_folder() as folder:
            if "stack.xml" not in archive.namelist():
                raise ts.ImageError(
                    f"'{path}' has no stack.xml, so that it is no OpenRaster file; save it from GIMP or "
                    "Krita again"
                )
            stack = _parse(path, _unpacked(path, archive, "stack.xml", LARGEST_STACK_BYTES))
            entries = list(_entries(path, stack, 1.0, 0))
            if len(entries) > MOST_LAYERS:
                raise ts.ImageError(
                    f"'{path}' has {len(entries)} visible layers; merge or hide some, so that at most "
                    f"{MOST_LAYERS} are left"
                )
            if not entries:
                raise ts.ImageError(
                    f"'{path}' has no visible layer; show those that are to be joined, and save it again"
                )
            sizes = _checked_sizes(path, archive, entries, max_pixels)
            return [
                _layer(path, archive, entry, folder, max_pixels, sizes.get(entry.source, 0))
                for entry in reversed(entries)
            ]
    except FileNotFoundError as error:
        raise ts.ImageError(f"there is no file '{path}'; check its name and folder") from error
    except (zipfile.BadZipFile, zipfile.LargeZipFile, NotImplementedError, EOFError) as error:
        raise ts.ImageError(f"'{path}' is no OpenRaster file, or damaged ({error}); save it again") from error
    except OSError as error:
        raise ts.ImageError(
            f"cannot read '{path}' ({error.strerror or error}); check its name and your right to read it"
        ) from error


def _checked_sizes(
    path: Path, archive: zipfile.ZipFile, entries: Sequence[_Entry], max_pixels: int
) -> dict[str, int]:
    """Count the pixels of each picture by its first bytes, before anything is unpacked, and refuse layers
    that are too large together.
    """
    known: dict[str, int] = {}
    names = set(archive.namelist())
    for source in {entry.source for entry in entries} & names:
        with suppress(zlib.error, RuntimeError), archive.open(source) as file:
            head = file.read(24)
            if head.startswith(_PNG) and len(head) == 24:
                known[source] = int.from_bytes(head[16:20], "big") * int.from_bytes(head[20:24], "big")
    total = sum(known.get(entry.source, 0) for entry in entries)
    refuse_together(len(entries), total, max_pixels, f"'{path}': ")
    return known


def _unpacked(path: Path, archive: zipfile.ZipFile, name: str, limit: int) -> bytes:
    """Return the content of an entry, at most `limit` bytes."""
    info = archive.getinfo(name)
    if info.file_size > limit or info.file_size > _LARGEST_RATIO * max(info.compress_size, 1) + 4096:
        raise ts.ImageError(
            f"'{path}': {name} would unpack to {info.file_size} bytes, more than is plausible; use only "
            "files you trust"
        )
    if info.flag_bits & 1:
        raise ts.ImageError(f"'{path}' is encrypted; save it again without a password")
    try:
        with archive.open(info) as entry:
            content = entry.read(limit + 1)
    except (zlib.error, RuntimeError) as error:
        raise ts.ImageError(f"'{path}': {name} is damaged ({error}); save the file again") from error
    if len(content) > limit:
        raise ts.ImageError(f"'{path}': {name} unpacks to more than {limit} bytes; use only files you trust")
    return content


def _parse(path: Path, document: bytes) -> Any:
    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import ParseError, fromstring

    try:
        root = fromstring(document, forbid_dtd=True)
    except DefusedXmlException as error:
        raise ts.ImageError(
            f"'{path}': stack.xml declares a DTD or entities, which can be hostile; save the file from GIMP "
            "or Krita"
        ) from error
    except (ParseError, ValueError, LookupError, RecursionError) as error:
        raise ts.ImageError(f"'{path}': stack.xml is not XML ({error}); save the file again") from error
    stack = root.find("stack") if root.tag == "image" else None
    if stack is None:
        raise ts.ImageError(
            f"'{path}': stack.xml holds no <image> with a <stack>; save the file from GIMP or Krita again"
        )
    return stack


def _entries(path: Path, stack: Any, opacity: float, depth: int) -> Iterator[_Entry]:
    """Visible layers in the order of the file: topmost first."""
    if depth > _DEEPEST:
        raise ts.ImageError(f"'{path}' has groups more than {_DEEPEST} deep; take some of them apart")
    for element in stack:
        if element.tag not in ("layer", "stack") or element.get("visibility", "visible").strip() == "hidden":
            continue
        name = (
            " ".join((element.get("name") or "").split())
            or element.get("src", "").rpartition("/")[2]
            or "group"
        )
        if element.get("composite-op", "svg:src-over").strip() != "svg:src-over":
            raise ts.ImageError(
                f"'{path}': {name} has the blend mode {element.get('composite-op')}, which no seam can join; "
                "set it to Normal, or hide it"
            )
        own = opacity * _number(path, element, name, "opacity", 1.0)
        if element.tag == "stack":
            yield from _entries(path, element, own, depth + 1)
        elif own > 0:
            x, y = (round(_number(path, element, name, axis, 0.0)) for axis in ("x", "y"))
            yield _Entry(element.get("src", ""), (x, y), name, min(own, 1.0))


def _number(path: Path, element: Any, name: str, key: str, default: float) -> float:
    text = element.get(key)
    try:
        value = default if text is None else float(text)
    except ValueError:
        value = np.nan
    if not abs(value) < 1e9:
        raise ts.ImageError(
            f"'{path}': {name} has {key}={text!r}, which is no usable number; save the file again"
        )
    return value


def _layer(
    path: Path, archive: zipfile.ZipFile, entry: _Entry, folder: Path, max_pixels: int, n_pixels: int
) -> OraLayer:
    if (
        entry.source.startswith(("/", "\\"))
        or ".." in entry.source.replace("\\", "/").split("/")
        or ":" in entry.source
    ):
        raise ts.ImageError(
            f"'{path}': {entry.name} is said to be at {entry.source!r}, outside of the file; use only files "
            "you trust"
        )
    if entry.source not in archive.namelist():
        raise ts.ImageError(
            f"'{path}': {entry.name} ({entry.source!r}) is missing from the file; save it again"
        )
    unpacked = folder / "layer.png"
    unpacked.write_bytes(_unpacked(path, archive, entry.source, 16 * n_pixels + _BESIDE_PIXELS))
    try:
        picture = read_picture(unpacked, max_pixels=max_pixels)
    except ts.ImageError as error:
        raise ts.ImageError(str(error).replace(f"'{unpacked}'", f"'{path}': {entry.name}")) from error
    if entry.opacity < 1:
        full = full_scale(picture.pixels.dtype)
        alpha = (
            np.full(picture.pixels.shape[:2], full, picture.pixels.dtype)
            if picture.alpha is None
            else picture.alpha
        )
        faded = np.where(
            alpha > 0, np.maximum(alpha * entry.opacity, 0 if alpha.dtype == np.float32 else 1), 0
        )
        picture = replace(picture, alpha=faded.astype(alpha.dtype))
    return OraLayer(picture=replace(picture, source=path), at=entry.at, name=entry.name)


def write_ora(
    path: Path,
    stitched: ts.layers.Composition,
    originals: Sequence[Picture],
    layers: Sequence[ts.Layer],
    force: bool = False,
) -> None:
    """Write a composite with its layers, so that it can be edited further.

    On top is one layer per picture, transparent where it does not show. Transparent pixels keep their
    colours, so that editors can bring them back, as OpenRaster has no masks. Below, in a hidden group, are
    the unchanged pictures.

    Parameters
    ----------
    path : Path
    stitched : Composition
    originals : sequence of Picture
        The layers' pictures, of one depth and profile; floats are rounded to 16 bits.
    layers : sequence of Layer
        The layers of the composite.
    force : bool
        Whether an existing file may be replaced.

    Raises
    ------
    OptionError, OutputError
        If the file cannot be written; an existing file is then still there.
    """
    from xml.sax.saxutils import quoteattr  # loads an HTTP client

    height, width = stitched.image.shape[:2]
    left, top = stitched.origin
    cut, kept = [], []
    files: list[tuple[str, Picture]] = []
    for index, (picture, layer, mask) in enumerate(zip(originals, layers, stitched.masks, strict=True)):
        x, y = layer.at[0] - left, layer.at[1] - top
        place = np.s_[y : y + layer.image.shape[0], x : x + layer.image.shape[1]]
        files += [
            (f"data/{index:03d}-shown.png", _shown(picture, stitched, mask, place)),
            (f"data/{index:03d}.png", picture),
        ]
        name = quoteattr(printable(layer.name))
        cut.append(
            f'    <layer name={name} src="data/{index:03d}-shown.png" x="{x}" y="{y}" opacity="1.0" '
            'visibility="visible"/>'
        )
        kept.append(
            f'      <layer name={name} src="data/{index:03d}.png" x="{x}" y="{y}" opacity="1.0" '
            'visibility="visible"/>'
        )
    merged = replace(originals[0], pixels=stitched.image, alpha=stitched.alpha)
    files.append(("mergedimage.png", merged))
    files.append(("Thumbnails/thumbnail.png", _thumbnail(merged)))
    x_dpi, y_dpi = (round(value * 25.4) for value in originals[0].resolution or (72 / 25.4, 72 / 25.4))
    stack = "\n".join(
        [
            "<?xml version='1.0' encoding='UTF-8'?>",
            f'<image version="0.0.6" w="{width}" h="{height}" xres="{x_dpi}" yres="{y_dpi}">',
            "  <stack>",
            *reversed(cut),
            '    <stack name="originals" visibility="hidden" opacity="1.0">',
            *reversed(kept),
            "    </stack>",
            "  </stack>",
            "</image>",
            "",
        ]
    )
    with (
        replacing(path, force) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as archive,
    ):
        archive.writestr(zipfile.ZipInfo("mimetype", _SECOND), _MIMETYPE)
        archive.writestr(zipfile.ZipInfo("stack.xml", _SECOND), stack.encode(), zipfile.ZIP_DEFLATED)
        for name, picture in files:
            archive.writestr(zipfile.ZipInfo(name, _SECOND), encode_png(picture))


def _shown(
    picture: Picture, stitched: ts.layers.Composition, mask: np.ndarray, place: tuple[slice, slice]
) -> Picture:
    """Return a picture that is opaque only where it shows, with the composite's pixels there."""
    shows = mask[place]
    pixels = np.where(
        shows if channels(picture.pixels) == 1 else shows[..., None], stitched.image[place], picture.pixels
    )
    opacity = (
        np.full(shows.shape, full_scale(pixels.dtype), pixels.dtype)
        if stitched.alpha is None
        else stitched.alpha[place]
    )
    return replace(picture, pixels=pixels, alpha=np.where(shows, opacity, pixels.dtype.type(0)))


def _thumbnail(picture: Picture) -> Picture:
    """Reduce a picture to at most 256 px a side, 8 bits, RGBA, by averaging blocks."""
    height, width = picture.pixels.shape[:2]
    size = max(1, -(-max(height, width) // 256))
    alpha = (
        np.full((height, width), 255, np.uint8)
        if picture.alpha is None
        else to_depth(picture.alpha, np.dtype(np.uint8))
    )
    pixels = to_depth(picture.pixels, np.dtype(np.uint8))
    pixels = pixels if pixels.ndim == 3 else np.repeat(pixels[..., None], 3, axis=2)
    rgba = np.dstack([pixels, alpha])
    rows, columns = np.arange(0, height, size), np.arange(0, width, size)
    share = alpha.astype(np.float32)[..., None] / 255
    sums = np.add.reduceat(
        np.add.reduceat(rgba * np.dstack([share, share, share, np.ones_like(share)]), rows, 0), columns, 1
    )
    count = np.add.reduceat(np.add.reduceat(np.ones((height, width, 1), np.float32), rows, 0), columns, 1)
    weight = np.add.reduceat(np.add.reduceat(share, rows, 0), columns, 1)
    colours = np.rint(sums[..., :3] / np.maximum(weight, 1e-6)).clip(0, 255).astype(np.uint8)
    return Picture(pixels=colours, alpha=np.rint(sums[..., 3:] / count)[..., 0].clip(0, 255).astype(np.uint8))
