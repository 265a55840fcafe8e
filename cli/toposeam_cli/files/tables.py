"""Tables in TOML and JSON that people write. They are read within limits; an error names the place in one
sentence.
"""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

from toposeam.errors import OptionError
from toposeam_cli.files.regular import check_regular

#: Largest table that is read, bytes: nobody writes a longer one by hand.
LARGEST_BYTES = 2**20
#: Deepest nesting of tables and lists; ours have three levels.
_DEEPEST = 20


def read_table(path: Path, what: str, largest: int = LARGEST_BYTES) -> tuple[Any, str]:
    """Read a file of TOML, or of JSON if it is called ``.json``; return its contents and its text.

    Parameters
    ----------
    path : Path
    what : str
        The kind of table that is expected, for error texts: "a layout".
    largest : int
        Largest size, bytes.

    Returns
    -------
    (object, str)

    Raises
    ------
    OptionError
        When there is no such regular file, or it is too large, too deep, not UTF-8 or not TOML (JSON).
    """
    text = read_text(path, what, largest)
    kind = "JSON" if path.suffix.lower() == ".json" else "TOML"
    try:
        table = json.loads(text) if kind == "JSON" else tomllib.loads(text)
        _check(path, table, 0)
    except RecursionError as error:
        raise OptionError(f"'{path}' is nested too deep for {what}; correct it") from error
    except OptionError:
        raise
    except ValueError as error:
        reason = str(error)
        if "int_max_str_digits" in reason:
            reason = "a number in it has thousands of digits"
        raise OptionError(f"'{path}' is not {kind}: {reason}; correct that place") from error
    return table, text


def read_text(path: Path, what: str, largest: int = LARGEST_BYTES) -> str:
    """Return the text in a file that is no larger than a table may be.

    Parameters
    ----------
    path : Path
    what : str
        The kind of text that is expected, for the error's text: "a list of pictures".
    largest : int
        Largest size, bytes.

    Raises
    ------
    OptionError
        Also for pipes and devices, which may never come to an end.
    """
    try:
        check_regular(path, what, folders=False)
        with path.open("rb") as file:
            content = file.read(largest + 1)
        if len(content) > largest:
            raise OptionError(
                f"'{path}' is larger than {largest // 2**20} MiB, so it is not {what}; check its name"
            )
        return content.decode("utf-8-sig")
    except FileNotFoundError as error:
        raise OptionError(f"there is no file '{path}'; check its name and folder") from error
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise OptionError(f"'{path}' is not UTF-8 (at line {line}); save it as UTF-8") from error
    except OptionError:
        raise
    except (OSError, ValueError) as error:
        raise OptionError(
            f"cannot read '{path}' ({getattr(error, 'strerror', None) or error}); check its name and your "
            "right to read it"
        ) from error


def _check(path: Path, value: Any, depth: int) -> None:
    """Refuse deep nesting, and texts with a NUL, which no name of a file or layer can have."""
    if depth > _DEEPEST:
        raise RecursionError
    if isinstance(value, str) and "\0" in value:
        raise OptionError(f"'{path}' has the character NUL in {value[:40]!r}; leave it out")
    if isinstance(value, dict):
        for key, item in value.items():
            _check(path, key, depth)
            _check(path, item, depth + 1)
    elif isinstance(value, list):
        for item in value:
            _check(path, item, depth + 1)
