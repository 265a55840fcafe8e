"""Pictures and drawings from which a motif takes its shape, its places or its colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import toposeam as ts
from toposeam.colours import parse_colour
from toposeam.motif.ink.palettes import Palette
from toposeam.vector.svg_document import parse
from toposeam_cli.files.tables import read_text
from toposeam_cli.media.pictures.libvips import load_vips
from toposeam_cli.media.pictures.picture import MAX_MOTIF, read_within
from toposeam_cli.motifs.swatches import read_swatches

#: Longer side at which drawings are drawn, px, and the largest that is read, bytes.
_DRAWN_PX, _LARGEST_DRAWING = 1024, 2**24


def read_colours(text: str, folder: Path = Path()) -> str | Palette | np.ndarray:
    """Read the value of ``--palette``: a palette, colours, or a picture."""
    if "#" in text:
        colours = np.array([parse_colour(word) for word in text.replace(",", " ").split()])
        return _palette(colours, repr(text))
    if Path(text).suffix.lower() in (".gpl", ".ase"):
        return _palette(read_swatches(folder / text), f"'{text}'")
    if Path(text).suffix:
        picture = read_within(folder / text, MAX_MOTIF)
        if picture.alpha is None:
            return picture.pixels
        if not picture.covered().any():
            raise ts.ImageError(
                f"the palette's picture '{text}' is transparent everywhere; give one with colours"
            )
        return np.expand_dims(picture.pixels[picture.covered()], 0)  # a row of the visible pixels
    return text


def _palette(colours: np.ndarray, of: str) -> Palette:
    """Make a palette: the first colour is the paper's, the others are inks."""
    if len(colours) < 2:
        raise ts.OptionError(f"the palette {of} has no ink; write the paper's colour and one per layer")
    return Palette(paper=colours[0], inks=colours[1:])


def read_theme(path: Path) -> np.ndarray:
    """Return a picture, or a drawing in SVG, for a motif's base, outline or guide, with its alpha if it has
    one.

    Raises
    ------
    ImageError
        If it shows nothing, or as :func:`~toposeam_cli.media.pictures.picture.read_within` raises it.
    """
    if path.suffix.lower() == ".svg":
        return _drawn(path)
    picture = read_within(path, MAX_MOTIF)
    if picture.alpha is None:
        return picture.pixels
    if not picture.covered().any():
        raise ts.ImageError(f"'{path}' is transparent everywhere; give one that shows something")
    return np.concatenate([np.atleast_3d(picture.pixels), picture.alpha[..., None]], axis=2)


def _drawn(path: Path) -> np.ndarray:
    """Draw an SVG document, (H, W, 4) uint8. Nothing that it refers to outside of itself is read."""
    text = read_text(path, "a drawing", _LARGEST_DRAWING)
    parse(text)
    vips = load_vips()
    try:
        plain = vips.Image.svgload_buffer(text.encode())
        scale = _DRAWN_PX / max(plain.width, plain.height)
        drawn = vips.Image.svgload_buffer(text.encode(), scale=scale).numpy()
    except vips.Error as error:
        raise ts.ImageError(f"'{path}' cannot be drawn; export it again as plain SVG, or as PNG") from error
    if not drawn[..., -1].any():
        raise ts.ImageError(
            f"'{path}' shows nothing on its page; draw on it, or crop the page to the drawing"
        )
    found: np.ndarray = drawn
    return found


def read_outline(text: str, folder: Path = Path()) -> str | np.ndarray:
    """Read the value of ``--outline``: one of the named ones, or a picture or drawing."""
    return text if text in ts.motif.OUTLINES else read_theme(_existing(text, folder, "--outline"))


def read_places(text: str, cell: tuple[int, int], folder: Path = Path()) -> np.ndarray:
    """Read places for sources or sinks from a drawing or a picture.

    Parameters
    ----------
    text : str
        Name of the file.
    cell : (rows, columns)
    folder : Path
        Where it is sought.
    """
    path = _existing(text, folder, "the file of places")
    if path.suffix.lower() == ".svg":
        return ts.motif.places_in_drawing(path, cell)
    return ts.motif.places_in_picture(read_theme(path), cell)


def _existing(text: str, folder: Path, what: str) -> Path:
    path = folder / text
    if not path.suffix or not path.exists():
        raise ts.OptionError(
            f"{what} is {text!r}, and there is no such file; give a picture or an .svg"
            + (f", or one of {', '.join(ts.motif.OUTLINES)}" if what == "--outline" else "")
        )
    return path
