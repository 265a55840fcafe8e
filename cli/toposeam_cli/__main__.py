"""Start and end of the command's process. It prints no traceback at any moment, whatever signals come and
wherever the output goes.
"""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress

from toposeam_gimp.engine.launching import protect

_LATER = ("SIGINT", "SIGTERM", "SIGHUP")


def start() -> None:
    """Run the command line and end the process."""
    protect(os.environ)
    if signal.getsignal(signal.SIGINT) == signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # while the libraries load, Ctrl-C ends us silently
    try:
        import click  # noqa: F401 - what the library alone comes without
    except ModuleNotFoundError:
        sys.exit(
            "Error: the command line needs more than the library; install it with: pip install click "
            "'pyvips[binary]', or in the checkout: pip install '.[cli]'"
        )
    from toposeam_cli.app.main import main

    if signal.getsignal(signal.SIGINT) == signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    code: str | int | None = 1
    try:
        main(prog_name="toposeam")
    except SystemExit as end:
        code = end.code
    except OSError as error:
        code = 1
        _complain(error)
    except KeyboardInterrupt:
        code = 130
    try:
        _deaf()
    except KeyboardInterrupt:  # one more, meanwhile
        code = 130
        _deaf()
    # Where Ctrl-C came while text was run, as by dataclasses in imports, Python would end by that signal
    # though it was handled; it forgets this when it runs text again.
    eval("None")  # noqa: S307 - a constant
    sys.exit(code if _flushed(quiet=bool(code)) else code or 1)


def _deaf() -> None:
    """Ignore signals from now on, as all is tidied away."""
    for name in _LATER:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


def _flushed(*, quiet: bool) -> bool:
    """Flush the output; return whether all of it has arrived. Python itself would print a traceback. With
    `quiet` a failure is not reported, as an error was.
    """
    arrived = True
    for stream in (sys.stdout, sys.stderr):
        if stream is None:  # it was closed before we began
            continue
        try:
            stream.flush()
        except BrokenPipeError:
            arrived = False
        except OSError as error:
            arrived = False
            if stream is sys.stdout and not quiet:
                _complain(error)
        if not arrived:
            with suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    return arrived


def _complain(error: OSError) -> None:
    reason = (error.strerror or str(error)).lower()
    with suppress(OSError, ValueError, AttributeError):
        sys.stderr.write(f"Error: cannot print ({reason}); free some space, or print to another place\n")
        sys.stderr.flush()


if __name__ == "__main__":
    start()
