"""Every entry on images that are tiny, odd or in the way: a result, or a sentence and the image as it was."""

import pytest
from pictures import photograph, write_png
from running import needs_gimp

from toposeam_gimp.entries.table import PROCEDURES

needs_gimp()

#: What is done to an image of two layers of 60 × 50 px, 20 px apart, before an entry is called.
CASES = {
    "5 px": "image.scale(7, 5)",
    "1 px": "image.crop(1, 1, 30, 20)",
    "beside the canvas": "[layer.set_offsets(500, 400) for layer in image.get_layers()]",
    "transparent": "[layer.fill(Gimp.FillType.TRANSPARENT) for layer in image.get_layers()]",
    "one colour": "[layer.fill(Gimp.FillType.WHITE) for layer in image.get_layers()]",
    "locked": "[layer.set_lock_content(True) for layer in image.get_layers()]",
    "one selected pixel": "image.select_rectangle(Gimp.ChannelOps.REPLACE, 30, 20, 1, 1)",
    "all selected": "Gimp.Selection.all(image)",
    "gray": "image.convert_grayscale()",
    "indexed": "image.convert_indexed(Gimp.ConvertDitherType.NONE, Gimp.ConvertPaletteType.MONO, 2, 0, 0, "
    "'')",
    "half floats": "image.convert_precision(Gimp.Precision.HALF_LINEAR)",
    "empty mask": "for layer in image.get_layers():\n"
    "    layer.add_mask(layer.create_mask(Gimp.AddMaskType.BLACK))",
    "hidden": "[layer.set_visible(False) for layer in image.get_layers()]",
    "a group": "group = Gimp.GroupLayer.new(image, 'group')\nimage.insert_layer(group, None, 0)\n"
    "image.reorder_item(item(numbers[-1]), group, 0)\nnumbers[-1] = group.get_id()",
    "an empty group": "group = Gimp.GroupLayer.new(image, 'group')\nimage.insert_layer(group, None, 0)\n"
    "numbers[-1] = group.get_id()",
    "a floating selection": "image.select_rectangle(Gimp.ChannelOps.REPLACE, 25, 5, 20, 20)\n"
    "numbers[-1] = Gimp.Selection.float(image, [item(numbers[-1])], 2, 2).get_id()",
}
SMALL = {
    "synthesize": {"width": 32, "height": 32, "patch": 12},
    "motif": {"size": 32, "iterations": 1, "use-layer": True},
    "fill": {"patch": 8},
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_every_entry_gives_a_result_or_a_sentence(gimp, image, tmp_path, case):
    for index in range(2):
        write_png(tmp_path / f"{index}.png", photograph(50, 60, index))
    surprises = []
    for name, entry in PROCEDURES.items():
        loaded = image([tmp_path / "0.png", tmp_path / "1.png"], offsets=[(0, 0), (20, 0)])
        code = "image = image_of(number)\n" + CASES[case] + "\nanswer = numbers"
        layers = gimp.python(code=code, number=loaded["image"], numbers=loaded["layers"])
        before = gimp.tree(image=loaded["image"])
        options = SMALL.get(name.rpartition("-")[2])
        several = entry.needs == "several"
        result = gimp.run(
            procedure=name, image=loaded["image"], layers=layers if several else layers[-1:], options=options
        )
        if result["status"] != "success":
            said = result["message"] or ""
            changed = gimp.tree(image=loaded["image"]) != before
            if changed or "Something went wrong" in said or not said.endswith("."):
                surprises.append((name, said, "changed" if changed else ""))
    assert not surprises
    assert not gimp.leftovers()
