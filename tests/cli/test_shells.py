"""Completion in shells, and the manual page."""

import os
import re
import shutil
import subprocess
import sys

import pytest

from toposeam_cli.app import registry
from toposeam_cli.app.main import main
from toposeam_cli.app.registry import COMMANDS
from toposeam_cli.app.shells import manual


def asked(words, current):
    """What PowerShell is answered, as (kind, value, help)."""
    environment = {"_TOPOSEAM_COMPLETE": "powershell_complete", "COMP_WORDS": words}
    if current:  # PowerShell takes what is empty out of the environment
        environment["COMP_CWORD"] = current
    code = "import sys; sys.argv = ['toposeam']; from toposeam_cli.app.main import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    return [line.split("\t") for line in done.stdout.splitlines()]


@pytest.mark.medium
def test_powershell_is_told_commands_options_choices_and_files():
    commands = asked("toposeam ", "")
    assert {"stitch", "synth", "completion"} <= {value for _, value, _ in commands}
    (help_text,) = (text for _, value, text in commands if value == "stitch")
    assert help_text
    assert COMMANDS["stitch"].startswith(help_text.rstrip("."))
    assert [value for _, value, _ in asked("toposeam stitch --me", "--me")] == ["--method"]
    assert [value for _, value, _ in asked("toposeam stitch --method h", "h")] == ["heat"]
    assert {kind for kind, _, _ in asked("toposeam tile s", "s")} <= {"file"}


def test_the_powershell_script_removes_the_variables_it_sets(toposeam):
    ran = toposeam("completion", "powershell")
    assert ran.code == 0
    set_there = set(re.findall(r"\$env:(\w+) =", ran.out))
    assert set_there == {"_TOPOSEAM_COMPLETE", "COMP_WORDS", "COMP_CWORD"}
    (removed,) = re.findall(r"foreach \(\$name in (.*)\) \{", ran.out)
    assert set(re.findall(r"\w+", removed)) == set_there


def test_the_script_is_powershell_as_far_as_its_grammar_goes(toposeam):
    tree_sitter = pytest.importorskip("tree_sitter")
    grammar = pytest.importorskip("tree_sitter_powershell")
    parse = tree_sitter.Parser(tree_sitter.Language(grammar.language())).parse
    text = toposeam("completion", "powershell").out
    assert not parse(text.encode()).root_node.has_error
    assert parse(text.replace("finally {", "finally (").encode()).root_node.has_error


def test_the_manual_page_has_every_command_and_every_option(toposeam):
    ran = toposeam("manual")
    assert ran.code == 0
    assert ran.out.startswith(".TH TOPOSEAM 1")
    for name in COMMANDS:
        assert f"\n.SS toposeam {name} " in ran.out
    for option in ("--overlap", "--tileable", "--palette", "--gimp-version"):
        assert option.replace("-", r"\-") in ran.out
    assert ran.out.isascii()


def test_making_the_manual_page_leaves_the_commands_as_they_are(toposeam):
    command = registry.load("tile")
    command._help_option = None  # as in a new process
    toposeam("manual")
    assert toposeam("tile", "-h").code == 0


@pytest.mark.skipif(shutil.which("groff") is None, reason="there is no groff")
def test_groff_sets_the_manual_page_without_a_warning(toposeam):
    page = toposeam("manual").out
    done = subprocess.run(
        ["groff", "-man", "-ww", "-Tutf8", "-P-c"], input=page, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    assert "cost ÷ optimum" in " ".join(done.stdout.split())


def test_text_cannot_be_mistaken_for_formatting():
    import click

    group = click.Group("x", help="A \\backslash.\n\n\b\n.dot first\n", commands={})
    page = manual(group, "x", "1")
    assert r"x \- A \ebackslash." in page
    assert "\n\\&.dot first\n" in page


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "powershell"])
def test_every_shell_that_is_offered_has_a_script(toposeam, shell):
    assert shell in main.commands["completion"].params[0].type.choices
    assert "_TOPOSEAM_COMPLETE" in toposeam("completion", shell).out
