"""Pictures from which a motif takes its shape or its colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import toposeam as ts
from toposeam.colours import parse_colour
from toposeam.motif.ink.palettes import Palette
from toposeam_cli.media.pictures.picture import MAX_MOTIF, read_within
from toposeam_cli.motifs.swatches import read_swatches


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
    """Return the picture of a theme as a motif's base, with its alpha if it has one.

    Raises
    ------
    ImageError
        If it shows nothing, or as :func:`~toposeam_cli.media.pictures.picture.read_within` raises it.
    """
    picture = read_within(path, MAX_MOTIF)
    if picture.alpha is None:
        return picture.pixels
    if not picture.covered().any():
        raise ts.ImageError(f"'{path}' is transparent everywhere; give one that shows something")
    return np.concatenate([np.atleast_3d(picture.pixels), picture.alpha[..., None]], axis=2)
