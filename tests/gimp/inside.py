"""What tests in a real GIMP ask again and again."""

import subprocess
import sys

import numpy as np

STITCH = "plug-in-toposeam-stitch"
#: Where the two halves of the still life belong.
STILL_LIFE = (0, 0), (310, -6)


def cli(*arguments):
    """Run the command line."""
    command = [sys.executable, "-m", "toposeam_cli", *map(str, arguments)]
    subprocess.run(command, check=True, capture_output=True)


def succeeded(result):
    assert result["status"] == "success", result["message"]
    return result


def refused(gimp, loaded, phrase, procedure=STITCH, options=None):
    """The procedure fails with a sentence that says what to do; the image and the temporary folder are as
    before.
    """
    before = gimp.tree(image=loaded["image"])
    result = gimp.run(procedure=procedure, image=loaded["image"], layers=loaded["layers"], options=options)
    assert result["status"] == "execution-error"
    assert phrase in result["message"]
    assert "; " in result["message"] or ". " in result["message"] or ", " in result["message"]
    assert gimp.tree(image=loaded["image"]) == before
    assert not gimp.leftovers()


def mask_of(gimp, layer):
    """(H, W) uint8; of a layer without a mask, everywhere white."""
    code = "layer = item(number); answer = [layer.get_mask() and layer.get_mask().get_id(), layer.get_id()]"
    mask, own = gimp.python(code=code, number=layer)
    if mask is None:
        return np.full(gimp.pixels(own, "R'G'B'A u8")[0].shape[:2], 255, np.uint8)
    return gimp.pixels(mask, "Y u8")[0][..., 0]


def shown(gimp, layers):
    """Where each of the layers, the lowest first, is seen under its mask and below the others: (H, W) uint8
    each.
    """
    found, above = [], []
    for layer in reversed(layers):
        _pixels, (x, y) = gimp.pixels(layer, "R'G'B'A u8")
        mask = mask_of(gimp, layer).copy()
        height, width = mask.shape
        for other, (left, top) in above:
            box = np.s_[
                max(top - y, 0) : max(top - y + other.shape[0], 0),
                max(left - x, 0) : max(left - x + other.shape[1], 0),
            ]
            own = np.s_[
                max(y - top, 0) : max(y - top + height, 0), max(x - left, 0) : max(x - left + width, 0)
            ]
            mask[box][other[own] > 0] = 0
        above.append((mask, (x, y)))
        found.insert(0, mask)
    return found


def covers_once(low, high, x, y):
    """Whether exactly one of two masks shows at every pixel; the upper one lies x px to the right and y px
    above.
    """
    canvas = np.zeros((max(low.shape[0] + y, high.shape[0]), high.shape[1] + x), int)
    canvas[y : y + low.shape[0], : low.shape[1]] += low
    canvas[: high.shape[0], x:] += high
    covered = np.zeros(canvas.shape, bool)
    covered[y : y + low.shape[0], : low.shape[1]] = True
    covered[: high.shape[0], x:] = True
    return (canvas[covered] == 255).all()
