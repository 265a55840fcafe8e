"""Pictures for the GIMP tests."""

import numpy as np
import pyvips


def photograph(height, width, seed=0):
    """(H, W, 3) uint8, smooth with structure at several scales."""
    rng = np.random.default_rng(seed)
    picture = np.zeros((height, width, 3))
    for cell in (64, 32, 16, 8, 4):
        coarse = rng.random((height // cell + 3, width // cell + 3, 3))
        rows, columns = np.arange(height) / cell, np.arange(width) / cell
        y, x = rows.astype(int), columns.astype(int)
        v, u = (rows - y)[:, None, None], (columns - x)[None, :, None]
        top = coarse[y][:, x] * (1 - u) + coarse[y][:, x + 1] * u
        bottom = coarse[y + 1][:, x] * (1 - u) + coarse[y + 1][:, x + 1] * u
        picture += cell * (top * (1 - v) + bottom * v)
    picture -= picture.min()
    return np.round(picture * 255 / picture.max()).astype(np.uint8)


def write_png(path, pixels):
    pyvips.Image.new_from_array(pixels).copy(interpretation="srgb").write_to_file(str(path))


def crops(folder, picture, places, width, height):
    """Overlapping pieces of a picture as files, and where they lie."""
    files = []
    for index, (x, y) in enumerate(places):
        files.append(folder / f"crop{index}.png")
        write_png(files[-1], picture[y : y + height, x : x + width])
    return files, [list(place) for place in places]
