"""Loop Animation in a real GIMP."""

import numpy as np
import pytest
from inside import refused, succeeded
from pictures import write_png
from running import needs_gimp

import toposeam as ts

needs_gimp()

LOOP = "plug-in-toposeam-loop"


@pytest.fixture
def clip(tmp_path):
    """Sixteen frames of waves that come back after eight."""
    y, x = np.mgrid[:24, :32]
    frames = []
    for time in range(16):
        phase = 2 * np.pi * time / 8
        wave = 128 + 60 * np.sin(x / 4 + phase) + 40 * np.cos(y / 3 - phase)
        frames.append(np.dstack([wave, wave // 2, 255 - wave]).astype(np.uint8))
        write_png(tmp_path / f"{time:02}.png", frames[-1])
    return np.stack(frames), [tmp_path / f"{time:02}.png" for time in range(16)]


def test_layers_become_a_loop_as_core_makes_it(gimp, image, clip):
    frames, files = clip
    loaded = image(files)
    name = "image_of(number).get_layers()[index].set_name('later (80ms)')"
    for index in range(16):
        gimp.python(code=name, number=loaded["image"], index=index)
    before = gimp.tree(image=loaded["image"])
    options = {"length": 8, "transition": 4}
    result = succeeded(
        gimp.run(procedure=LOOP, image=loaded["image"], layers=loaded["layers"][:1], options=options)
    )
    assert gimp.tree(image=loaded["image"]) == before
    number = gimp.python(code="answer = item(number).get_image().get_id()", number=result["layer"])
    layers = gimp.tree(image=number)["layers"][::-1]
    expected = ts.loop(frames, length=8, transition=4)
    assert [layer["name"] for layer in layers] == [f"Frame {index + 1} (80ms)" for index in range(8)]
    for layer, frame in zip(layers, expected.frames, strict=True):
        np.testing.assert_array_equal(gimp.pixels(layer["id"], "R'G'B'A u8")[0][..., :3], frame)
    gimp.delete(image=number)


def test_a_picture_is_no_clip(gimp, image, clip):
    refused(gimp, image(clip[1][:1]), "has a layer for each frame", LOOP)


def test_frames_of_another_size(gimp, image, clip):
    loaded = image(clip[1])
    gimp.python(code="item(number).resize(20, 20, 0, 0)", number=loaded["layers"][3])
    refused(gimp, loaded, "is not of the image's size", LOOP)
