"""``toposeam stitch --json``: one schema, whatever is joined, and the same figures however it is rendered."""

import re

import numpy as np
import pytest
from skimage import data

from stitching import names, told
from toposeam.layers.composite import summary
from toposeam_cli.media.pictures.picture import Picture, write_picture
from toposeam_cli.stitching import inputs

SIDE, STEP = 100, 60
FILES = ["0.png", "1.png", "2.png"]
#: Where each lies, and what is said of that.
PLACED = [(0, 0), (STEP, 3), (2 * STEP, 0)]
AT = [word for x, y in PLACED for word in ("--at", f"{x},{y}")]
SHIFT = ["--model", "shift"]

WAYS = {
    "two": [*FILES[:2], *AT[:4]],
    "two, judged by another cost": [*FILES[:2], *AT[:4], "--cost", "gradient"],
    "two, by heat": [*FILES[:2], *AT[:4], "--method", "heat"],
    "two found": [*FILES[:2], *SHIFT],
    "two aligned": [*FILES[:2], *AT[:4], "--align"],
    "two, bent": [*FILES[:2], *AT[:4], "--give", "2"],
    "three": [*FILES, *AT],
    "three, judged by another cost": [*FILES, *AT, "--cost", "gradient"],
    "three found": [*FILES, *SHIFT],
    "three aligned": [*FILES, *AT, "--align"],
    "three blended": [*FILES, *AT, "--blend", "multiband", "--match-tones"],
    "three, cropped": [*FILES, *AT, "--crop", "inside"],
    "three of four": [*FILES, "broken.png", *AT, "--at", "0,0", "--skip-bad"],
    "three found of four": [*FILES, "blank.png", *SHIFT],
}


def marked(*ways):
    """Ways as parameters; finding three pictures takes longer than the rest."""
    medium = [pytest.mark.medium]
    return [pytest.param(way, marks=medium if "three found" in way else []) for way in ways]


@pytest.fixture
def row(tmp_path, monkeypatch):
    """Three crops of a photograph in a row, one that has nothing to be found in, and one that is none."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("toposeam_cli.jobs.crew.processes_of", lambda _: 1)
    for name, (x, y) in zip(FILES, PLACED, strict=True):
        noise = np.random.default_rng(x).integers(-4, 5, (SIDE, SIDE, 3))
        part = data.astronaut()[20 + y : 20 + y + SIDE, 130 + x : 130 + x + SIDE] + noise
        write_picture(name, Picture(pixels=np.clip(part, 0, 255).astype(np.uint8)))
    write_picture("blank.png", Picture(pixels=np.full((SIDE, SIDE, 3), 90, np.uint8)))
    (tmp_path / "broken.png").write_bytes(b"no picture")
    return tmp_path


def keys(value):
    """The keys at all depths; of a list those of its elements, which are the same."""
    if isinstance(value, dict):
        return {name: keys(part) for name, part in value.items()}
    if isinstance(value, list) and value and isinstance(value[0], dict):
        first, *others = map(keys, value)
        assert all(other == first for other in others)
        return [first]
    return None


def schema(facts):
    """All keys but those of what a job need not have: placement and groups."""
    assert set(facts) >= {"placement", "groups"}
    return keys(facts | {"placement": None, "groups": None})


@pytest.mark.parametrize("way", marked(*WAYS))
def test_the_keys_are_the_same_for_all_ways(row, toposeam, monkeypatch, way):
    """Of two and three pictures, placed and found, in memory and waiting in files."""
    found = "found" in way
    first = told(toposeam("stitch", *WAYS["two found" if found else "two"], "-o", "first.tif", "--json"))
    count = 2 if way.startswith("two") else 3
    for stored in (False, True):
        monkeypatch.setattr(inputs, "STORED_PIXELS", 0 if stored else 64_000_000)
        facts = told(toposeam("stitch", *WAYS[way], "-o", "out.tif", "--json", "--force"))
        assert schema(facts) == schema(first)
        assert keys(facts["placement"]) == keys(first["placement"])
        assert (facts["placement"] is None) == (not found)
        assert list(facts) == list(first), "in one order"
        assert facts["schema"] == 1
        assert facts["groups"] == []
        assert len(facts["left_out"]) == ("of four" in way)
        assert (facts["crop"] is None) == ("cropped" not in way)
        assert [layer["name"] for layer in facts["layers"]] == FILES[:count]
        assert [seam["between"] for seam in facts["seams"]] == [FILES[k : k + 2] for k in range(count - 1)]
        assert sum(seam["cost"] for seam in facts["seams"]) == pytest.approx(facts["cost"])
        optimal = not stored or "bent" in way
        for seam in facts["seams"]:
            assert (seam["optimum"] is None) == (seam["ratio"] is None) == (not optimal)
            assert (seam["likeness"] is None) == ("another cost" in way)
        sought = ["correlation", "turn", "scale"] if found else ["moved", "correlation"]
        for layer in facts["layers"]:
            known = [name for name in ("moved", "correlation", "turn", "scale") if layer[name] is not None]
            assert known == (sought if found or "aligned" in way else [])
    assert names(row) == [*FILES, "blank.png", "broken.png", "first.tif", "out.tif"]


@pytest.mark.parametrize(
    "way", marked("two", "two found", "three", "three aligned", "three, cropped", "three found")
)
def test_figures_are_the_same_of_pictures_in_files(row, toposeam, monkeypatch, way):
    """All but the least possible costs, which are not computed then, and seconds."""
    words = "stitch", *WAYS[way], "-o", "out.tif", "--force", "-v"
    facts, line = told(toposeam(*words, "--json")), toposeam(*words).out
    monkeypatch.setattr(inputs, "STORED_PIXELS", 0)
    stored, stored_line = told(toposeam(*words, "--json")), toposeam(*words).out
    for one in (facts, stored):
        for seam in one["seams"]:
            seam.update(seconds=None, optimum=None, ratio=None)
    assert stored.pop("cost") == pytest.approx(facts.pop("cost"), rel=1e-6)
    for seam, other in zip(stored["seams"], facts["seams"], strict=True):
        assert seam.pop("cost") == pytest.approx(other.pop("cost"), rel=1e-6)
    assert stored == facts
    seconds = r"\d+\.\d\d s"
    assert re.sub(seconds, "", stored_line) == re.sub(seconds, "", line)
    found = "seam of " if "two" in way else "3 layers, 2 seams of "
    assert re.search(rf"^{found}.*\nout.tif: .* px(, \d+ % kept)?: ", line, re.MULTILINE)


@pytest.mark.medium
def test_groups_are_told_in_the_same_schema(row, toposeam):
    for number, x in enumerate((0, 50)):
        part = data.coffee()[200:320, 150 + x : 290 + x]
        write_picture(f"c{number}.png", Picture(pixels=np.ascontiguousarray(part)))
    words = *FILES, "c0.png", "c1.png", *SHIFT, "--groups"
    facts = told(toposeam("stitch", *words, "-o", "all.png", "--json"))
    (group,) = facts["groups"]
    assert schema(group) == schema(facts)
    assert keys(group["placement"]) == keys(facts["placement"])
    assert [layer["name"] for layer in group["layers"]] == ["c0.png", "c1.png"]
    assert [layer["name"] for layer in facts["layers"]] == FILES
    assert group["groups"] == []


def test_every_key_is_documented(row, toposeam):
    facts = told(toposeam("stitch", *WAYS["three found"], "-o", "out.png", "--json"))
    assert {"filled", "left_out", "groups"} < set(facts), "which the command adds"
    for name in (*set(facts) - {"filled", "left_out", "groups"}, *facts["layers"][0], *facts["seams"][0]):
        assert re.search(rf"\b{name}\b", summary.__doc__), name
