"""Folders of maps of one material: what each file is, told by the end of its name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import toposeam as ts
from toposeam_cli.files.writing import TEXTURE_SUFFIXES
from toposeam_cli.media.pictures.decode import size_of

#: What the names of files end in, in the order of their maps; the picture first, then normals.
_KINDS = {
    "albedo": "albedo basecolor basecolour base color colour col diffuse diff bc",
    "normal": "normal normals normalgl normalopengl normalogl nor norgl nrm norm",
    "normal, DirectX": "normaldx normaldirectx nordx",
    "height": "height displacement disp bump depth",
    "roughness": "roughness rough",
    "gloss": "gloss glossiness smoothness",
    "metallic": "metallic metalness metal",
    "ao": "ao ambientocclusion occlusion occ",
    "specular": "specular spec",
    "emission": "emission emissive emit",
    "opacity": "opacity alpha mask",
    "packed": "arm orm ord mra",
    "ids": "id ids material",
}
_BY_ENDING = {ending: kind for kind, endings in _KINDS.items() for ending in endings.split()}
#: Pictures of these formats cannot be written under the same name.
_NOT_WRITTEN = (".hdr", ".tga", ".bmp", ".gif", ".psd", ".dds", ".ktx2", ".avif", ".heic")
#: Parts of a name, and those that say how large or of which format a map is.
_PART, _NO_KIND = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+"), re.compile(r"\d+|[kK]|png|jpe?g|tiff?")


def kind_of(path: Path) -> str | None:
    """Return what map a file is; None if the end of its name does not tell.

    Examples
    --------
    >>> names = "wall_base_color.png", "Bricks_2K-PNG_NormalGL.png", "moss_nor_dx_4k.png"
    >>> [kind_of(Path(name)) for name in names]
    ['albedo', 'normal', 'normal, DirectX']
    >>> kind_of(Path("bricksAO.tif")), kind_of(Path("preview.png"))
    ('ao', None)
    """
    parts = [part.lower() for part in _PART.findall(path.stem)]
    while parts and _NO_KIND.fullmatch(parts[-1]):
        parts.pop()
    endings = ("".join(parts[-count:]) for count in (2, 1))
    return next((_BY_ENDING[ending] for ending in endings if ending in _BY_ENDING), None)


def maps_of(folder: Path) -> dict[str, Path]:
    """Find the maps of a material in a folder, by what they are.

    Raises
    ------
    ImageError
        Where a file cannot be told, two are the same map or differ in size, or none is the albedo.
    """
    found: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        suffix = path.suffix.lower()
        if path.name.startswith(".") or suffix not in TEXTURE_SUFFIXES + _NOT_WRITTEN:
            continue
        kind = kind_of(path)
        if kind is None:
            raise ts.ImageError(
                f"nothing tells what map '{path}' is; end its name in _albedo, _normal, _height, _roughness, "
                "_metallic, _ao or another name of a map, or move it elsewhere"
            )
        if suffix in _NOT_WRITTEN:
            raise ts.ImageError(f"'{path}' could not be written in its own format; save it as .tif or .png")
        if kind in found:
            raise ts.ImageError(
                f"'{found[kind]}' and '{path.name}' are both the {kind} of one material; move one elsewhere"
            )
        found[kind] = path
    if "albedo" not in found:
        raise ts.ImageError(
            f"no picture in '{folder}' is the albedo; end its name in _albedo, _basecolor, _color or _diffuse"
        )
    if "normal" not in found and "normal, DirectX" in found:
        found["normal"] = found.pop("normal, DirectX")
    albedo = found["albedo"]
    for path in found.values():
        (width, height), (wanted, high) = size_of(path), size_of(albedo)
        if (width, height) != (wanted, high):
            raise ts.ImageError(
                f"'{path}' is {width} × {height} px, but '{albedo.name}' {wanted} × {high} px; scale the "
                "maps to one size"
            )
    return {kind: found[kind] for kind in _KINDS if kind in found}


def weights_of(count: int) -> tuple[float, ...]:
    """Return the weights of a picture and its further maps, which together count as much as the picture."""
    return (1.0, *(1 / count for _ in range(count)))


def maps_of_all(folders: Sequence[Path]) -> tuple[list[Path], list[Path], list[Path]]:
    """Find the albedos of materials, their further maps, and their normals: each map once per material.

    Raises
    ------
    ImageError
        Also where one material has a map that another one has not.
    """
    every = [maps_of(folder) for folder in folders]
    for folder, maps in zip(folders, every, strict=True):
        missing = set(every[0]) ^ set(maps)
        if missing:
            raise ts.ImageError(
                f"'{folders[0]}' and '{folder}' do not have the same maps: only one has {min(missing)}; add "
                "it, or move it elsewhere"
            )
    further = [kind for kind in every[0] if kind not in ("albedo", "normal")]
    return (
        [maps["albedo"] for maps in every],
        [maps[kind] for kind in further for maps in every],
        [maps["normal"] for maps in every if "normal" in maps],
    )
