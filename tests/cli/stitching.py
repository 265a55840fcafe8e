"""What the tests beside this have in common."""

import json

import numpy as np
from PIL import ImageCms
from scipy import ndimage

from toposeam_cli.media.pictures.picture import Picture, match_pictures, read_picture, write_picture

PROFILE = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()


STRIP = ("a.png", "b.png", "--overlap", "20")


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def told(ran):
    """What a run with --json printed, which ended well."""
    assert ran.code == 0, ran
    return json.loads(ran.out)


def shown(path):
    """The mask that --labels wrote: True where B shows."""
    values = read_picture(path).pixels
    assert values.ndim == 2
    assert set(np.unique(values)) <= {0, 255}
    return values == 255


def assert_joined(path, labels, first, second, offset):
    """Every pixel of a written picture is, bit for bit, that of the layer that shows there; nothing is lost
    and nothing made up.
    """
    a, b = match_pictures([read_picture(first), read_picture(second)])
    result = read_picture(path)
    left, top = min(0, offset[0]), min(0, offset[1])
    shape = [
        max(a.pixels.shape[axis], offset[1 - axis] + b.pixels.shape[axis]) - (top, left)[axis]
        for axis in (0, 1)
    ]
    assert list(result.pixels.shape[:2]) == shape
    expected = np.zeros(result.pixels.shape, a.pixels.dtype)
    opacity = np.zeros(shape, a.pixels.dtype)
    b_shows = shown(labels)
    for picture, (x, y), shows in ((a, (0, 0), ~b_shows), (b, offset, b_shows)):
        height, width = picture.pixels.shape[:2]
        place = np.s_[y - top : y - top + height, x - left : x - left + width]
        full = np.ones(1, a.pixels.dtype) if a.pixels.dtype == np.float32 else np.iinfo(a.pixels.dtype).max
        alpha = np.full((height, width), full, a.pixels.dtype) if picture.alpha is None else picture.alpha
        here = shows[place] & picture.covered()
        expected[place][here] = picture.pixels[here]
        opacity[place][here] = alpha[here]
    assert result.pixels.dtype == expected.dtype
    np.testing.assert_array_equal(result.pixels, expected)
    if result.alpha is None:
        assert (opacity == full).all()
    else:
        np.testing.assert_array_equal(result.alpha, opacity)


def make_six(folder, width, height):
    """Six pictures, three by two, that overlap by 30 %, and a layout that says so."""
    rng = np.random.default_rng(1)
    steps = int(0.7 * width), int(0.7 * height)
    scene = ndimage.zoom(rng.random((100, 120, 3)), (8, 8, 1), order=1)
    lines = []
    for index in range(6):
        row, column = divmod(index, 3)
        x, y = column * steps[0], row * steps[1]
        part = np.roll(scene, (-y, -x), axis=(0, 1)) * rng.uniform(150, 240)
        part = np.clip(part + rng.normal(0, 3, part.shape), 0, 255).astype(np.uint8)
        part = np.tile(part, (height // 800 + 1, width // 960 + 1, 1))[:height, :width]
        write_picture(folder / f"{index}.tif", Picture(pixels=part), compression="none")
        lines.append(f'[[layer]]\nfile = "{index}.tif"\nat = [{x}, {y}]\n')
    (folder / "six.toml").write_text("\n".join(lines))
