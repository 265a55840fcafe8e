"""Find the homography of two pictures from features that match: RANSAC, and the test of Brown and Lowe."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toposeam.arrays import Floats, Mask

#: Trials of RANSAC at least and at most, trials of a batch, and the probability of having drawn inliers only.
_TRIALS, _BATCH, _CONFIDENCE = (1000, 2000), 250, 0.999
#: Best homographies of a batch that are fitted to all that agree: with parallax many do about as well.
_LEADERS = 2
#: Fits of a homography to all that agree, at most.
_FITS = 6
#: A pair is verified by more inliers than the number plus the share of all matches in the overlap (Brown and
#: Lowe 2007, doi:10.1007/s11263-006-0002-3, equation 13).
LEAST_INLIERS, _LEAST_INLIER_SHARE = 8, 0.22
#: Largest scale between two pictures of one scene.
_LARGEST_SCALE = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Homography:
    """The homography of two pictures, and the matches that agree."""

    #: (3, 3): takes points of the second picture to the first.
    matrix: Floats
    #: (M,) bool: the matches that agree.
    inliers: Mask
    #: Matches in the overlap.
    overlap: int

    @property
    def verified(self) -> bool:
        """Whether more matches agree than those of wrong pairs do by chance."""
        return enough(int(self.inliers.sum()), self.overlap)


def enough(inliers: int, overlap: int) -> bool:
    """Test whether more of the matches in an overlap agree than those of wrong pairs do by chance."""
    return inliers > LEAST_INLIERS + _LEAST_INLIER_SHARE * overlap


def applied(matrix: Floats, points: Floats) -> Floats:
    """Map (..., M, 2) points by (..., 3, 3) homographies; points at infinity come to lie far away."""
    result = points @ np.swapaxes(matrix[..., :2], -1, -2) + matrix[..., np.newaxis, :, 2]
    return np.asarray(result[..., :2] / _not_zero(result[..., 2:]))


def _not_zero(w: Floats) -> Floats:
    return np.where(np.abs(w) < 1e-12, 1e-12, w)


def find_homography(
    first: Floats, second: Floats, sizes: tuple[tuple[int, int], tuple[int, int]], tolerance: float
) -> Homography | None:
    """Find the homography that most matches agree to.

    Parameters
    ----------
    first, second : (M, 2) float arrays
        x and y of matching features, px.
    sizes : two of (int, int)
        Width and height of the pictures.
    tolerance : float
        A match that is farther off, px, does not agree.

    Returns
    -------
    Homography or None
        None where no homography of two pictures of one scene is found.
    """
    if len(first) < LEAST_INLIERS:
        return None
    norms = [_normalising(points) for points in (first, second)]
    a, b = (applied(norm, points) for norm, points in zip(norms, (first, second), strict=True))
    inliers = _most_inliers(a, b, (tolerance * norms[0][0, 0]) ** 2)
    if inliers is None:
        return None
    matrix = least_squares_homography(first[inliers], second[inliers])
    local = areas(matrix, second[inliers])
    if not (1 / _LARGEST_SCALE**2 < np.median(local) < _LARGEST_SCALE**2) or local.min() <= 0:
        return None
    inverse = np.asarray(np.linalg.inv(matrix), float)
    overlap = within(applied(matrix, second), sizes[0]) | within(applied(inverse, first), sizes[1])
    return Homography(matrix, inliers, int(overlap.sum()))


def _most_inliers(a: Floats, b: Floats, near: float) -> Mask | None:
    """Find the matches that agree with the best homography through four matches.

    The best ones of each batch are fitted to all that agree (LO-RANSAC; Chum, Matas and Kittler 2003). The
    search ends as if there were at least as many inliers as verify a pair.
    """
    rng = np.random.default_rng(0)
    best = np.zeros(len(a), bool)
    least, most = _TRIALS
    for trials in range(_BATCH, most + 1, _BATCH):
        chosen = rng.integers(len(a), size=(_BATCH, 4))  # of which the same twice is singular
        agree = _squares_off(_through_four(a[chosen], b[chosen]), a, b) < near
        for leader in agree[np.argsort(-agree.sum(axis=1), kind="stable")[:_LEADERS]]:
            fitted = _refit(a, b, leader, near)
            if fitted.sum() > best.sum():
                best = fitted
        missed = 1 - (max(int(best.sum()), LEAST_INLIERS) / len(a)) ** 4
        if trials >= least and missed**trials < 1 - _CONFIDENCE:
            break
    return best if best.sum() >= LEAST_INLIERS else None


def _refit(a: Floats, b: Floats, agreeing: Mask, near: float) -> Mask:
    """Fit a homography to the agreeing matches, find those that agree with it, until they stay the same."""
    for _ in range(_FITS):
        if agreeing.sum() < LEAST_INLIERS:
            break
        before, agreeing = agreeing, _squares_off(_least_squares(a[agreeing], b[agreeing]), a, b) < near
        if (before == agreeing).all():
            break
    return agreeing


def _squares_off(matrices: Floats, a: Floats, b: Floats) -> Floats:
    """Square the distances of points `a` from `b` mapped by (..., 3, 3) homographies: (..., M)."""
    x, y, w = np.moveaxis(matrices @ np.append(b, np.ones((len(b), 1)), axis=1).T, -2, 0)
    w = _not_zero(w)
    return np.asarray(np.square(x / w - a[:, 0]) + np.square(y / w - a[:, 1]))


def least_squares_homography(a: Floats, b: Floats) -> Floats:
    """Fit the (3, 3) homography that takes (M, 2) points `b` to about `a`."""
    norms = [_normalising(points) for points in (a, b)]
    normal = _least_squares(applied(norms[0], a), applied(norms[1], b))
    matrix = np.linalg.inv(norms[0]) @ normal @ norms[1]
    return np.asarray(matrix / matrix[2, 2])


def _through_four(a: Floats, b: Floats) -> Floats:
    """Solve for the (K, 3, 3) homographies that take (K, 4, 2) points `b` to `a`; leave out singular ones."""
    system = _equations(a, b)
    left, right = system[..., :8], -system[..., 8:]
    regular = np.abs(np.linalg.det(left)) > 1e-9
    entries = np.linalg.solve(left[regular], right[regular])[..., 0]
    return np.append(entries, np.ones((len(entries), 1)), axis=1).reshape(len(entries), 3, 3)


def _least_squares(a: Floats, b: Floats) -> Floats:
    """Fit a homography to (M, 2) points by the direct linear transform (:func:`least_squares_homography`)."""
    equations = _equations(a, b)
    matrix = np.linalg.eigh(equations.T @ equations)[1][:, 0].reshape(3, 3)
    return np.asarray(matrix / matrix[2, 2])


def _equations(a: Floats, b: Floats) -> Floats:
    """Return the (..., 2 M, 9) equations for the entries of homographies."""
    (u, v), (x, y) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    one, none = np.ones_like(x), np.zeros_like(x)
    return np.concatenate(
        [
            np.stack([x, y, one, none, none, none, -u * x, -u * y, -u], axis=-1),
            np.stack([none, none, none, x, y, one, -v * x, -v * y, -v], axis=-1),
        ],
        axis=-2,
    )


def _normalising(points: Floats) -> Floats:
    """Return the (3, 3) shift and scale that take points to mean 0 and standard deviation 1."""
    middle, scale = points.mean(axis=0), 1 / max(float(points.std()), 1e-6)
    return np.array([[scale, 0, -scale * middle[0]], [0, scale, -scale * middle[1]], [0, 0, 1]])


def areas(matrix: Floats, points: Floats) -> Floats:
    """Compute the factor by which a homography enlarges areas at points, (M,); negative where it mirrors."""
    w = points @ matrix[2, :2] + matrix[2, 2]
    return np.asarray(np.linalg.det(matrix) / w**3)


def within(points: Floats, size: tuple[int, int]) -> Mask:
    """Test which points lie on a picture of that width and height: (M,)."""
    return np.asarray(((points >= 0) & (points <= np.array(size) - 1)).all(axis=-1))
