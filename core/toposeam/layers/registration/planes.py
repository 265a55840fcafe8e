"""Find the planes of a scene that two pictures show: homographies, one after another.

Where a photographer walked, each plane of the scene has a homography of its own, and none of them brings most
matches together. The matches that one homography leaves are searched for the next one (sequential RANSAC;
Vincent and Laganière 2001, doi:10.1109/ISPA.2001.938625). Planes of one scene lie not far from each other, as
parallax is bounded; a homography that moves its own matches far from where the first one puts them is of
something that repeats itself.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from toposeam.arrays import Floats
from toposeam.layers.registration.homography import Homography, applied, enough, find_homography

#: Width and height of two pictures, px.
_Sizes = tuple[tuple[int, int], tuple[int, int]]


def find_planes(
    first: Floats,
    second: Floats,
    sizes: _Sizes,
    tolerance: float,
    *,
    most: int = 3,
    least: int = 15,
    parallax: float = 0.12,
) -> list[Homography]:
    """Find the homographies of the planes that matches lie on, the one with most matches first.

    Parameters
    ----------
    first, second : (M, 2) float arrays
        x and y of matching features, px.
    sizes : two of (int, int)
        Width and height of the pictures.
    tolerance : float
        A match that is farther off, px, does not lie on a plane.
    most : int
        Planes at most.
    least : int
        Matches of a plane at least. Of unrelated pictures 12 at most agree by chance.
    parallax : float
        Largest distance, in the median, between where a plane's own homography and the first one put its
        matches, as a share of the first picture's diagonal.

    Returns
    -------
    list of Homography
        No match is an inlier of two of them.
    """
    found: list[Homography] = []
    left = np.arange(len(first))
    farthest = parallax * float(np.hypot(*sizes[0]))
    while len(found) < most:
        plane = find_homography(first[left], second[left], sizes, tolerance)
        if plane is None or plane.inliers.sum() < least:
            break
        own, left = left[plane.inliers], left[~plane.inliers]
        inliers = np.zeros(len(first), bool)
        inliers[own] = True
        if found:
            apart = applied(found[0].matrix, second[own]) - applied(plane.matrix, second[own])
            if np.median(np.hypot(*apart.T)) > farthest:
                continue
        found.append(Homography(plane.matrix, inliers, plane.overlap))
    return found


def together_verified(first: Floats, planes: Sequence[Homography], apart: float = 0.6) -> bool:
    """Test whether planes verify a pair together that none of them verifies alone.

    Their inliers count together, against all matches in the overlap. The matches of a plane lie together in
    the picture; those of something that repeats itself, each some periods off, lie among each other.

    Parameters
    ----------
    first : (M, 2) float array
        x and y of the matches in the first picture, px.
    planes : sequence of Homography
        Of :func:`find_planes`.
    apart : float
        Least share of the inliers whose nearest other inlier lies on the same plane.
    """
    if len(planes) < 2:
        return False
    number = np.concatenate([np.full(int(one.inliers.sum()), k) for k, one in enumerate(planes)])
    points = np.concatenate([first[one.inliers] for one in planes])
    if not enough(len(points), max(one.overlap for one in planes)):
        return False
    # a feature counts once for each of its directions, so the nearest other place is asked for
    places, at = np.unique(points, axis=0, return_index=True)
    _, nearest = scipy.spatial.KDTree(places).query(places, k=2)
    return bool(np.mean(number[at] == number[at[nearest[:, 1]]]) >= apart)
