"""Options of the seam search, and their meaning together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import click

import toposeam as ts
from toposeam.layers.execution.tasks import Executor
from toposeam.layers.search.options import Effort
from toposeam_cli.app.command import option
from toposeam_cli.app.options import Keyed
from toposeam_cli.figures.search import check_search
from toposeam_cli.files.scratch import Scratch, scratch
from toposeam_cli.jobs.crew import crew
from toposeam_cli.stitching.inputs import PlacedPictures
from toposeam_cli.stitching.outputs import Outputs

#: Below this correlation two pictures hardly show the same.
_STRANGE = 0.1
#: So many pairs of pictures are named in warnings of one kind.
_SHOWN = 3
#: Fields of :class:`SeamOptions` that :class:`toposeam.layers.StitchOptions` has not, or has as pixels.
_NO_KEYWORDS = {"align", "align_radius", "avoid", "formulation", "law", "plain", "use_seam"}


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

    store: Scratch
    workers: Executor | None
    #: Whether pixels wait in files however few they are.
    stores: bool


@contextmanager
def means_of(folder: Path, files: Sequence[Path], processes: int, dask: str | None) -> Iterator[Means]:
    """Open the storage and workers the options ask for, for the time of a block; pixels wait in a folder.

    Raises
    ------
    OptionError
        When there is no such cluster, or its workers do not see the files.
    """
    with scratch(folder) as store, crew(processes, dask, store) as workers:
        if dask is not None and workers is not None:
            workers.check(store.new(), files)
        yield Means(store, workers, dask is not None)


@dataclass(frozen=True, slots=True, kw_only=True)
class SeamOptions:
    """Options of the seam search, and of blending across seams; those that
    :class:`toposeam.layers.StitchOptions` has, too, mean the same there.
    """

    avoid: Path | None
    law: ts.typing.Law | None
    core: float | None
    speck: int | None
    max_megapixels: float
    align: bool
    align_radius: int | None
    method: ts.typing.Method
    effort: Effort | None
    formulation: int | None
    plain: bool
    #: None where nothing is given.
    match_tones: bool | None
    match_shading: bool | None
    blend: ts.typing.Blend | None
    blend_width: float | None
    use_seam: tuple[Keyed, ...]
    wrap: int | None
    give: int | None

    @property
    def keywords(self) -> dict[str, Any]:
        """Those given that :class:`toposeam.layers.StitchOptions` has, too."""
        names = {field.name for field in fields(self)} - _NO_KEYWORDS
        return {name: value for name in names if (value := getattr(self, name)) is not None}


def by_windows(out: Outputs, find: SeamOptions) -> bool:
    """Test whether the result can be made window by window."""
    whole = out.history is not None or out.fill_edges is not None or find.give is not None
    return out.output.suffix.lower() != ".ora" and find.blend != "gradient" and not whole


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
    if find.give is not None and out.output.suffix.lower() == ".ora":
        raise ts.OptionError(
            "--give bends pictures, and an .ora file keeps them as they are; leave one of them out"
        )
    iterates = not find.use_seam and find.method in ("auto", "heat", "thesis")
    if out.history is not None:
        if not iterates:
            raise ts.OptionError(
                "--history shows iterations, and only the methods heat and thesis iterate; choose one of "
                "them or leave it out"
            )
        check_search(out.history.suffix)
    for name, given in (("--formulation", find.formulation is not None), ("--plain", find.plain)):
        if given and (find.method != "thesis" or find.use_seam):
            raise ts.OptionError(f"{name} belongs to --method thesis; add that or leave it out")
    if find.align_radius is not None and not find.align:
        raise ts.OptionError("--align-radius belongs to --align; add that or leave it out")


def correlations(job: PlacedPictures, executor: Executor | None = None) -> dict[tuple[int, int], float]:
    """Compute the correlation of each two layers that overlap, -1 to 1."""
    if job.placement is not None:
        return job.placement.correlations
    return ts.layers.correlations(job.layers, executor=executor)


def strangers(job: PlacedPictures, wrap: int | None = None, executor: Executor | None = None) -> list[str]:
    """Return a sentence for each two pictures that hardly show the same where they overlap, if `wrap` is
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
        f"{layers[i].name} and {layers[j].name} hardly show the same where they overlap"
        f"{'' if j < count else ' all the way round'} (correlation {value:.2f}); check where they lie"
        f"{'' if j < count else ' and how wide --wrap is'}"
        for (i, j), value in ts.layers.correlations(layers, executor=executor).items()
        if value < _STRANGE and i < count
    )


def _few(sentences: Iterable[str]) -> list[str]:
    """Return the first sentences about pairs of pictures, and how many more there are."""
    found = list(sentences)
    more = len(found) - _SHOWN
    return found if more < 2 else [*found[:_SHOWN], f"the same holds for {more} more pairs of pictures"]
