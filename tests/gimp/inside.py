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
    """(H, W) uint8."""
    mask = gimp.python(code="answer = item(number).get_mask().get_id()", number=layer)
    return gimp.pixels(mask, "Y u8")[0][..., 0]


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
