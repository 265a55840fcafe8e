"""Draw the pictures of docs/pictures.md: ``python docs/picture_page.py`` runs the commands that stand over
them, and writes what each made into docs/figures.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / "pictures.md"
#: Width of a picture on the page, px.
WIDTH = 900
_ENTRY = re.compile(r"```sh\ntoposeam (?P<command>.+)\n```\n\n!\[[^\]]*\]\((?P<picture>[^)]+)\)")


def entries() -> Iterator[tuple[list[str], Path]]:
    """The words of each command, and the picture under it."""
    for found in _ENTRY.finditer(PAGE.read_text(encoding="utf-8")):
        yield shlex.split(found["command"]), DOCS / found["picture"]


def draw(words: list[str], target: Path) -> None:
    """Run a command in a folder of its own, and put the pictures it made side by side."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "samples").symlink_to(DOCS.parent / "samples")
        subprocess.run([sys.executable, "-m", "toposeam", *words, "--quiet"], cwd=folder, check=True)  # noqa: S603 - our own command
        names = [words[words.index(option) + 1] for option in ("-o", "--overlay") if option in words]
        if "--preview" in words:
            names = [words[words.index("--preview") + 1]]
        pictures = [Image.open(Path(folder) / name).convert("RGBA") for name in names]
    height = max(picture.height for picture in pictures)
    total = sum(picture.width for picture in pictures) + 12 * (len(pictures) - 1)
    sheet = Image.new("RGB", (total, height), "white")
    x = 0
    for picture in pictures:
        sheet.paste(picture, (x, 0), picture)
        x += picture.width + 12
    if total > WIDTH:
        sheet = sheet.resize((WIDTH, round(height * WIDTH / total)), Image.Resampling.LANCZOS)
    sheet.save(target, quality=88, optimize=True)


def main() -> None:
    """Every picture of the page."""
    for words, target in entries():
        draw(words, target)


if __name__ == "__main__":
    main()
