"""The short help, and the full one under headings."""

import re
from pathlib import Path

import click
import pytest

from toposeam_cli.app.command import Command, HeadedOption
from toposeam_cli.app.main import GROUPS, main
from toposeam_cli.app.registry import COMMANDS, load

LEAFS = [name for name in COMMANDS if not isinstance(load(name), click.Group)]
LONG = [name for name in LEAFS if getattr(load(name), "everyday", ())]


def names(parameter):
    return [*parameter.opts, *parameter.secondary_opts]


def options(name):
    return [each for each in load(name).params if isinstance(each, click.Option)]


def shown(text):
    """The options that have a line of their own."""
    return re.findall(r"^  (?:-\w, )?(--[\w-]+)", text, re.MULTILINE)


def test_every_command_with_many_options_has_a_short_help():
    assert set(LONG) == {name for name in LEAFS if len(options(name)) > 15}
    assert "stitch" in LONG


@pytest.mark.parametrize("name", LONG)
def test_the_short_help_fits_on_a_screen_and_has_an_example(toposeam, name):
    text = toposeam(name, "--help").out
    assert len(text.splitlines()) <= 40
    assert re.match(rf"Usage: \S+ {name} ", text)
    assert f"\n  toposeam {name} " in text
    assert re.search(rf"--help-all +Show all {len(options(name))} options\.\n$", text)
    assert 8 <= len(shown(text)) - 2 <= 12


@pytest.mark.parametrize("name", LONG)
def test_the_full_help_shows_every_option_once_under_headings(toposeam, name):
    text = toposeam(name, "--help-all").out
    assert sorted(shown(text)) == sorted(
        [next(word for word in each.opts if word.startswith("--")) for each in options(name)]
        + ["--help", "--help-all"]
    )
    headings = re.findall(r"^(\w[\w ]+):$", text, re.MULTILINE)
    assert len(headings) == len(set(headings)) > 3
    assert headings[-3:] == ["Output", "Speed and memory", "Help"] or headings[-2:] == ["Output", "Help"]
    help_text = " ".join((load(name).help or "").replace("\b", "").split())
    assert " ".join(text.partition("\n\n")[2].split()).startswith(help_text)


@pytest.mark.parametrize("name", LONG)
def test_every_option_of_a_long_command_has_a_heading(name):
    assert not [each.name for each in options(name) if not isinstance(each, HeadedOption)]


@pytest.mark.parametrize("name", LEAFS)
def test_no_help_speaks_of_equations(name):
    command = load(name)
    text = " ".join([command.help or "", *(each.help or "" for each in options(name))])
    assert not re.search(r"\(\d\.\d+\)|, \d\.\d\d?\)|equation", text)


def test_commands_with_few_options_show_all_of_them(toposeam):
    assert set(shown(toposeam("path", "--help").out)) >= {max(each.opts, key=len) for each in options("path")}


def test_manual_page_and_completion_have_all_options(toposeam):
    page = toposeam("manual").out
    for name in LONG:
        for each in options(name):
            assert max(each.opts, key=len).replace("-", r"\-") in page
    command = load("stitch")
    context = click.Context(command, info_name="stitch")
    offered = {item.value for item in command.shell_complete(context, "--")}
    assert {name for each in options("stitch") for name in names(each) if name[:2] == "--"} <= offered
    assert "--help-all" in offered


def test_the_help_of_all_is_grouped_and_cuts_no_summary(toposeam):
    text = toposeam("--help").out
    headings = re.findall(r"^(\w+):$", text, re.MULTILINE)
    assert headings == ["Options", "Join", "Grow", "Invent", "Tools"]
    listed = re.findall(r"^  (\w+) {2,}[A-Z]", text.partition("\nJoin:")[2], re.MULTILINE)
    assert sorted(listed) == main.list_commands(click.Context(main))
    assert "…" not in text
    assert "..." not in text.partition("\nJoin:")[2]
    assert "\n  toposeam stitch " in text
    for names in GROUPS.values():
        assert set(names) <= set(COMMANDS)


def test_all_options_of_all_commands_can_be_shown(toposeam):
    text = toposeam("--help-all").out
    for name in LEAFS:
        assert re.search(rf"^Usage: \S+ {name} ", text, re.MULTILINE)
    assert set(shown(text)) >= {max(each.opts, key=len) for name in LEAFS for each in options(name)}


@pytest.mark.medium
def test_the_site_has_a_page_with_all_options_of_each_command(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "docs"))
    from command_reference import command_pages

    pages = command_pages()
    assert set(pages) == {
        "commands",
        *(f"command.{name}" for name in main.list_commands(click.Context(main))),
    }
    for name in LEAFS:
        page = pages[f"command.{name}"]
        told = re.findall(r"^\.\. option:: (.+)$", page, re.MULTILINE)
        assert [re.findall(r"(?:^|, )(--?[\w-]+)", line) for line in told] == [
            names(each) for each in sorted_by_heading(options(name))
        ]
        assert f":doc:`{name} <command.{name}>`" in pages["commands"]


def sorted_by_heading(given):
    """Options in the order of the headings, of which some come last."""
    last = ("Output", "Speed and memory", "Options")
    headings = list(dict.fromkeys(getattr(each, "heading", "Options") for each in given))
    headings.sort(key=lambda name: last.index(name) if name in last else -1)
    return sorted(given, key=lambda each: headings.index(getattr(each, "heading", "Options")))


def test_a_command_is_the_same_after_its_help_was_shown():
    command = Command("x", help="First.\n\nSecond.", params=[click.Option(["--a"])], everyday=["a"])
    for _ in range(2):
        assert "Second" not in command.get_help(click.Context(command))
    assert command.help == "First.\n\nSecond."
