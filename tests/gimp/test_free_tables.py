"""Of the half of the plug-in that needs no GIMP: its tables, texts and pictures."""

import ast
import gettext
import re
import string
import subprocess
import sys
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import toposeam as ts
import toposeam_gimp
from toposeam.layers.canvas.transforms import PROJECTIONS
from toposeam.layers.registration.placement import MODELS
from toposeam.motif.ink.stroke_edges import EDGES
from toposeam_engine.serving import MARKER, OPERATIONS, PROTOCOL
from toposeam_gimp import sentences
from toposeam_gimp.engine import folder
from toposeam_gimp.engine import process as engine
from toposeam_gimp.engine.call import Call
from toposeam_gimp.entries import help_page
from toposeam_gimp.entries.table import PROCEDURES

PLUG_IN = Path(toposeam_gimp.__file__).parent
LANGUAGES = {
    place.name: gettext.translation("toposeam_gimp", PLUG_IN / "locale", [place.name])
    for place in sorted((PLUG_IN / "locale").iterdir())
}


def test_versions_and_protocol_agree():
    assert toposeam_gimp.__version__ == ts.__version__
    assert engine.PROTOCOL == PROTOCOL
    assert folder.MARKER == MARKER


@pytest.mark.medium
def test_the_tables_offer_what_core_has():
    def choices(name, option):
        (found,) = (entry for entry in PROCEDURES[f"plug-in-toposeam-{name}"].options if entry.name == option)
        return [nick for nick, _ in found.choices]

    assert sorted(choices("stitch", "method")) == sorted(set(ts.seam.METHODS) - {"thesis"})
    for name in ("stitch", "panorama"):
        assert sorted(choices(name, "blend")) == sorted(ts.layers.BLENDS)
    assert choices("panorama", "model") == ["auto", *MODELS]
    assert choices("panorama", "projection") == ["auto", *PROJECTIONS]
    assert sorted(choices("motif", "repeat")) == sorted(["random", *ts.motif.REPEATS])
    assert choices("motif", "style") == ["random", *ts.motif.STYLES]
    assert sorted(choices("motif", "palette")) == sorted(["random", *ts.motif.PALETTES])
    assert sorted(choices("motif", "edge")) == sorted(["auto", *EDGES])
    assert sorted(choices("repeat", "palette")) == sorted(["own", *ts.motif.PALETTES])
    assert set(choices("repeat", "repeat")) < {"own", *ts.motif.REPEATS}


def test_every_rule_and_palette_has_its_picture():
    wanted = {f"rule-{rule}.png" for rule in ts.motif.REPEATS} | {
        f"palette-{name}.png" for name in ts.motif.PALETTES
    }
    assert {file.name for file in (PLUG_IN / "pictures").glob("*.png")} == wanted
    drawings = {file.name for file in (PLUG_IN / "pictures").glob("*.svg")}
    assert drawings == {
        "dice-symbolic.svg",
        *(f"icon-{menu}.svg" for menu in ("layers", "textures", "wallpapers")),
    }
    for entry in PROCEDURES.values():
        for option in entry.options:
            if option.pictures:
                shown = {nick for nick, _ in option.choices} - {"own", "random"}
                assert {f"{option.pictures}-{nick}.png" for nick in shown} <= wanted


@pytest.mark.medium
def test_pictures_are_those_that_the_script_draws(tmp_path):
    subprocess.run([sys.executable, PLUG_IN.parent / "make_pictures.py", tmp_path], check=True, timeout=300)
    for file in (PLUG_IN / "pictures").glob("*.png"):
        drawn, kept = (
            np.asarray(Image.open(one).convert("RGB"), int) for one in (tmp_path / file.name, file)
        )
        assert np.abs(drawn - kept).mean() < 3, file.name


@pytest.mark.parametrize("entry", PROCEDURES.values(), ids=PROCEDURES)
def test_every_entry_is_complete(entry):
    assert re.fullmatch(r"plug-in-toposeam-[a-z]+", entry.name)
    assert len(entry.help) > 60
    for option in entry.options:
        assert option.label
        assert option.help
        if option.default is None:
            assert not option.engine
        elif isinstance(option.default, str):
            assert option.hidden or option.default in [nick for nick, _ in option.choices]
        elif not isinstance(option.default, bool):
            assert option.low <= option.default <= option.high
    module, function = entry.work.split(".")
    assert f"\ndef {function}(call: Call)" in (PLUG_IN / "actions" / f"{module}.py").read_text()
    asked = re.findall(r'"operation": "(\w+)"', (PLUG_IN / "actions" / f"{module}.py").read_text())
    assert asked
    assert set(asked) <= set(OPERATIONS)


@pytest.mark.parametrize("entry", PROCEDURES.values(), ids=PROCEDURES)
@pytest.mark.parametrize("language", ["en", *LANGUAGES])
def test_no_two_fields_of_a_dialog_share_a_mnemonic(entry, language):
    translate = LANGUAGES[language].gettext if language in LANGUAGES else str
    labels = [option.label for option in entry.options]
    labels += ["A_dvanced"] * any(option.advanced for option in entry.options)
    labels += ["Pre_view"] * (entry.preview is not None)
    keys = Counter(match[1].lower() for label in labels if (match := re.search("_(.)", translate(label))))
    assert all(count == 1 for count in keys.values()), keys
    assert not set(keys) & set("hcorls")  # Help, Cancel, OK, Reset, Load and Save settings are GIMP's


@pytest.mark.parametrize("entry", PROCEDURES.values(), ids=PROCEDURES)
def test_what_an_option_depends_on_is_there(entry):
    by_name = {option.name: option for option in entry.options}
    for option in entry.options:
        if option.applies is not None:
            other, values = option.applies
            possible = [nick for nick, _ in by_name[other].choices] or [True, False]
            assert set(values) < set(possible)
        if option.automatic is not None:
            assert option.low == 0
            assert 0 < option.typical <= option.high


@pytest.mark.parametrize(
    ("kind", "parameter", "data", "shown"),
    [
        (
            "apart",
            None,
            {"name": "right.png", "x": "441", "y": "0"},
            "“right.png” overlaps no other layer; move it onto one.",
        ),
        ("apart", None, {}, "The layers do not overlap; move one of them onto the other."),
        (
            "all to replace",
            None,
            {},
            "The selection covers the whole layer; select only what is to be replaced.",
        ),
        (
            "smaller than patch",
            "patch",
            {"width": "96", "height": "80", "patch": "400", "most": "80"},
            "The layer is 96 × 80 px, smaller than a patch of 400 px; use smaller patches.",
        ),
        (
            "fits none",
            None,
            {"name": "{b} fit"},
            "“{b} fit” shows nothing that the other layers show too, so where it belongs cannot be found "
            "out. Select the others without it; or lay it where it belongs, and choose Stitch Layers with "
            "the "
            "Positions “As the layers lie”.",
        ),
        (
            "long transition",
            "transition",
            {"transition": "20", "count": "12", "most": "6"},
            "The transition takes 20 of 12 frames; use 6 at most.",
        ),
        (
            "whole number",
            "patch",
            {"least": "4", "value": "2"},
            "The patches are too small; use patches of at least 4 px.",
        ),
        ("whole number", "band", {"least": "0"}, "something new; do this"),
        ("new", None, {}, "something new; do this"),
    ],
)
def test_the_engines_errors_are_said_in_gimps_words(kind, parameter, data, shown):
    error = {"message": "something new; do this", "kind": kind, "parameter": parameter, "data": data}
    assert sentences.in_gimps_words(error) == shown


def test_an_error_without_a_kind_is_said_as_it_came():
    assert sentences.in_gimps_words({"message": "something new; do this"}) == "something new; do this"


def test_no_sentence_speaks_of_the_command_line():
    for text in sources():
        assert " --" not in text
        assert "pip install" not in text


def test_the_manual_has_a_section_per_entry_and_every_field():
    page = help_page.help_page(PROCEDURES.values())
    assert "http" not in page
    for name, entry in PROCEDURES.items():
        assert f'<h2 id="{name.rpartition("-")[2]}">' in page
        for option in entry.options:
            assert f"<code>{option.name}</code>" in page
    parser = HTMLParser()
    parser.feed(page)


def sources():
    """Every text that is translated."""
    for path in PLUG_IN.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "_":
                yield ast.literal_eval(node.args[0])


@pytest.mark.parametrize("language", LANGUAGES)
def test_translations_are_complete_with_their_placeholders(language):
    for text in sources():
        translated = LANGUAGES[language].gettext(text)
        if language in ("ko", "ja"):
            assert re.search("[가-힣]" if language == "ko" else "[ぁ-んァ-ン一-龥]|OK", translated), text
            assert ("_" in text) == ("_" in translated)
        fields = [
            sorted(field for _, field, _, _ in string.Formatter().parse(one) if field)
            for one in (text, translated)
        ]
        assert fields[0] == fields[1]
        assert text.endswith("...") == translated.endswith("...")


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_compiled_translation_is_that_of_the_source(language):
    source = (PLUG_IN / "locale" / language / "LC_MESSAGES" / "toposeam_gimp.po").read_text(encoding="utf-8")
    pairs = re.findall(r'^msgid (".+")\nmsgstr (".+")$', source, re.MULTILINE)
    assert {ast.literal_eval(original) for original, _ in pairs} == set(sources())
    for original, translated in pairs:
        assert LANGUAGES[language].gettext(ast.literal_eval(original)) == ast.literal_eval(translated)


def test_options_for_the_engine_leave_out_the_plug_ins_own():
    entry = PROCEDURES["plug-in-toposeam-stitch"]
    options = {option.name: option.default for option in entry.options}
    call = Call(image=None, drawables=[], options=options, entry=entry, interactive=False)
    assert sorted(call.for_engine) == [
        "blend",
        "blend_width",
        "law",
        "match_shading",
        "match_tones",
        "method",
        "places",
    ]
