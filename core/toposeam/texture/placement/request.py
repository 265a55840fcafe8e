"""The options that synthesis, tiles and filled holes have in common, validated once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.checks import Seed, check_items, check_whole, options_from, seed_of
from toposeam.errors import OptionError, Term
from toposeam.images import full_scale
from toposeam.texture.canvas.rendering import MAX_SMOOTH
from toposeam.texture.canvas.tileable import Tileable, wraps_of
from toposeam.texture.exemplar.sources import DataRange, Images, Sources, read_sources, white_of
from toposeam.texture.placement.options import VARIED, LayOptions, varied


@dataclass(frozen=True, kw_only=True, eq=False)
class TextureRequest:
    """Options of a texture and what belongs to its exemplars; see :func:`toposeam.synth`."""

    options: LayOptions
    seed: int
    smooth: int
    tileable: Tileable | None
    alpha: Images | None
    maps: tuple[Images, ...]
    normal: Images | None
    weights: Sequence[float] | None
    data_range: DataRange

    @classmethod
    def of(
        cls,
        taker: str,
        options: LayOptions | None,
        given: Mapping[str, Any],
        *,
        seed: Seed,
        smooth: int,
        alpha: Images | None,
        maps: Sequence[Images],
        normal: Images | None,
        weights: Sequence[float] | None,
        data_range: DataRange,
        tileable: Tileable | None = None,
        variation: float | None = None,
    ) -> TextureRequest:
        """Validate what a caller gave.

        Parameters
        ----------
        taker : str
            Name of the public function, for messages.
        options, given
            Its options, or their fields as keywords.
        tileable
            None where the function has no such parameter.

        Raises
        ------
        OptionError
        """
        if tileable is not None:
            wraps_of(tileable)
        chosen = options_from(LayOptions, options, given, taker)
        if variation is not None:
            refused = sorted(set(VARIED) & set(given))
            if options is not None or refused:
                raise OptionError(
                    "{parameter} stands for {names}; leave out {refused}, or {parameter}",
                    kind="conflict",
                    parameter=Term("variation"),
                    value=variation,
                    names=tuple(map(Term, VARIED)),
                    refused=tuple(map(Term, refused or ["options"])),
                )
            chosen = varied(chosen, variation)
        return cls(
            options=chosen,
            seed=seed_of(seed),
            smooth=check_whole("smooth", smooth, 0, MAX_SMOOTH),
            tileable=tileable,
            alpha=alpha,
            maps=check_items("maps", maps, object, "a sequence of images, one a map"),
            normal=normal,
            weights=weights,
            data_range=data_range,
        )

    def varied(self, variation: float, *, close: bool | None = None) -> TextureRequest:
        """Return the request with the options that a variation stands for, and order kept or not."""
        close = self.options.close if close is None else self.options.close and close
        return replace(self, options=replace(varied(self.options, variation), close=close))

    @property
    def wraps(self) -> tuple[bool, bool]:
        """True if rows, and whether columns, continue at the opposite border."""
        return (False, False) if self.tileable is None else wraps_of(self.tileable)

    @property
    def rng(self) -> np.random.Generator:
        """Make a new generator of the seed."""
        return np.random.default_rng(self.seed)

    @property
    def white(self) -> list[float | None]:
        """The value that counts as white in the picture, each map and the normals; None where its dtype says
        it.
        """
        return white_of(self.data_range, 1 + len(self.maps) + (self.normal is not None))

    def white_of(self, sources: Sources) -> float:
        """Return the value that counts as white in the picture."""
        return float(self.white[0] or full_scale(sources.planes[0][0].dtype))

    @property
    def settings(self) -> dict[str, Any]:
        """Return what a result keeps of it, as numbers and texts."""
        tileable = {} if self.tileable is None else {"tileable": self.tileable}
        fields = [name for name in LayOptions.__dataclass_fields__ if name != "cost"]
        options = {name: getattr(self.options, name) for name in fields}
        return {"seed": self.seed, **tileable, "smooth": self.smooth, **options}

    def read(
        self,
        image: Images,
        mask: Images | npt.NDArray[np.bool_] | None,
        name: str,
        *,
        transparent: bool = False,
        features: bool = True,
    ) -> Sources:
        """Read exemplars with what belongs to them (:func:`read_sources`)."""
        return read_sources(
            image,
            alpha=self.alpha,
            mask=mask,
            maps=self.maps,
            normal=self.normal,
            weights=self.weights,
            data_range=self.data_range,
            name=name,
            transparent=transparent,
            features=features,
        )
