"""Sets of corner tiles as Tiled and Godot 4 read them, beside the picture of the tiles."""

from __future__ import annotations

import json
from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np

import toposeam as ts
from toposeam.colours import to_hex
from toposeam.images import full_scale

#: Where the corners top left, top right, bottom left and bottom right stand among the eight numbers that
#: Tiled gives a tile, clockwise from its upper side, and what Godot calls them.
_IN_TILED = (7, 1, 5, 3)
_IN_GODOT = ("top_left_corner", "top_right_corner", "bottom_left_corner", "bottom_right_corner")


def colours_of(tiles: ts.texture.TileSet) -> list[tuple[float, float, float]]:
    """Return the mean colour of each material, sRGB in [0, 1]."""
    found = []
    for tile in (0, 15):
        shown = tiles.laid(np.array([[tile]])).reshape(tiles.size**2, -1) / float(
            full_scale(tiles.image.dtype)
        )
        red, green, blue = np.broadcast_to(shown.mean(axis=0), 3).tolist()
        found.append((red, green, blue))
    return found


def tiled_set(tiles: ts.texture.TileSet, picture: str, names: Sequence[str]) -> bytes:
    """Return a tileset of Tiled (.tsx) with its terrain, a wang set of corners.

    Parameters
    ----------
    tiles : TileSet
    picture : str
        The name of the sheet's file, beside it.
    names : two of str
        Of the materials.
    """
    height, width = tiles.image.shape[:2]
    root = ElementTree.Element(
        "tileset",
        version="1.8",
        tiledversion="1.8.0",
        name=" and ".join(names),
        tilewidth=str(tiles.size),
        tileheight=str(tiles.size),
        tilecount=str(len(tiles.corners)),
        columns=str(width // tiles.size),
    )
    ElementTree.SubElement(root, "image", source=picture, width=str(width), height=str(height))
    sets = ElementTree.SubElement(root, "wangsets")
    wang = ElementTree.SubElement(sets, "wangset", name=" and ".join(names), type="corner", tile="-1")
    for number, (name, colour) in enumerate(zip(names, colours_of(tiles), strict=True)):
        tile = str(15 * number)
        ElementTree.SubElement(wang, "wangcolor", name=name, color=to_hex(colour), tile=tile, probability="1")
    for number, corners in enumerate(tiles.corners.tolist()):
        sides = [0] * 8
        for place, material in zip(_IN_TILED, corners, strict=True):
            sides[place] = 1 + material
        ElementTree.SubElement(wang, "wangtile", tileid=str(number), wangid=",".join(map(str, sides)))
    ElementTree.indent(root, " ")
    text: bytes = ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text + b"\n"


def godot_set(tiles: ts.texture.TileSet, picture: str, names: Sequence[str]) -> str:
    """Return a TileSet resource of Godot 4 (.tres) with its terrains, which match corners; parameters as of
    :func:`tiled_set`.
    """
    size = f"Vector2i({tiles.size}, {tiles.size})"
    lines = [
        '[gd_resource type="TileSet" load_steps=3 format=3]',
        "",
        f'[ext_resource type="Texture2D" path={json.dumps(picture, ensure_ascii=False)} id="1"]',
        "",
        '[sub_resource type="TileSetAtlasSource" id="1"]',
        'texture = ExtResource("1")',
        f"texture_region_size = {size}",
    ]
    for number, corners in enumerate(tiles.corners.tolist()):
        row, column = divmod(number, tiles.image.shape[1] // tiles.size)
        tile = f"{column}:{row}/0"
        lines += [f"{tile} = 0", f"{tile}/terrain_set = 0", f"{tile}/terrain = {int(sum(corners) >= 2)}"]
        lines += [
            f"{tile}/terrains_peering_bit/{place} = {material}"
            for place, material in zip(_IN_GODOT, corners, strict=True)
        ]
    lines += ["", "[resource]", f"tile_size = {size}", "terrain_set_0/mode = 1"]
    for number, (name, colour) in enumerate(zip(names, colours_of(tiles), strict=True)):
        red, green, blue = (round(share, 3) for share in colour)
        lines.append(f"terrain_set_0/terrain_{number}/name = {json.dumps(name, ensure_ascii=False)}")
        lines.append(f"terrain_set_0/terrain_{number}/color = Color({red}, {green}, {blue}, 1)")
    lines += ['sources/0 = SubResource("1")', ""]
    return "\n".join(lines)
