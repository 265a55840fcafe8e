"""The menu: its order, and when GIMP lets its entries be chosen."""

import gettext
import re
from pathlib import Path

import pytest
from inside import STITCH, succeeded
from running import needs_gimp

import toposeam_gimp
from toposeam_gimp.entries.table import PROCEDURES

needs_gimp()

#: Submenus and entries as they stand.
ORDER = {
    "Layers": ("panorama", "stitch", "hints", "restitch", "patch", "loop"),
    "Textures": ("synthesize", "tile", "fill"),
    "Wallpapers": ("motif", "repeat"),
}
NAMES = [f"plug-in-toposeam-{name}" for names in ORDER.values() for name in names]


def test_entries_stand_in_an_order(gimp):
    found = gimp.procedures()
    assert set(found) == set(NAMES)
    places = {}
    for name, one in found.items():
        places[name], *also = one["paths"]
        assert also == ([PROCEDURES[name].also] if PROCEDURES[name].also else [])
    # GIMP sorts by path; what stands in brackets is not seen.
    assert sorted(places, key=lambda name: places[name].replace("_", "")) == NAMES
    for menu, names in ORDER.items():
        for name in names:
            path = places[f"plug-in-toposeam-{name}"].replace("_", "")
            assert path.startswith(f"<Image>/Filters/TopoSeam/{menu}/[")


#: How many layers are selected, and the entries that can be chosen then; in an image with colours.
CHOOSABLE = {
    "none": {"motif"},
    "one": {"hints", "restitch", "patch", "synthesize", "tile", "fill", "motif", "repeat", "loop"},
    "two": {"panorama", "stitch", "hints", "restitch", "motif", "repeat", "loop"},
}


def test_entries_can_be_chosen_where_they_can_work(gimp):
    code = """
kinds = Gimp.ProcedureSensitivityMask
answer = {"one": int(kinds.DRAWABLE), "two": int(kinds.DRAWABLES), "none": int(kinds.NO_IMAGE)}
"""
    # What GIMP has noted when it asked the plug-in; it does not tell other plug-ins.
    noted = (gimp.profile / "pluginrc").read_text(encoding="utf-8", errors="replace")
    found = {}
    for part in noted.split("(proc-def ")[1:]:
        name = part.split('"')[1]
        if name in NAMES:
            types, mask = re.search(r'\(icon .*\n\s+"(.*)"\n\s+(\d+)\n', part).groups()
            found[name.rpartition("-")[2]] = types, int(mask)
    assert len(found) == len(NAMES)
    for selected, bit in gimp.python(code=code).items():
        assert {name for name, (_types, mask) in found.items() if mask & bit} == CHOOSABLE[selected], selected
    for name, (types, _mask) in found.items():
        assert types == ("*" if name == "motif" else "RGB*, GRAY*")


def test_the_result_is_selected(gimp, image, still_life):
    loaded = image(still_life, offsets=[(0, 0), (310, 0)])
    selected = "answer = [layer.get_id() for layer in image_of(number).get_selected_layers()]"
    group = succeeded(
        gimp.run(
            procedure=STITCH,
            image=loaded["image"],
            layers=loaded["layers"],
            options={"blend": "feather"},
        )
    )["layer"]
    assert gimp.python(code=selected, number=loaded["image"]) == [group]
    again = gimp.run(procedure="plug-in-toposeam-restitch", image=loaded["image"], layers=[group])
    assert succeeded(again)["layer"] == group
    assert gimp.python(code=selected, number=loaded["image"]) == [group]


@pytest.mark.parametrize("language", ["en", "ko", "de", "fr", "es", "ja"])
def test_submenus_sort_as_they_should(language):
    folder = Path(toposeam_gimp.__file__).parent / "locale"
    texts = gettext.translation("toposeam_gimp", folder, [language], fallback=True)
    menus = list(dict.fromkeys(texts.gettext(entry.menu).replace("_", "") for entry in PROCEDURES.values()))
    assert menus == sorted(menus)
    assert len(menus) == 3
