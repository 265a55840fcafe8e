"""The engine's operation on animations: a clip becomes a loop."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import toposeam as ts
from toposeam_engine.job import EngineJob
from toposeam_engine.layers import colours_of, with_alpha

if TYPE_CHECKING:
    from toposeam.volume import Loop


def loop(job: EngineJob) -> dict[str, Any]:
    """Return the frames of a loop, and the number of the clip's frame with which it begins."""
    made = looped(job)
    return {"frames": [job.write(with_alpha(frame, None)) for frame in made.frames], "start": made.start}


def looped(job: EngineJob) -> Loop:
    """Compute the loop of a request."""
    frames = []
    for raster in job.request["layers"]:
        image, alpha = colours_of(job, raster)
        if alpha is not None and ((alpha < alpha.max()).any() or not alpha.any()):
            raise ts.ImageError(
                "the frame {name} is transparent in places; fill it first",
                kind="transparent frame",
                name=str(raster["name"]),
            )
        frames.append(np.asarray(image))
    clip = np.stack(frames)
    options = {name: value or None for name, value in job.options.items()}
    return ts.loop(
        clip,
        length=options["length"],
        transition=options["transition"],
        level=bool(options["level"]),
        data_range=1.0 if clip.dtype.kind == "f" else None,
        progress=job.progress,
    )
