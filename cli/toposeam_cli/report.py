"""What ``toposeam stitch`` says about its result: for people on one line, for programs as JSON."""

from __future__ import annotations

from typing import Any

import toposeam as ts


def summary(seam: ts.Seam) -> dict[str, Any]:
    """A seam in numbers. The optimum can take longer to compute than the seam took."""
    ratio = seam.optimum_ratio()
    return {
        "method": seam.method,
        "cost": seam.cost,
        "optimum": seam.cost / ratio,
        "ratio": ratio,
        "stages": seam.history[-1].stage if seam.history else 0,
        "iterations": len(seam.history),
        "termination": str(seam.termination),
        "paths": len(seam.paths),
        "length_px": round(_length(seam)),
        "seconds": round(seam.seconds, 6),
    }


def summary_of_all(stitched: ts.Stitched, layers: tuple[ts.Layer, ...], aligned: ts.Aligned | None) -> dict[str, Any]:
    """What ``--json`` prints: the seam of two pictures, or layers and seams of more."""
    places = {"layers": [_place(index, stitched, layers[index], aligned) for index in range(len(layers))]}
    if len(layers) == 2:
        return summary(stitched.seams[0]) | (places if aligned is not None else {})
    seams = [
        {"between": [layers[i].name, layers[j].name], **summary(seam)} for (i, j), seam in zip(stitched.pairs, stitched.seams, strict=True)
    ]
    return {"cost": stitched.cost, "rounds": stitched.rounds, **places, "seams": seams}


def _place(index: int, stitched: ts.Stitched, layer: ts.Layer, aligned: ts.Aligned | None) -> dict[str, Any]:
    place: dict[str, Any] = {"name": layer.name, "at": list(layer.offset), "shown_px": int(stitched.masks[index].sum())}
    if aligned is not None:
        place["moved"] = aligned.shifts[index].tolist()
        place["correlation"] = max(value for pair, value in aligned.correlations.items() if index in pair)
    return place


def describe(stitched: ts.Stitched) -> str:
    """One line about the seams for people."""
    if len(stitched.names) == 2:
        return _describe_one(stitched.seams[0])
    if not stitched.seams:
        return f"{len(stitched.names)} layers without a seam"
    length, seconds = sum(map(_length, stitched.seams)), sum(seam.seconds for seam in stitched.seams)
    return (
        f"{len(stitched.names)} layers, {len(stitched.seams)} seams of {round(length)} px in all by {stitched.seams[0].method}, "
        f"{stitched.rounds} round{'s' if stitched.rounds != 1 else ''}, cost {stitched.cost:.4g}, {seconds:.2f} s"
    )


def describe_alignment(layers: tuple[ts.Layer, ...], aligned: ts.Aligned) -> list[str]:
    """One line per layer that was moved."""
    lines = []
    for index, layer in enumerate(layers):
        x, y = aligned.shifts[index]
        correlation = max(value for pair, value in aligned.correlations.items() if index in pair)
        lines.append(f"{layer.name}: at {layer.offset[0]},{layer.offset[1]}, moved by {x},{y} (correlation {correlation:.2f})")
    return lines


def _describe_one(seam: ts.Seam) -> str:
    effort = f" in {len(seam.history)} iterations" if seam.history else ""
    text = f"seam of {round(_length(seam))} px by {seam.method}{effort}, cost {seam.cost:.4g}, {seam.seconds:.2f} s"
    if seam.termination == ts.Termination.ITERATIONS:
        text += "; the heat did not settle on a single line, so this is the best cut of what it left"
    return text


def _length(seam: ts.Seam) -> float:
    return sum(line.length for line in seam.paths)
