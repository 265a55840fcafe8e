"""Every argument of every public function, one after the other, with every value that may be wrong.

``python sweep.py`` tells of each function in a line of JSON: the arguments that raised something else than
the library's errors. What a caller's own function raises is the caller's.
"""

import inspect
import json

import functions
import numpy as np
from watched import TooLong, watched

import toposeam as ts

_ATTEMPTS, _MOST_S = 12, 6


def results():
    """One of each result that others take."""
    noise = np.random.default_rng(1).random((16, 24))
    stitched = ts.stitch([ts.Layer(noise), ts.Layer(noise, at=(12, 3))])
    motif = ts.generate_motif(24, layers=1, iterations=2, seed=1)
    return [stitched, stitched.seams[0], motif, motif.recipe, ts.synthesize(noise, 24, patch=12)]


def by_name(known):
    """Arguments of functions that want more than their annotations say."""
    _stitched, seam, motif, _recipe, synthesis = known
    wide = np.random.default_rng(2).random((120, 260))
    volume = np.random.default_rng(3).random((6, 16, 24))
    crops = [ts.Layer(wide[:64, :96], name="left"), ts.Layer(wide[:64, 40:136], at=(38, 0), name="right")]
    layers = [ts.Layer(wide[:16, :24]), ts.Layer(wide[:16, :24], at=(12, 3))]
    joined = ts.stitch(layers)
    path = ts.vector.read_svg(joined.seams[0].to_svg())
    recipe = ts.motif.random_recipe(24, repeat="translate", iterations=2, layers=1)
    return {
        "align": {"layers": crops},
        "find_places": {"pictures": crops},
        "apply_coordinates": {"images": wide, "source": synthesis.source},
        "border_visibility": {"pattern": wide[:96, :96], "cell": (48, 48)},
        "draw_svg": {"motif": motif},
        "join_motifs": {"recipes": [recipe, recipe]},
        "join_volumes": {"a": volume, "b": volume, "offset": (0, 0, 12)},
        "make_tileable": {"image": wide[:64, :64]},
        "overlapping": {"a": wide, "b": wide, "overlap": 20},
        "placed": {"layer": crops[0], "at": (3, 4)},
        "read_svg": {"source": seam.to_svg()},
        "recut": {
            "labelling": joined.labelling,
            "label_map": joined.solution,
            "opened": np.ones(joined.shape, bool),
        },
        "restitch": {"layers": layers, "masks": joined.masks, "paths": {(0, 1): path}},
        "tile_set": {"sources": [wide[:20, :20], wide[:20, 60:80]], "size": 12, "variants": 1},
        "seam_verdict": {"seam": ts.find_seam(wide, wide[::-1]), "a": wide, "b": wide[::-1]},
    }


def valid(function, known):
    """Arguments that the function accepts, or the last ones that were tried."""
    for seed in range(_ATTEMPTS):
        fuzzer = functions.Fuzzer(seed)
        fuzzer.results = known
        drawn = {
            key: fuzzer.likely(key, parameter)
            for key, parameter in parameters(function).items()
            if parameter.default is parameter.empty
        }
        if not problem(function, drawn, {}, every=True):
            break
    return drawn


def parameters(function):
    all_of = inspect.signature(function).parameters.items()
    return {key: one for key, one in all_of if one.kind not in (one.VAR_KEYWORD, one.VAR_POSITIONAL)}


def problem(function, drawn, changed, *, every=False):
    """What a call raises that it should not, or with `every` whatever it raises."""
    given = drawn | changed
    arguments = [
        given.pop(key)
        for key, one in parameters(function).items()
        if key in drawn and one.kind is not one.KEYWORD_ONLY
    ]
    try:
        with watched(_MOST_S):
            function(*arguments, **given)
    except (ts.TopoSeamError, OSError, TooLong) as error:
        return repr(error) if every else None
    except BaseException as error:
        return repr(error)[:200]
    return None


def main():
    known = results()
    named = by_name(known)
    for name, function in sorted(functions.FUNCTIONS.items()):
        drawn, bad = named.get(name) or valid(function, known), {}
        for key, parameter in parameters(function).items():
            if "Callable" in str(parameter.annotation):
                continue
            for value in functions.HOSTILE:
                found = problem(function, drawn, {key: value})
                if found:
                    bad[f"{key}={functions.short(value)}"] = found
        print(json.dumps({"function": name, "bad": bad}), flush=True)


if __name__ == "__main__":
    np.seterr(all="ignore")
    main()
