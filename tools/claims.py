"""Draw claims of the documents for somebody to try: ``python tools/claims.py --seed 7``.

A claim is a sentence of README or docs/ that states something about a command, an option, a function or a
number. Nothing here says whether it is true.
"""

from __future__ import annotations

import argparse
import random
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: What is no claim: code, tables written by scripts, pictures.
_LEFT_OUT = re.compile(r"```.*?```|<!-- numbers.*?<!-- [^>]*numbers[^>]* -->|!\[.*?\]\(.*?\)", re.DOTALL)


def claims() -> list[tuple[str, str]]:
    """List each page and sentence that has code or a number in it."""
    found = []
    for path in [
        ROOT / "README.md",
        *sorted(ROOT.glob("docs/*.md")),
        *sorted(ROOT.glob("docs/tutorials/*.md")),
    ]:
        text = _LEFT_OUT.sub("", path.read_text(encoding="utf-8"))
        for paragraph in re.split(r"\n\s*\n|\n(?=[-|#]|\d+\. )", text):
            found += [
                (path.relative_to(ROOT).as_posix(), sentence)
                for sentence in re.split(r"(?<=[.:;]) +(?=[A-Z`*\[])", " ".join(paragraph.split()))
                if not sentence.startswith("#") and re.search(r"`[^`]+`|\d", sentence) and len(sentence) > 40
            ]
    return found


def main() -> None:
    """Print them."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=10)
    given = parser.parse_args()
    every = claims()
    for page, sentence in random.Random(given.seed).sample(every, given.count):  # noqa: S311 - no secret
        print(f"{page}: {sentence}\n")
    print(f"{given.count} of {len(every)}")


if __name__ == "__main__":
    main()
