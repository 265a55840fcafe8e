"""The font of texts that are drawn into pictures."""

from __future__ import annotations

from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

#: Common fonts of systems, for titles beyond ASCII.
_FONTS = (
    *("NotoSansCJK-Regular.ttc", "DejaVuSans.ttf", "NotoSans-Regular.ttf", "arial.ttf", "Arial.ttf"),
    *("malgun.ttf", "AppleSDGothicNeo.ttc"),
)


def font_for(text: str, side: float) -> Any:
    """Return Pillow's own font, which has ASCII; for other texts one of the system's or matplotlib's, if
    there is one.

    Parameters
    ----------
    text : str
    side : float
        Size of the font, px.
    """
    from PIL import ImageFont

    if not text.isascii():
        places = [] if (spec := find_spec("matplotlib")) is None else spec.submodule_search_locations or []
        own = [str(Path(place) / "mpl-data/fonts/ttf/DejaVuSans.ttf") for place in places]
        for name in (*_FONTS, *own):
            with suppress(OSError):
                return ImageFont.truetype(name, side)
    return ImageFont.load_default(side)
