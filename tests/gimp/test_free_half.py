"""The half of the plug-in that needs no GIMP: tables, texts, folders, lines, and the engine process with light stubs in its place."""

import ast
import errno
import gettext
import os
import re
import string
import sys
import time
from collections import Counter
from pathlib import Path

import pytest

import toposeam as ts
import toposeam_gimp
from toposeam_cli.engine import OPERATIONS, PROTOCOL
from toposeam_gimp import curves, engine, folder
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


def test_the_tables_offer_what_core_has():
    def choices(name, option):
        (found,) = (entry for entry in PROCEDURES[f"plug-in-toposeam-{name}"].options if entry.name == option)
        return [nick for nick, _ in found.choices]

    assert sorted(choices("stitch", "method")) == sorted(ts.METHODS)
    assert sorted(choices("stitch", "blend")) == sorted(ts.BLENDS)
    assert sorted(choices("motif", "repeat")) == sorted(ts.REPEATS)
    assert sorted(choices("motif", "palette")) == sorted(["random", *ts.PALETTES])


@pytest.mark.parametrize("entry", PROCEDURES.values(), ids=PROCEDURES)
def test_every_entry_is_complete(entry):
    assert re.fullmatch(r"plug-in-toposeam-[a-z]+", entry.name)
    assert len(entry.help) > 60
    for option in entry.options:
        assert option.label
        assert option.help
        if isinstance(option.default, str):
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
    keys = Counter(match[1].lower() for option in entry.options if (match := re.search("_(.)", translate(option.label))))
    assert all(count == 1 for count in keys.values()), keys
    assert not set(keys) & set("hcorls")  # Help, Cancel, OK, Reset, Load and Save settings are GIMP's


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
        fields = [sorted(field for _, field, _, _ in string.Formatter().parse(one) if field) for one in (text, translated)]
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
    assert sorted(call.for_engine) == ["blend", "blend_width", "gradient", "match_tones", "method"]


# Lines and strokes.


def test_a_line_becomes_a_stroke_of_straight_pieces():
    assert curves.to_stroke([1, 2, 3, 4]) == [1, 2, 1, 2, 1, 2, 3, 4, 3, 4, 3, 4]


def known_line():
    return {"stroke": curves.to_stroke([0, 0, 5, 9]), "closed": False, "points": [0, 0, 0, 9, 5, 9]}


def test_an_untouched_stroke_gives_the_exact_line():
    stroke = [value + 0.001 for value in known_line()["stroke"]]
    assert curves.lines_of([(stroke, False, [0, 0, 5, 9])], [known_line()]) == ([{"points": [0, 0, 0, 9, 5, 9], "closed": False}], False)


def test_a_bent_stroke_is_followed():
    stroke = curves.to_stroke([0, 0, 6, 9])
    assert curves.lines_of([(stroke, False, [0, 0, 6, 9])], [known_line()]) == ([{"points": [0, 0, 6, 9], "closed": False}], True)


@pytest.mark.parametrize(
    "strokes", [[], [(curves.to_stroke([0, 0, 5, 9]), False, []), (curves.to_stroke([1, 1, 2, 2]), False, [1, 1, 2, 2])]]
)
def test_strokes_added_or_removed_count_as_touched(strokes):
    assert curves.lines_of(strokes, [known_line()])[1]


# The request's folder.


def test_a_request_folder_is_private_and_goes_with_the_block(own_temporary_folder):
    made = folder.RequestFolder()
    assert made.path.stat().st_mode & 0o077 == 0
    made.__exit__(KeyError, KeyError(), None)
    assert not list(own_temporary_folder.iterdir())


def test_crashed_folders_go_and_living_ones_stay(own_temporary_folder):
    for name in ("crashed", "alive"):
        (own_temporary_folder / f"toposeam-request-{name}").mkdir()
        (own_temporary_folder / f"toposeam-request-{name}" / "alive").touch()
    other = own_temporary_folder / "someone-elses"
    other.mkdir()
    long_ago = time.time() - folder.STALE_S - 60
    os.utime(own_temporary_folder / "toposeam-request-crashed" / "alive", (long_ago, long_ago))
    folder.sweep(own_temporary_folder)
    assert sorted(path.name for path in own_temporary_folder.iterdir()) == ["someone-elses", "toposeam-request-alive"]


def test_too_little_space_is_told_before_anything_is_written(own_temporary_folder):
    with pytest.raises(folder.FolderError, match=r"there is no space left in the temporary folder .* MiB are needed\. Free some"):
        folder.RequestFolder(needed=2**60)
    assert not list(own_temporary_folder.iterdir())


def test_a_full_disk_is_recognised():
    assert folder.is_full(OSError(errno.ENOSPC, "full"))
    assert not folder.is_full(OSError(errno.EACCES, "no"))


# The engine process.


def ask(script, silence_s=30.0, progress=lambda share: None):
    with folder.RequestFolder() as made:
        return engine.ask(made, {"operation": "stitch"}, progress, command=[sys.executable, "-c", script], silence_s=silence_s)


def say(*lines):
    return "import sys, time, os\n" + "".join(f"print({line!r}, flush=True)\n" for line in lines)


def test_progress_and_result_come_through():
    shares = []
    script = say(
        GREETING, '{"event": "progress", "share": 0.5}', "noise", '{"event": "alive"}', '{"event": "result", "result": {"masks": []}}'
    )
    assert ask(script, progress=shares.append) == {"masks": []}
    assert shares == [0.5]


@pytest.mark.parametrize(
    ("script", "phrase"),
    [
        (say(GREETING, '{"event": "error", "message": "the layers do not overlap; move them"}'), "the layers do not overlap; move them"),
        (say('{"event": "hello", "protocol": 99, "version": "9"}'), "the installed TopoSeam is 9; run “toposeam gimp install”"),
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
    dirty = {"PATH": "/bin", "LD_PRELOAD": "x", "LD_LIBRARY_PATH": "x", "PYTHONHOME": "x", "PYTHONPATH": "x", "GI_TYPELIB_PATH": "x"}
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
