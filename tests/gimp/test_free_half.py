"""The half of the plug-in that needs no GIMP: tables, texts, folders, lines, and the engine process with
light stubs in its place.
"""

import ast
import errno
import gettext
import os
import queue
import re
import string
import subprocess
import sys
import time
from collections import Counter
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import toposeam as ts
import toposeam_gimp
from toposeam.motif.edges import EDGES
from toposeam_engine.serving import MARKER, OPERATIONS, PROTOCOL
from toposeam_gimp import choosing, curves, engine, folder, help_page, rehearsal, sentences
from toposeam_gimp.call import Call
from toposeam_gimp.procedures import PROCEDURES

PLUG_IN = Path(toposeam_gimp.__file__).parent
KOREAN = gettext.translation("toposeam_gimp", PLUG_IN / "locale", ["ko"])
GREETING = f'{{"event": "hello", "protocol": {PROTOCOL}, "version": "{ts.__version__}"}}'


@pytest.fixture(autouse=True)
def own_temporary_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(folder.tempfile, "gettempdir", lambda: str(tmp_path))
    return tmp_path


def test_versions_and_protocol_agree():
    assert toposeam_gimp.__version__ == ts.__version__
    assert engine.PROTOCOL == PROTOCOL
    assert folder.MARKER == MARKER


@pytest.mark.medium
def test_the_tables_offer_what_core_has():
    def choices(name, option):
        (found,) = (entry for entry in PROCEDURES[f"plug-in-toposeam-{name}"].options if entry.name == option)
        return [nick for nick, _ in found.choices]

    assert sorted(choices("stitch", "method")) == sorted(ts.METHODS)
    assert sorted(choices("stitch", "blend")) == sorted(ts.BLENDS)
    assert sorted(choices("motif", "repeat")) == sorted(ts.REPEATS)
    assert sorted(choices("motif", "palette")) == sorted(["random", *ts.PALETTES])
    assert sorted(choices("motif", "edge")) == sorted(["auto", *EDGES])
    assert sorted(choices("repeat", "palette")) == sorted(["own", *ts.PALETTES])
    assert set(choices("repeat", "repeat")) < {"own", *ts.REPEATS}


def test_every_rule_and_palette_has_its_picture():
    wanted = {f"rule-{rule}.png" for rule in ts.REPEATS} | {f"palette-{name}.png" for name in ts.PALETTES}
    assert {file.name for file in (PLUG_IN / "pictures").glob("*.png")} == wanted
    assert (PLUG_IN / "pictures" / "dice-symbolic.svg").is_file()
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
            assert option.default in [nick for nick, _ in option.choices]
        elif not isinstance(option.default, bool):
            assert option.low <= option.default <= option.high
    module, function = entry.work.split(".")
    assert f"\ndef {function}(call: Call)" in (PLUG_IN / f"{module}.py").read_text()
    asked = re.findall(r'"operation": "(\w+)"', (PLUG_IN / f"{module}.py").read_text())
    assert asked
    assert set(asked) <= set(OPERATIONS)


@pytest.mark.parametrize("entry", PROCEDURES.values(), ids=PROCEDURES)
@pytest.mark.parametrize("translate", [str, KOREAN.gettext], ids=["English", "Korean"])
def test_no_two_fields_of_a_dialog_share_a_mnemonic(entry, translate):
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


# What the engine says, and the manual.


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        (
            "right.png (at 441,0): the patches do not overlap: no pixel is covered by both; move one of them",
            "“right.png” does not overlap the other layers; move it onto them.",
        ),
        (
            "nothing is left to copy from: the mask covers the whole picture; paint less",
            "The selection covers the whole layer; select only what is to be replaced.",
        ),
        (
            "the source is 96 × 80 px, smaller than a patch of 400 px; use a patch of 80 px or less",
            "The layer is 96 × 80 px, smaller than a patch of 400 px; use smaller patches.",
        ),
        (
            "b fits none of the other pictures (it has nothing in common, 0.5 is needed); leave it out",
            "“b” shows nothing that the other layers show too, so where it belongs cannot be found out. "
            "Select the others without it, or lay it where it belongs and switch “Positions” back.",
        ),
        (
            "transition is 20 frames, and the clip has 12: end and beginning: use at most 6",
            "The transition takes 20 of 12 frames; use 6 at most.",
        ),
        ("something new; do this", "something new; do this"),
    ],
)
def test_the_engines_sentences_are_said_in_gimps_words(said, shown):
    assert sentences.in_gimps_words(said) == shown


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


# Previews.


@pytest.mark.medium
def test_previews_come_from_warm_engines_and_only_the_newest_counts(tmp_path, monkeypatch):
    monkeypatch.setenv("TOPOSEAM_PYTHON", sys.executable)
    pixels = tmp_path / "pixels"
    pixels.mkdir()
    (pixels / "a.raw").write_bytes(bytes([60, 90, 30, 255] * 1600))
    raster = {"file": "a.raw", "width": 40, "height": 40, "channels": 4, "dtype": "uint8", "name": "a"}
    scene = {"of": "stitch", "scale": 0.5, "layers": [{**raster, "at": [x, 0]} for x in (0, 20)]}
    found = queue.Queue()
    shown = rehearsal.Rehearsal(found.put)
    try:
        shown.warm_up()
        for blend in ("multiband", "feather", "none"):
            shown.show(scene, {"blend": blend, "blend_width": 20.0}, pixels)
        width, height, channels, content = found.get(timeout=60)
        assert (width, height, channels, len(content)) == (60, 40, 4, 9600)
        assert found.empty()
        shown.show({**scene, "layers": scene["layers"][:1]}, {}, pixels)
        assert "at least two" in found.get(timeout=60)
    finally:
        shown.close()
    deadline = time.monotonic() + 10
    while list(tmp_path.glob("toposeam-request-*")) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not list(tmp_path.glob("toposeam-request-*"))


def sources():
    """Every text that is translated."""
    for path in PLUG_IN.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "_":
                yield ast.literal_eval(node.args[0])


def test_korean_is_complete_and_keeps_placeholders_and_mnemonics():
    for text in sources():
        translated = KOREAN.gettext(text)
        assert re.search("[가-힣]", translated), text
        fields = [
            sorted(field for _, field, _, _ in string.Formatter().parse(one) if field)
            for one in (text, translated)
        ]
        assert fields[0] == fields[1]
        assert ("_" in text) == ("_" in translated)
        assert text.endswith("...") == translated.endswith("...")


def test_the_compiled_translation_is_that_of_the_source():
    source = (PLUG_IN / "locale" / "ko" / "LC_MESSAGES" / "toposeam_gimp.po").read_text(encoding="utf-8")
    pairs = re.findall(r'^msgid (".+")\nmsgstr (".+")$', source, re.MULTILINE)
    assert len(pairs) == len(set(sources()))
    for original, translated in pairs:
        assert KOREAN.gettext(ast.literal_eval(original)) == ast.literal_eval(translated)


def test_options_for_the_engine_leave_out_the_plug_ins_own():
    entry = PROCEDURES["plug-in-toposeam-stitch"]
    options = {option.name: option.default for option in entry.options}
    call = Call(image=None, drawables=[], options=options, entry=entry, interactive=False)
    assert sorted(call.for_engine) == [
        "blend",
        "blend_width",
        "gradient",
        "match_tones",
        "method",
        "places",
    ]


# Lines and strokes.


def test_a_line_becomes_a_stroke_of_straight_pieces():
    assert curves.straight_stroke([1, 2, 3, 4]) == [1, 2, 1, 2, 1, 2, 3, 4, 3, 4, 3, 4]


#: Two curves: a straight one and one with handles; what they stand for.
CURVES = [[0, 0, 0, 0, 5, 9, 5, 9], [5, 9, 8, 12, 8, 16, 5, 20]]
PIECES = [[0, 0, 0, 9, 5, 9], [5, 9, 7, 9, 7, 20, 5, 20]]
EXACT = [0, 0, 0, 9, 5, 9, 7, 9, 7, 20, 5, 20]


def known_line(closed=False):
    curves_ = [*CURVES, [5, 20, 3, 20, 0, 5, 0, 0]] if closed else CURVES
    pieces = [*PIECES, [5, 20, 0, 20, 0, 0]] if closed else PIECES
    return {"stroke": curves.stroke_of(curves_, closed), "closed": closed, "pieces": pieces}


def test_curves_become_a_stroke_and_come_back():
    stroke = known_line()["stroke"]
    assert stroke == [0, 0, 0, 0, 0, 0, 5, 9, 5, 9, 8, 12, 8, 16, 5, 20, 5, 20]
    assert curves.curves_of(stroke, False) == CURVES
    ring = known_line(closed=True)["stroke"]
    assert ring[:2] == [0, 5]
    assert curves.curves_of(ring, True)[:2] == CURVES


def test_an_untouched_stroke_gives_the_exact_line():
    stroke = [value + 0.001 for value in known_line()["stroke"]]
    assert curves.lines_of([(stroke, False)], [known_line()]) == ([{"points": EXACT, "closed": False}], False)
    ring = known_line(closed=True)
    (line,), touched = curves.lines_of([(ring["stroke"], True)], [ring])
    assert (line["points"], line["closed"], touched) == ([*EXACT, 0, 20], True, False)


def test_only_what_was_bent_is_followed():
    stroke = known_line()["stroke"]
    stroke[-2] += 6  # the last anchor
    stroke[-4] += 6
    (line,), touched = curves.lines_of([(stroke, False)], [known_line()])
    assert touched
    assert line["points"][:6] == PIECES[0]
    assert line["points"][-2:] == [11, 20]
    assert len(line["points"]) > 12


@pytest.mark.parametrize("strokes", [[], [known_line()["stroke"], curves.straight_stroke([1, 1, 2, 2])]])
def test_strokes_added_or_removed_count_as_touched(strokes):
    assert curves.lines_of([(stroke, False) for stroke in strokes], [known_line()])[1]


def test_a_curve_is_followed_in_small_steps():
    points = curves.followed([0, 0, 0, 40, 60, 40, 60, 0])
    x, y = points[::2], points[1::2]
    assert (points[:2], points[-2:]) == ([0, 0], [60, 0])
    assert max(y) == pytest.approx(30, abs=0.05)
    assert all(abs(b - a) < 2 for a, b in pairwise(x))
    assert curves.followed([1, 2, 1, 2, 3, 4, 3, 4]) == [1, 2, 3, 4]


# Which path is meant.


def path(name, *, own=False, selected=False, touched=False):
    return choosing.Candidate(name=name, own=own, selected=selected, touched=touched)


@pytest.mark.parametrize(
    ("candidates", "meant"),
    [
        ([path("smooth", own=True), path("exact", own=True)], ["smooth"]),
        ([path("smooth", own=True), path("exact", own=True, touched=True)], ["exact"]),
        ([path("smooth", own=True, selected=True), path("mine")], ["smooth"]),
        ([path("smooth", own=True, selected=True), path("exact", own=True, touched=True)], ["exact"]),
        ([path("smooth", own=True), path("mine", selected=True)], ["mine"]),
        (
            [path("smooth", own=True), path("seam 1", selected=True), path("seam 2", selected=True)],
            ["seam 1", "seam 2"],
        ),
        (
            [path("smooth", own=True), path("a : b", selected=True), path("a : b #1", selected=True)],
            ["a : b", "a : b #1"],
        ),
    ],
)
def test_the_path_that_is_meant(candidates, meant):
    assert [one.name for one in choosing.chosen(candidates, "a : b")] == meant


@pytest.mark.parametrize(
    ("candidates", "phrase"),
    [
        ([path("smooth", own=True), path("mine")], "“smooth”, “mine”. Select the one that counts"),
        ([path("smooth", own=True, touched=True), path("exact", own=True, touched=True)], "were bent"),
        ([path("smooth", own=True, selected=True), path("mine", selected=True)], "Select one of them"),
    ],
)
def test_a_doubt_is_a_sentence(candidates, phrase):
    with pytest.raises(choosing.UnclearError, match=phrase):
        choosing.chosen(candidates, "a : b")


@pytest.mark.parametrize(
    ("name", "seam", "does"),
    [
        ("a : b", "a : b", True),
        ("a : b #1", "a : b", True),
        ("a : b (2)", "a : b", True),
        ("a : c", "a : b", False),
    ],
)
def test_names_say_which_seam_a_path_is_for(name, seam, does):
    assert choosing.fits(name, seam) is does


# The request's folder.


def test_a_request_folder_is_private_and_goes_with_the_block(own_temporary_folder):
    made = folder.RequestFolder()
    assert made.path.stat().st_mode & 0o077 == 0
    made.__exit__(KeyError, KeyError(), None)
    assert not list(own_temporary_folder.iterdir())


def test_crashed_folders_go_and_living_ones_stay(own_temporary_folder):
    for name in ("crashed", "alive", "notes"):
        (own_temporary_folder / f"toposeam-request-{name}").mkdir()
        (own_temporary_folder / f"toposeam-request-{name}" / "alive").touch()
        if name != "notes":
            (own_temporary_folder / f"toposeam-request-{name}" / folder.MARKER).touch()
    other = own_temporary_folder / "someone-elses"
    other.mkdir()
    long_ago = time.time() - folder.STALE_S - 60
    for name in ("crashed", "notes"):
        os.utime(own_temporary_folder / f"toposeam-request-{name}" / "alive", (long_ago, long_ago))
    folder.sweep(own_temporary_folder)
    assert sorted(path.name for path in own_temporary_folder.iterdir()) == [
        "someone-elses",
        "toposeam-request-alive",
        "toposeam-request-notes",  # which the plug-in did not make
    ]


def test_too_little_space_is_told_before_anything_is_written(own_temporary_folder):
    with pytest.raises(
        folder.FolderError,
        match=r"There is no space left in the temporary folder .* MiB are needed\. Free some",
    ):
        folder.RequestFolder(needed=2**60)
    assert not list(own_temporary_folder.iterdir())


def test_a_full_disk_is_recognised():
    assert folder.is_full(OSError(errno.ENOSPC, "full"))
    assert not folder.is_full(OSError(errno.EACCES, "no"))


# The engine process.


def ask(script, silence_s=30.0, progress=lambda share: None):
    with folder.RequestFolder() as made:
        return engine.ask(
            made,
            {"operation": "stitch"},
            progress,
            command=[sys.executable, "-c", script],
            silence_s=silence_s,
        )


def say(*lines):
    return "import sys, time, os\n" + "".join(f"print({line!r}, flush=True)\n" for line in lines)


def test_the_engine_is_told_the_nonce_that_lies_in_the_folder():
    with folder.RequestFolder() as made, folder.RequestFolder() as other:
        assert made.nonce != other.nonce
        assert (made.path / folder.MARKER).read_text() == made.nonce
        script = f"import sys\nprint({GREETING!r}, flush=True)\n" + (
            'print(\'{"event": "result", "result": {"said": "\' + sys.stdin.readline().strip() + \'"}}\')'
        )
        result = engine.ask(made, {}, lambda share: None, command=[sys.executable, "-c", script])
    assert result == {"said": made.nonce}


def test_progress_and_result_come_through():
    shares = []
    script = say(
        GREETING,
        '{"event": "progress", "share": 0.5}',
        "noise",
        '{"event": "alive"}',
        '{"event": "result", "result": {"masks": []}}',
    )
    assert ask(script, progress=shares.append) == {"masks": []}
    assert shares == [0.5]


@pytest.mark.parametrize(
    ("script", "phrase"),
    [
        (
            say(GREETING, '{"event": "error", "message": "the layers do not overlap; move them"}'),
            "the layers do not overlap; move them",
        ),
        (
            say('{"event": "hello", "protocol": 99, "version": "9"}'),
            "the installed TopoSeam is 9; run “toposeam gimp install”",
        ),
        (say(GREETING) + "os._exit(5)", "ended unexpectedly (code 5)"),
        (say(GREETING) + "os.kill(os.getpid(), 9)", "killed, perhaps because memory ran out"),
        ("import sys; sys.exit('no module toposeam')", "does not start. Its last words: no module toposeam"),
    ],
)
def test_what_becomes_of_the_engine_is_told(script, phrase):
    with pytest.raises(engine.EngineError) as raised:
        ask(script)
    assert phrase in str(raised.value)


def test_an_engine_that_hangs_is_stopped():
    with pytest.raises(engine.EngineError, match="has not moved for 1 s and was stopped"):
        ask(say(GREETING) + "time.sleep(60)", silence_s=1.0)


def test_a_program_that_is_not_there():
    with folder.RequestFolder() as made, pytest.raises(engine.EngineError, match="does not start"):
        engine.ask(made, {}, lambda share: None, command=["/nowhere/python"])


def test_the_environment_is_cleaned():
    dirty = {
        "PATH": "/bin",
        "LD_PRELOAD": "x",
        "LD_LIBRARY_PATH": "x",
        "PYTHONHOME": "x",
        "PYTHONPATH": "x",
        "GI_TYPELIB_PATH": "x",
    }
    clean = engine.clean_environment(dirty)
    assert clean["PATH"] == "/bin"
    assert not set(clean) & (set(dirty) - {"PATH"})
    assert clean["OPENBLAS_NUM_THREADS"] == "1"


def test_which_python(tmp_path, monkeypatch):
    record = tmp_path / "engine.json"
    monkeypatch.setattr(engine, "settings_file", lambda: record)
    with pytest.raises(engine.EngineError, match="toposeam gimp install"):
        engine.find_python({}, tmp_path)
    pipx = tmp_path / ".local/share/pipx/venvs/toposeam/bin"
    pipx.mkdir(parents=True)
    (pipx / "python").touch()
    if sys.platform != "win32":
        assert engine.find_python({}, tmp_path) == str(pipx / "python")
    record.write_text('{"python": "/gone/python"}')
    with pytest.raises(engine.EngineError, match="is gone"):
        engine.find_python({}, tmp_path)
    record.write_text(f'{{"python": "{Path(sys.executable).as_posix()}"}}')
    assert engine.find_python({}, tmp_path) == Path(sys.executable).as_posix()
    with pytest.raises(engine.EngineError, match="TOPOSEAM_PYTHON"):
        engine.find_python({"TOPOSEAM_PYTHON": "/nowhere"}, tmp_path)
