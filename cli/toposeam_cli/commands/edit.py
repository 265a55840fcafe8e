"""``toposeam edit``: a page in the browser where the seam moves under the brush."""

from __future__ import annotations

import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

import toposeam as ts
from toposeam_cli.app.command import Command
from toposeam_cli.app.options import FILE, OUTPUT, force_option
from toposeam_cli.app.progress import say
from toposeam_cli.files.writing import PICTURE_SUFFIXES, check_output

if TYPE_CHECKING:
    from toposeam_cli.edit.server import Pages

#: Extensions of what *Save* writes of a motif: those of ``toposeam motif``, its recipe, and its growth.
MOTIF_SUFFIXES = (".png", ".tif", ".tiff", ".svg", ".pdf", ".toml", ".webp", ".mp4")


@click.command(cls=Command)
@click.argument("pictures", metavar="[PICTURE]...", type=FILE, nargs=-1)
@click.option("--motif", is_flag=True, help="Draw a motif that repeats, in place of pictures.")
@click.option("-o", "--output", type=OUTPUT, help="Where Save writes; by default the browser downloads it.")
@click.option(
    "--port", type=click.IntRange(0, 65535), default=0, help="Of the address; any that is free by default."
)
@click.option("--no-browser", is_flag=True, help="Print the address and wait; open it yourself.")
@force_option
def edit(
    pictures: tuple[Path, ...],
    motif: bool,
    output: Path | None,
    port: int,
    no_browser: bool,
    force: bool,
) -> None:
    """Join pictures on a page in the browser, where seams follow the brush, or grow a motif.

    PICTUREs are photographs, or a layout (.toml, .json), a Hugin project (.pto) or an OpenRaster file (.ora);
    without any, drop them on the page. Press on what you want more of and drag it over what you do not want.
    With --motif the page shows a motif that grows while you look; PICTURE is one to begin with, or a recipe.

    \b
    toposeam edit *.jpg -o all.jpg
    toposeam edit placed.toml
    toposeam edit --motif -o fall.png
    """  # noqa: D301 - click wants the character
    if output is not None:
        check_output(output, force, MOTIF_SUFFIXES if motif else (*PICTURE_SUFFIXES, ".ora"))
    if motif and len(pictures) > 1:
        raise ts.OptionError(f"--motif begins with one motif, not with {len(pictures)}; name one, or none")
    try:
        from toposeam_cli.edit.motif.hub import MotifPages
        from toposeam_cli.edit.server import Hub, serve
    except ImportError as error:
        raise ts.OptionError(
            f"the page needs {error.name}; install it with: pip install starlette uvicorn websockets"
        ) from error
    from toposeam_cli.edit.motif.work import motif_work
    from toposeam_cli.edit.work import work_of

    def opened(address: str) -> None:
        say(address)
        if not no_browser:
            say("Ctrl-C ends it; what you did is kept.", err=True)
            webbrowser.open(address)

    def pages(end: Callable[[], None]) -> Pages:
        if motif:
            return MotifPages(motif_work(pictures[0] if pictures else None), output, end)
        return Hub(work_of(pictures), output, end)

    try:
        serve(pages, port, opened)
    except OSError as error:
        raise ts.OptionError(f"port {port} cannot be used ({error.strerror}); leave --port out") from error
