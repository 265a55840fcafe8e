"""Options of the seam search, and their meaning together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import toposeam as ts
from toposeam.typing import BLENDS, EFFORTS, METHODS, MOST_BENT
from toposeam_cli.app.command import option
from toposeam_cli.app.options import FiniteRange, Keyed, KeyedFile
from toposeam_cli.figures.search import check_search

if TYPE_CHECKING:
    from toposeam.layers.execution.tasks import Executor
    from toposeam_cli.files.scratch import Scratch
    from toposeam_cli.stitching.inputs import PlacedPictures
    from toposeam_cli.stitching.outputs import Outputs

#: Below this correlation two pictures show little in common. Warped ones may fit to some px only, so that
#: means of blocks of so many px, and a correlation of these, have to say it, too.
_STRANGE, _BLOCK, _STRANGE_BLOCKS = 0.1, 8, 0.2
#: So many pairs of pictures are named in warnings of one kind.
_SHOWN = 3


def seam_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that say how seams are found, and what happens across them."""
    options = (
        option(
            "--mask-for",
            "masks",
            heading="Seam",
            type=KeyedFile(needed=True),
            multiple=True,
            help="Picture (number from 0, or name) = where it may show: white, or box:X,Y,W,H.",
        ),
        option(
            "--keep",
            "keeps",
            heading="Seam",
            metavar="N=FILE",
            type=KeyedFile(needed=True),
            multiple=True,
            help="Where nothing but picture N may show: white, or box:X,Y,W,H, ellipse:X,Y,W,H.",
        ),
        option(
            "--use-seam",
            heading="Seam",
            kept=True,
            metavar="[N:M=]FILE",
            type=KeyedFile(needed=False),
            multiple=True,
            help="Join along the paths of this SVG instead of searching; 0:1=FILE for one pair of many.",
        ),
        option(
            "--method",
            heading="Seam",
            kept=True,
            type=click.Choice(METHODS),
            default="auto",
            show_default=True,
            help="How seams are found; auto takes the exact solver that is fastest.",
        ),
        option(
            "--effort",
            heading="Seam",
            kept=True,
            type=click.Choice(EFFORTS),
            help="How hard to search with more than two pictures: fast by default up to 12, best beyond, "
            "which takes 2 to 4 times as long.",
        ),
        option(
            "--formulation",
            heading="Seam",
            kept=True,
            type=click.IntRange(1, 2),
            help="With --method thesis: 1 (default), or 2 (unstable, see the docs).",
        ),
        option(
            "--plain",
            heading="Seam",
            kept=True,
            is_flag=True,
            help="With --method thesis: its algorithms as they are written, without ours.",
        ),
        option(
            "--match-tones/--no-match-tones",
            heading="Tones and blend",
            kept=True,
            default=None,
            help="First remove exposure steps: one gain per picture and channel.",
        ),
        option(
            "--match-shading/--no-match-shading",
            heading="Tones and blend",
            kept=True,
            default=None,
            help="The same, and undo how lenses darken the corners: a smooth gain field per picture.",
        ),
        option(
            "--blend",
            heading="Tones and blend",
            kept=True,
            type=click.Choice(BLENDS),
            help="What happens across the seams. auto, the default of photographs, is gradient where a sky "
            "is burnt out in one of two pictures, else multiband; others have none.",
        ),
        option(
            "--blend-width",
            heading="Tones and blend",
            kept=True,
            type=FiniteRange(min=0, min_open=True),
            help="With --blend feather, multiband, gradient: over how many px.",
        ),
        option(
            "--give",
            heading="Seam",
            kept=True,
            type=click.IntRange(1, MOST_BENT),
            metavar="PX",
            help="Bend pictures by up to PX pixels so that what crosses a seam continues beyond it; for "
            "things near the camera.",
        ),
    )
    for each in reversed(options):
        command = each(command)
    return command


def shared_work(command: Callable[..., Any]) -> Callable[..., Any]:
    """Return the options that say who does the work."""
    for each in (
        option(
            "--dask",
            heading="Speed and memory",
            metavar="ADDRESS|local",
            help="Work on the workers of a Dask scheduler, or on a Dask cluster made of -j processes.",
        ),
        option(
            "-j",
            "--jobs",
            "processes",
            heading="Speed and memory",
            type=click.IntRange(1, 256),
            help="Processes; the cores by default. Pictures of 64 megapixels or less in all take one.",
        ),
    ):
        command = each(command)
    return command


@dataclass(frozen=True, slots=True)
class Means:
    """Storage of waiting pixels, and the executor of parallel work."""

    #: None where all pixels stay in memory.
    store: Scratch | None
    workers: Executor | None
    #: Whether pixels wait in files however few they are.
    stores: bool


@contextmanager
def means_of(folder: Path, files: Sequence[Path], processes: int | None, dask: str | None) -> Iterator[Means]:
    """Open the storage and workers the options ask for, for the time of a block; pixels wait in a folder.

    Raises
    ------
    OptionError
        When there is no such cluster, or its workers do not see the files.
    """
    from toposeam_cli.stitching.inputs import has_many_pixels

    if dask is None and not has_many_pixels(files):
        yield Means(None, None, False)
        return
    from toposeam_cli.files.scratch import scratch
    from toposeam_cli.jobs.crew import crew, processes_of

    with scratch(folder) as store, crew(processes_of(processes), dask, store) as workers:
        if dask is not None and workers is not None:
            workers.check(store.new(), files)
        yield Means(store, workers, dask is not None)


@dataclass(frozen=True, slots=True, kw_only=True)
class SeamOptions:
    """Options of the seam search, and of blending across seams."""

    law: ts.typing.Law | None
    #: Whether pictures are moved to where they agree, and by how many px at most; None for the usual radius.
    align: bool
    align_radius: int | None
    #: Of the thesis's method: which one, and whether without our additions.
    formulation: int | None
    plain: bool
    #: Seams that are given.
    use_seam: tuple[Keyed, ...]
    #: Those given that :class:`toposeam.layers.StitchOptions` has, too; `avoid` is a file here.
    stitch: Mapping[str, Any]

    @classmethod
    def taken(cls, given: dict[str, Any]) -> SeamOptions:
        """Take the options out of those of a command."""
        own = {field.name: given.pop(field.name) for field in fields(cls) if field.name != "stitch"}
        names = [field.name for field in fields(ts.layers.StitchOptions) if field.name in given]
        chosen = {name: value for name in names if (value := given.pop(name)) is not None}
        return cls(**own, stitch=chosen)

    def of_stitch(self, name: str) -> Any:
        """Return an option of :class:`toposeam.layers.StitchOptions` as given; None where it is not."""
        return self.stitch.get(name)

    def with_stitch(self, **options: Any) -> SeamOptions:
        """Return the options with other ones of :class:`toposeam.layers.StitchOptions`."""
        return replace(self, stitch={**self.stitch, **options})


def by_windows(out: Outputs, find: SeamOptions) -> bool:
    """Test whether the result can be made window by window."""
    whole = out.history is not None or out.fill_edges is not None or find.of_stitch("give") is not None
    blending = ts.layers.StitchOptions(blend=find.of_stitch("blend") or "none").blending
    return out.output.suffix.lower() != ".ora" and not blending.needs_whole and not whole


def check_finding(find: SeamOptions, out: Outputs, dask: str | None) -> None:
    """Refuse options that mean nothing together.

    Raises
    ------
    OptionError
    """
    if dask is not None and not by_windows(out, find):
        raise ts.OptionError(
            "--dask makes pictures window by window, which .ora, --blend gradient, --fill-edges, --give and "
            "--history do not; leave one of them out"
        )
    if find.of_stitch("give") is not None and out.output.suffix.lower() == ".ora":
        raise ts.OptionError(
            "--give bends pictures, and an .ora file keeps them as they are; leave one of them out"
        )
    iterates = not find.use_seam and find.of_stitch("method") in ("auto", "heat", "thesis")
    if out.history is not None:
        if not iterates:
            raise ts.OptionError(
                "--history shows iterations, and only the methods heat and thesis iterate; choose one of "
                "them or leave it out"
            )
        check_search(out.history.suffix)
    for name, given in (("--formulation", find.formulation is not None), ("--plain", find.plain)):
        if given and (find.of_stitch("method") != "thesis" or find.use_seam):
            raise ts.OptionError(f"{name} belongs to --method thesis; add that or leave it out")
    if find.align_radius is not None and not find.align:
        raise ts.OptionError("--align-radius belongs to --align; add that or leave it out")


def correlations(job: PlacedPictures, executor: Executor | None = None) -> dict[tuple[int, int], float]:
    """Compute the correlation of each two layers that overlap, -1 to 1."""
    if job.placement is not None:
        return job.placement.correlations
    return ts.layers.correlations(job.layers, executor=executor)


def strangers(job: PlacedPictures, wrap: int | None = None, executor: Executor | None = None) -> list[str]:
    """Return a sentence for each two pictures that show little in common where they overlap, if `wrap` is
    given also all the way round, or that match elsewhere.
    """
    if job.placement is not None:
        return _few(
            f"{job.layers[i].name} and {job.layers[j].name} match where the other pictures do not place "
            "them; this match was left out"
            for i, j in job.placement.outvoted
        )
    layers, count = list(job.layers), len(job.layers)
    if wrap is not None:
        right = max(layer.at[0] + layer.image.shape[1] for layer in layers)
        again = [index for index, layer in enumerate(layers) if layer.at[0] + wrap < right]
        layers += [replace(layers[k], at=(layers[k].at[0] + wrap, layers[k].at[1])) for k in again]
    return _few(
        f"{layers[i].name} and {layers[j].name} show little in common where they overlap"
        f"{'' if j < count else ' all the way round'} (correlation {value:.2f}); check where they lie"
        f"{'' if j < count else ' and how wide --wrap is'}"
        for (i, j), value in ts.layers.correlations(layers, executor=executor).items()
        if value < _STRANGE and i < count and not _fits_coarsely(job, layers, i, j)
    )


def _fits_coarsely(job: PlacedPictures, layers: Sequence[ts.Layer], i: int, j: int) -> bool:
    """Test whether two layers of which one is warped show the same but for some px."""
    if not (job.warped(i) or (j < len(job.layers) and job.warped(j))):
        return False
    found = ts.layers.correlations([layers[i], layers[j]], block=_BLOCK)
    return found.get((0, 1), 0.0) >= _STRANGE_BLOCKS


def _few(sentences: Iterable[str]) -> list[str]:
    """Return the first sentences about pairs of pictures, and how many more there are."""
    found = list(sentences)
    more = len(found) - _SHOWN
    return found if more < 2 else [*found[:_SHOWN], f"the same holds for {more} more pairs of pictures"]
