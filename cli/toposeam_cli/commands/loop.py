"""``toposeam loop``: a clip whose end runs into its beginning."""

from __future__ import annotations

import json
import re
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

import toposeam as ts
from toposeam.sentence import counted
from toposeam_cli.app.command import Command, option
from toposeam_cli.app.options import (
    FILE,
    OUTPUT,
    FiniteRange,
    force_option,
    quiet_option,
    surface_cost_option,
)
from toposeam_cli.app.progress import say, share_bar
from toposeam_cli.files.writing import all_or_nothing, check_output, replacing
from toposeam_cli.media.clips.clip import Clip, check_pixels
from toposeam_cli.media.clips.cut import Cut, Duration
from toposeam_cli.media.clips.reading import most_loaded, open_clip
from toposeam_cli.media.clips.sound import looped_sound
from toposeam_cli.media.clips.writing import ANIMATED, VIDEOS, check_clip_output, folder_for, write_clip
from toposeam_cli.media.pictures.masks import read_white
from toposeam_cli.media.pictures.picture import MAX_PIXELS

if TYPE_CHECKING:
    from toposeam.volume import Loop

#: Most pixels of a clip that is read part by part.
_MOST_PIXELS = 100_000_000_000


class DurationType(click.ParamType):  # type: ignore[type-arg]
    """``N`` frames or ``Ns`` seconds; for a range also ``N-N``."""

    def __init__(self, ranges: bool = False) -> None:
        self._ranges = ranges
        self.name = "FRAMES|SECONDSs" + ("[-…]" if ranges else "")

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Parse the text."""
        if isinstance(value, Duration | tuple):
            return value
        found = [self._one(word) for word in str(value).split("-")]
        if not 1 <= len(found) <= 1 + self._ranges or None in found:
            example = "48, 2s or 2s-4s" if self._ranges else "48 or 2.5s"
            self.fail(f"{value!r} is not a length; write frames or seconds, like {example}", param, ctx)
        return tuple(found) if self._ranges else found[0]

    @staticmethod
    def _one(word: str) -> Duration | None:
        match = re.fullmatch(r"\s*(\d{1,7}(?:\.\d+)?)\s*(s|sec|f)?\s*", word)
        seconds = match is not None and match[2] in ("s", "sec")
        if match is None or (not seconds and not float(match[1]).is_integer()):
            return None
        return Duration(float(match[1]), seconds)


@click.command(
    cls=Command,
    everyday=["output", "length", "from", "to", "scale", "transition", "level", "stabilise", "force"],
)
@click.argument("clip", type=FILE)
@option(
    "-o",
    "--output",
    heading="Output",
    type=OUTPUT,
    required=True,
    help="The loop: .mp4, .mov, .mkv, .webm, .gif, .webp, .png (APNG), or a folder for frames.",
)
@option("--from", "first", heading="Clip", type=DurationType(), help="Read the clip from here on.")
@option("--to", "last", heading="Clip", type=DurationType(), help="Read the clip up to here.")
@option(
    "--scale",
    heading="Clip",
    type=FiniteRange(0, 1, min_open=True),
    default=1.0,
    show_default=True,
    help="Read the clip at this share of its width and height.",
)
@option(
    "--length", heading="Loop", type=DurationType(ranges=True), help="Length of the loop; found by default."
)
@option("--start", heading="Loop", type=DurationType(), help="Where in the clip it begins; found by default.")
@option(
    "--transition",
    heading="Loop",
    type=DurationType(),
    help="Time within which pixels switch; a quarter of the clip by default, 24 frames at most.",
)
@option(
    "--grow",
    heading="Loop",
    type=DurationType(),
    help="Make a longer clip, at least this long, by jumping back and forth.",
)
@option(
    "--level/--no-level",
    heading="Loop",
    default=None,
    help="Even out steps of light and soft forms that the change would show, or never. Evened pixels lose "
    "their own values, but nothing is blended. By default only where steps would show.",
)
@option(
    "--still",
    heading="Clip",
    type=FILE,
    help="A picture of the frames' size, white where nothing should move.",
)
@option(
    "--stabilise",
    heading="Clip",
    is_flag=True,
    help="Take the shift and turn of a trembling camera out first, and crop to what all frames show.",
)
@option(
    "--fps", heading="Clip", type=FiniteRange(0.01, 1000), help="Read the clip at this many frames a second."
)
@option(
    "--seed", heading="Loop", type=int, default=0, show_default=True, help="With --grow: decides the order."
)
@surface_cost_option
@option(
    "--mesh", heading="Output", type=OUTPUT, help="Also write the surface in x, y and time: .ply or .stl."
)
@option(
    "--max-megapixels",
    heading="Speed and memory",
    type=FiniteRange(min=0, min_open=True),
    help="Refuse clips with more pixels in all their frames; by default 100000 for videos, which are read "
    "part by part, and 500 for what is loaded: other clips (less for a file under 5 MB, down to 100), and "
    "loops written as .gif, .webp or .png.",
)
@option(
    "--json", "as_json", heading="Output", is_flag=True, help="Print what was made, and the verdict, as JSON."
)
@force_option
@quiet_option
def loop(clip: Path, output: Path, **given: Any) -> None:
    """Make CLIP repeat without a visible jump.

    CLIP is a video (with PyAV), a GIF, WebP or APNG, or a folder of frames. It is cut where it comes back
    best, and its end is joined to its beginning along a surface in time and space, so that each pixel
    switches when that shows least. Nothing is blended. Steps that would show are spread evenly. The line that
    is printed ends with a verdict: will not be seen, or the frame to look at.

    \b
    toposeam loop waves.mp4 -o waves_loop.mp4 --length 3s-5s
    toposeam loop party.mp4 -o party.gif --from 2s --to 6s --scale 0.5
    toposeam loop falls.mp4 -o falls.webp --still rocks.png
    toposeam loop frames/ -o longer/ --grow 60s
    """  # noqa: D301 - click wants the character
    force, quiet = given["force"], given["quiet"]
    check_clip_output(output, force)
    if given["mesh"] is not None:
        check_output(given["mesh"], force, (".ply", ".stl"))
    asked = None if given["max_megapixels"] is None else round(given["max_megapixels"] * 1e6)
    max_pixels, max_loaded = asked or _MOST_PIXELS, asked or MAX_PIXELS
    rate = None if given["fps"] is None else Fraction(given["fps"]).limit_denominator(1001)
    cut = Cut(first=given["first"], last=given["last"], scale=given["scale"])
    read = open_clip(clip, rate, max_pixels, most_loaded(clip, asked), cut)
    options = _options(read, given)
    if "grow" in options:
        check_pixels("the grown clip", options["grow"], read.frames.shape[1:], max_loaded)
    if given["still"] is not None:
        options["still"] = read_white(given["still"], read.frames.shape[1:3], clip.name, max_pixels)
    with share_bar(f"looping {clip.name}", quiet) as progress:
        made = ts.loop(read.frames, progress=progress, **options)
    if output.suffix.lower() in ANIMATED:
        check_pixels(f"the loop for {output}", len(made), read.frames.shape[1:], max_loaded)
    heard = None
    if read.sound and output.suffix.lower() in VIDEOS:
        places = [(jump.leaves, jump.enters) for jump in made.jumps]
        heard = looped_sound(clip, read.begin, read.rate, places, made.transition)
    with folder_for(output), all_or_nothing():
        write_clip(output, Clip(frames=made, rate=read.rate, heard=heard), force)
        if given["mesh"] is not None:
            with replacing(given["mesh"], force) as temporary:
                _write_mesh(made, temporary, given["mesh"].suffix.lower())
    if read.sound and heard is None and not quiet:
        say(f"{clip} has sound, which is left out", err=True)
    if made.shot != (0, len(read.frames)) and not quiet:
        first, last = made.shot
        say(f"{clip} has cuts; the loop stays in the shot of frames {first} to {last - 1}", err=True)
    if made.verdict.moved is not None and not quiet:
        right, down = made.verdict.moved
        say(
            f"the whole picture moves in {clip}, by {right} px across and {down} px down; if the camera did, "
            "--stabilise takes that out, or take a part in which it stands still (--from, --to)",
            err=True,
        )
    if given["stabilise"] and not quiet:
        say(_steadied(clip, made), err=True)
    if given["as_json"]:
        say(json.dumps(_summary(output, made, read.rate)))
    elif not quiet:
        count = len(made)
        jumps = ", ".join(f"from {jump.leaves} to {jump.enters}" for jump in dict.fromkeys(made.jumps))
        seconds = float(count / read.rate)
        say(f"{output}: {counted(count, 'frame')} ({seconds:.2f} s), {jumps}; {made.verdict}{_offer(made)}")


def _summary(output: Path, made: Loop, rate: Fraction) -> dict[str, Any]:
    """Return the summary of a loop for JSON."""
    return {
        "output": str(output),
        "frames": len(made),
        "seconds": round(float(len(made) / rate), 3),
        "jumps": [[jump.leaves, jump.enters] for jump in dict.fromkeys(made.jumps)],
        "level": made.settings["level"],
        "longer": None if made.longer is None else [made.longer.leaves, made.longer.enters],
        "stabilised": None if made.steadied is None else [round(part, 3) for part in made.steadied],
        **made.verdict.summary(),
    }


def _steadied(clip: Path, made: Loop) -> str:
    """Say what was taken out of a clip."""
    if made.steadied is None:
        return f"the camera stands still in {clip}; nothing is stabilised"
    right, down, turn = made.steadied
    height, width = made.size
    return (
        f"the camera moves in {clip} by {right:.1f} px across, {down:.1f} px down and {turn:.2f}°, which is "
        f"taken out; {width} × {height} px are left"
    )


def _offer(made: Loop) -> str:
    """Offer a longer loop that costs a little more."""
    if made.longer is None:
        return ""
    more = made.longer.cost / max(made.jumps[0].cost, 1e-9)
    longer = f"--length {made.longer.period} --start {made.longer.enters}"
    return f"; a longer loop costs {more:.1f} times as much: {longer}"


def _options(clip: Clip, given: dict[str, Any]) -> dict[str, Any]:
    """Return the keywords of :func:`toposeam.loop`, in frames."""
    options: dict[str, Any] = {
        name: given[name].frames(clip.rate)
        for name in ("start", "transition", "grow")
        if given[name] is not None
    }
    if given["length"] is not None:
        lengths = [part.frames(clip.rate) for part in given["length"]]
        options["length"] = (lengths[0], lengths[-1])
    return options | {
        "level": given["level"],
        "stabilise": given["stabilise"],
        "seed": given["seed"],
        "cost": ts.seam.MatchCost(law=given["law"]),
    }


def _write_mesh(made: Loop, path: Path, suffix: str) -> None:
    mesh = made.surfaces[0].mesh()
    if made.side > 1:  # squares of pixels become pixels
        middle = np.array([0, (made.side - 1) / 2, (made.side - 1) / 2], np.float32)
        mesh = ts.volume.Mesh(
            mesh.vertices * np.array([1, made.side, made.side], np.float32) + middle, mesh.faces
        )
    (mesh.to_ply if suffix == ".ply" else mesh.to_stl)(path)
