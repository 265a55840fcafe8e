"""Steps that levelling leaves at seams, eased into the copies on both sides.

The correction that is added to the copies solves a screened Poisson equation. Across a seam it has the step
that makes the picture's gradient the mean of both copies' gradients there; within a copy it has none, and it
dies away with the distance. On a plane, a cylinder or a torus that is one transform each way. Steps that
change quickly along a seam, as at the ends of fibres, are eased within a few pixels; steps that hardly
change, as of light, are eased as far as the screening length.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats32, Ints32, Mask
from toposeam.heat.poisson import add_steps, spread
from toposeam.texture.canvas.copy_borders import ROWS, joints
from toposeam.texture.canvas.rendering import Lift
from toposeam.texture.exemplar.sources import Sources
from toposeam.texture.light.slow_light import CopyLight, has_slow_light

#: Screening length, px: distance over which an eased step dies away.
_REACH = 12.0
#: Step, as a share of white, of which half is eased; much larger ones are edges.
_HALF_EASED = 0.3
#: Shorter periods, px, are fine detail, and largest share of its variance that a smooth sample has there.
_FINE_PERIOD, _MOST_FINE = 8, 0.1
#: Standard deviation, px, of the blur before gradients are taken.
_GRADIENT_BLUR = 1.5
#: Largest variance of gradients along fibres, as a share of that across them.
_MOST_ALONG = 0.05

#: Whether light is levelled, or steps are eased only.
Level = bool | Literal["steps"]


def level_for(sources: Sources) -> Level:
    """Choose what exemplars need, by their pictures alone, whatever their maps are like: light levelled where
    it is slow, and between fibres; steps eased where they are smooth.
    """
    if not sources.own_features:
        return False
    pictures = [values[..., : sources.own_features] for values in sources.features]
    if any(map(has_slow_light, pictures, sources.usable)):
        return True
    if all(map(is_fibrous, pictures, sources.usable)):
        return True
    return "steps" if all(map(is_smooth, pictures, sources.usable)) else False


def is_smooth(features: Floats32, usable: Mask) -> bool:
    """Test whether a sample has so little fine detail that steps would be seen.

    Parameters
    ----------
    features : (H, W, F) float32 array
    usable : (H, W) bool array

    Examples
    --------
    >>> wave = np.sin(np.arange(64, dtype=np.float32) / 4)[:, np.newaxis, np.newaxis].repeat(64, 1)
    >>> is_smooth(wave, np.ones((64, 64), bool)), is_smooth(wave[::4], np.ones((16, 64), bool))
    (True, False)
    """
    window = np.multiply.outer(*map(np.hanning, usable.shape))
    values = _brightness(features, usable)
    power = np.square(np.abs(np.fft.fft2((values - values.mean()) * window)))
    power[0, 0] = 0
    frequency = np.hypot(*np.meshgrid(*map(np.fft.fftfreq, usable.shape), indexing="ij"))
    return bool(power[frequency > 1 / _FINE_PERIOD].sum() <= _MOST_FINE * power.sum())


def is_fibrous(features: Floats32, usable: Mask) -> bool:
    """Test whether all of a sample runs in one direction, along which hardly anything changes: where patches
    meet, fibres of unlike brightness would end in steps.

    The two eigenvalues of the structure tensor tell it (Bigün and Granlund 1987).

    Parameters
    ----------
    features : (H, W, F) float32 array
    usable : (H, W) bool array

    Examples
    --------
    >>> across = np.random.default_rng(0).random((1, 64, 1), np.float32)
    >>> is_fibrous(across.repeat(64, 0), np.ones((64, 64), bool))
    True
    >>> is_fibrous(across.repeat(64, 0) + across.swapaxes(0, 1), np.ones((64, 64), bool))
    False
    """
    values = _brightness(features, usable)
    down, right = (
        ndimage.gaussian_filter(values, _GRADIENT_BLUR, order=order)[usable] for order in ((1, 0), (0, 1))
    )
    least, most = np.linalg.eigvalsh(np.cov(np.stack([down, right]), bias=True))
    return bool(most > 0 and least <= _MOST_ALONG * most)


def _brightness(features: Floats32, usable: Mask) -> Floats32:
    """Compute the mean of the features, (H, W); their mean over the sample where it is not usable."""
    result: Floats32 = np.where(usable, features.mean(axis=2), features[usable].mean())
    return result


class EasedLight:
    """The light of a texture's copies, with the steps at seams eased; one channel at a time, since that of a
    large canvas takes more memory than the canvas.

    Parameters
    ----------
    plane : (AH, AW, C) float32 array
        The sample.
    light : CopyLight
        The light that copies are given.
    index, labels : (H, W) int32 arrays
        Flat index and number of the patch that show at each pixel.
    wraps : (bool, bool)
        Whether rows and columns continue at the opposite border.
    """

    def __init__(
        self, plane: Floats32, light: CopyLight, index: Ints32, labels: Ints32, wraps: tuple[bool, bool]
    ) -> None:
        self._light, self._index, self._labels, self._wraps = light, index, labels, wraps
        self._steps = [
            (first.astype(np.int32), second.astype(np.int32), self._step(plane, first, second, step))
            for first, second, step in joints(index, light.atlas.width, wraps)
        ]

    def __call__(self, channel: int) -> Lift:
        """Return the light of a channel."""
        light = self._light
        gain = np.empty((*self._index.shape, 1), np.float32)
        offset = self._spread(channel)[..., np.newaxis]
        for first in range(0, len(gain), ROWS):
            rows = slice(first, first + ROWS)
            gain[rows] = light.gain(self._index[rows], self._labels[rows])
            offset[rows] += light.offset(gain[rows])
        return Lift(gain=gain, offset=offset, low=light.low, high=light.high)

    def _step(
        self,
        plane: Floats32,
        first: npt.NDArray[np.intp],
        second: npt.NDArray[np.intp],
        step: int,
    ) -> Floats32:
        """Compute the correction of the steps (n, C) from some pixels to their neighbours."""
        light, flat, usable = self._light, plane.reshape(-1, plane.shape[2]), self._light.atlas.usable.ravel()
        p, q = self._index.take(first), self._index.take(second)
        ahead, behind = np.minimum(p + step, len(flat) - 1), np.maximum(q - step, 0)
        known = np.stack([usable[ahead], usable[behind]], axis=1).astype(np.float32)
        gain = light.gain(p, self._labels.take(first))
        offset = light.offset(gain)
        here, after = gain * flat[p] + offset, gain * flat[ahead] + offset
        gain = light.gain(q, self._labels.take(second))
        offset = light.offset(gain)
        before, there = gain * flat[behind] + offset, gain * flat[q] + offset
        apart = (after - there) * known[:, :1] + (here - before) * known[:, 1:]
        apart /= np.maximum(known.sum(axis=1, keepdims=True), 1)
        white = (light.high - light.low) or 1.0
        apart /= 1 + (np.abs(apart).max(axis=1, keepdims=True) / (_HALF_EASED * white)) ** 4
        result: Floats32 = apart.astype(np.float32, copy=False)
        return result

    def _spread(self, channel: int) -> Floats32:
        wanted = np.zeros(self._index.shape, np.float32)
        for first, second, step in self._steps:
            add_steps(wanted.reshape(-1), first, second, -step[:, channel])
        result: Floats32 = spread(wanted, _REACH, self._wraps)
        return result
