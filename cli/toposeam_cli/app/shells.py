"""Completion in PowerShell, which click does not have, and the manual page."""

from __future__ import annotations

import os
import re
from typing import ClassVar

import click
from click.shell_completion import CompletionItem, ShellComplete, add_completion_class, split_arg_string

_POWERSHELL = """\
Register-ArgumentCompleter -Native -CommandName %(prog_name)s -ScriptBlock {
    param($wordToComplete, $commandAst, $cursorPosition)
    $before = $commandAst.ToString()
    $length = $cursorPosition - $commandAst.Extent.StartOffset
    if ($before.Length -gt $length) { $before = $before.Substring(0, $length) }
    $env:%(complete_var)s = "powershell_complete"
    $env:COMP_WORDS = $before
    $env:COMP_CWORD = $wordToComplete
    try { $answers = @(& %(prog_name)s) }
    finally {
        foreach ($name in "%(complete_var)s", "COMP_WORDS", "COMP_CWORD") {
            Remove-Item "Env:$name" -ErrorAction SilentlyContinue
        }
    }
    foreach ($answer in $answers) {
        $kind, $value, $help = $answer -split "`t", 3
        if ($kind -eq "plain") {
            [System.Management.Automation.CompletionResult]::new($value, $value, "ParameterValue", $help)
        } else {
            [System.Management.Automation.CompletionCompleters]::CompleteFilename($wordToComplete)
        }
    }
}
"""


@add_completion_class
class PowershellComplete(ShellComplete):
    """Completion for PowerShell 5.1 and later. Each answer is a line of kind, value and help, separated by
    tabs.
    """

    name: ClassVar[str] = "powershell"
    source_template: ClassVar[str] = _POWERSHELL

    def get_completion_args(self) -> tuple[list[str], str]:
        """Return the words before the one being typed, and that one."""
        words = split_arg_string(os.environ["COMP_WORDS"])[1:]
        incomplete = os.environ.get("COMP_CWORD", "")  # PowerShell removes empty variables
        if incomplete and words:
            words = words[:-1]
        return words, incomplete.strip("'\"")

    def format_completion(self, item: CompletionItem) -> str:
        """Format one answer."""
        return f"{item.type}\t{item.value}\t{(item.help or item.value).replace(chr(9), ' ')}"


def manual(group: click.Group, prog_name: str, version: str) -> str:
    """Return the manual page of a command and all below it, for ``man`` (roff)."""
    context = click.Context(group, info_name=prog_name, **group.context_settings)
    first, rest = _description(group)
    lines = [
        f'.TH {prog_name.upper()} 1 "" "{prog_name} {version}" "User Commands"',
        ".nh",
        ".ad l",
        ".SH NAME",
        rf"{prog_name} \- {_roff(first)}",
        ".SH SYNOPSIS",
        rf".B {prog_name}",
        r"\fICOMMAND\fR [\fIOPTIONS\fR] [\fIARGUMENTS\fR]",
        *([".SH DESCRIPTION", *rest] if rest else []),
        ".SH OPTIONS",
        *_options(group, context),
        ".SH COMMANDS",
        *_commands(group, context),
        ".SH EXIT STATUS",
        "0 when everything was done, 1 when something could not be, 2 when the command was not understood,",
        "130 after an interruption. An error is one sentence on standard error.",
    ]
    return "\n".join(lines) + "\n"


def _commands(group: click.Group, context: click.Context) -> list[str]:
    lines = []
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if command is None or command.hidden:
            continue
        below = click.Context(command, info_name=name, parent=context)
        usage = " ".join(command.collect_usage_pieces(below))
        first, rest = _description(command)
        lines += [rf".SS {_roff(below.command_path)} {_roff(usage)}", _roff(first), *rest]
        lines += _options(command, below)
        if isinstance(command, click.Group):
            lines += _commands(command, below)
    return lines


def _description(command: click.Command) -> tuple[str, list[str]]:
    """Return the first paragraph as one line, and the others as lines of roff; blocks that click does not
    rewrap keep their lines.
    """
    paragraphs = re.split(r"\n\s*\n", (command.help or "").partition("\f")[0].strip())
    rest: list[str] = []
    for paragraph in paragraphs[1:]:
        if paragraph.strip().startswith("\b"):
            rest += [
                ".PP",
                ".nf",
                *(_roff(line.strip()) for line in paragraph.strip().splitlines()[1:]),
                ".fi",
            ]
        else:
            rest += [".PP", _roff(" ".join(paragraph.split()))]
    return " ".join(paragraphs[0].split()), rest


def _options(command: click.Command, context: click.Context) -> list[str]:
    lines = []
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if record is not None and record[1]:
            lines += [".TP", rf"\fB{_roff(record[0])}\fR", _roff(record[1])]
    return lines


def _roff(text: str) -> str:
    text = text.replace("\\", r"\e").replace("-", r"\-").replace("|", r"|\:")  # a line may end there
    # Older groff reads Latin-1.
    text = re.sub(r"[^\x00-\x7f]", lambda found: rf"\[u{ord(found[0]):04X}]", text)
    return rf"\&{text}" if text.startswith((".", "'")) else text
