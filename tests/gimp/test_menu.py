"""The menu: its order, and when GIMP lets its entries be chosen."""

import pytest
from inside import succeeded
from running import needs_gimp

from toposeam_gimp.procedures import PROCEDURES

needs_gimp()

#: Submenus and entries as they stand.
ORDER = {
    "Layers": ("stitch", "restitch", "patch", "loop"),
    "Textures": ("synthesize", "tile", "fill"),
    "Wallpapers": ("motif", "repeat"),
}
NAMES = [f"plug-in-toposeam-{name}" for names in ORDER.values() for name in names]


def test_entries_stand_in_an_order(gimp):
    found = gimp.procedures()
    assert set(found) == set(NAMES)
    places = {}
    for name, one in found.items():
        (places[name],) = one["paths"]
    # GIMP sorts by path; what stands in brackets is not seen.
    assert sorted(places, key=lambda name: places[name].replace("_", "")) == NAMES
    for menu, names in ORDER.items():
        for name in names:
            path = places[f"plug-in-toposeam-{name}"].replace("_", "")
            assert path.startswith(f"<Image>/Filters/TopoSeam/{menu}/[")


#: How many layers are selected, and the entries that can be chosen then; in an image with colours.
CHOOSABLE = {
    "none": {"motif"},
    "one": {"restitch", "patch", "synthesize", "tile", "fill", "motif", "repeat", "loop"},
    "two": {"stitch", "restitch", "motif", "repeat", "loop"},
}


def test_entries_can_be_chosen_where_they_can_work(gimp):
    code = """
kinds = Gimp.ProcedureSensitivityMask
kinds = {"one": kinds.DRAWABLE, "two": kinds.DRAWABLES, "none": kinds.NO_IMAGE}
answer = {}
for name in names:
    procedure = Gimp.get_pdb().lookup_procedure(name)
    mask = int(procedure.get_sensitivity_mask())
    allowed = [kind for kind, bit in kinds.items() if mask & int(bit)]
    answer[name] = [allowed, procedure.get_image_types()]
"""
    found = gimp.python(code=code, names=NAMES)
    for selected, names in CHOOSABLE.items():
        allowed = {name.rpartition("-")[2] for name, (kinds, _types) in found.items() if selected in kinds}
        assert allowed == names, selected
    for name, (_kinds, types) in found.items():
        assert types == ("*" if name.endswith("motif") else "RGB*, GRAY*")


def test_the_result_is_selected(gimp, image, still_life):
    loaded = image(still_life, offsets=[(0, 0), (310, 0)])
    selected = "answer = [layer.get_id() for layer in image_of(number).get_selected_layers()]"
    group = succeeded(
        gimp.run(
            procedure=NAMES[0],
            image=loaded["image"],
            layers=loaded["layers"],
            options={"blend": "feather"},
        )
    )["layer"]
    assert gimp.python(code=selected, number=loaded["image"]) == [group]
    again = gimp.run(procedure=NAMES[1], image=loaded["image"], layers=[group])
    assert succeeded(again)["layer"] == group
    assert gimp.python(code=selected, number=loaded["image"]) == [group]


@pytest.mark.parametrize("language", ["en", "ko"])
def test_submenus_sort_as_they_should(language):
    import gettext
    from pathlib import Path

    import toposeam_gimp

    folder = Path(toposeam_gimp.__file__).parent / "locale"
    texts = gettext.translation("toposeam_gimp", folder, [language], fallback=True)
    menus = list(dict.fromkeys(texts.gettext(entry.menu).replace("_", "") for entry in PROCEDURES.values()))
    assert menus == sorted(menus)
    assert len(menus) == 3
