"""The public functions with arguments drawn by what they are called and annotated as.

``python functions.py SEED COUNT`` tells of each call in a line of JSON.
"""

import inspect
import random
import sys
from pathlib import Path

import numpy as np
from strangers import views
from watched import LARGEST_BYTES, LONGEST_S, TooLong, tell, watched

import toposeam as ts

sys.path.append(str(Path(__file__).parents[1] / "core"))
from public_names import public_names

HOSTILE = [
    None,
    True,
    False,
    -1,
    0,
    1,
    2,
    3,
    0.5,
    -0.5,
    1e-300,
    1e300,
    1e9,
    2**31,
    2**63,
    2**70,
    -(2**40),
    float("nan"),
    float("inf"),
    -float("inf"),
    1 + 2j,
    "",
    "x",
    "1",
    "25%",
    b"x",
    (),
    [],
    {},
    (1,),
    (0, 0),
    (1, 2),
    (3, 2, 1),
    (float("nan"), 1),
    (1e9, 1e9),
    (-5, 5),
    ("a", "b"),
    [None],
    [[]],
    [1, [2]],
    {"a": 1},
    object(),
    int,
    len,
    np.float32(2),
    np.int8(-3),
    np.array(3),
    np.array([]),
    np.array("x"),
    np.zeros((0, 5)),
    np.zeros((3, 3, 3, 3)),
    np.full((8, 8), np.nan),
    np.full((8, 8), np.inf),
    np.full((8, 8), -1.0),
    np.full((8, 8), 1e30),
    np.array([[1, "a"]], dtype=object),
    np.zeros((8, 8), complex),
    np.ones((1, 1)),
    np.ones((1, 300)),
    np.ma.masked_array(np.ones((8, 8)), np.eye(8)),
    np.ones((3, 16, 24)),
    np.ones((16, 24), np.int64) * 300,
    np.ones((16, 24), bool),
    np.zeros((16, 24), bool),
]
#: What makes no sense to call with anything: values that functions return.
FUNCTIONS = {
    name.split(".")[-1]: value
    for name, value in public_names().items()
    if inspect.isfunction(value)
    or (
        inspect.isclass(value)
        and (name.endswith("Options") or name in ("Layer", "vector.Polyline", "seam.MatchCost"))
    )
}


class Fuzzer:
    def __init__(self, seed):
        self.rng = random.Random(seed)  # noqa: S311 - no secret
        self.numbers = np.random.default_rng(seed)
        self.results = []
        self.worked = {}

    def picture(self):
        kind = self.rng.choice([np.uint8, np.uint16, np.float32, np.float64, bool])
        shape = (16, 24, *self.rng.choice([(), (3,), (3,), (4,), (1,)]))
        values = self.numbers.random(shape)
        if np.issubdtype(kind, np.integer):
            return (values * np.iinfo(kind).max).astype(kind)
        return (values > 0.5) if kind is bool else values.astype(kind)

    def likely(self, name, parameter):
        """A value that is likely to be right, by the parameter's name and annotation."""
        rng, said = self.rng, str(parameter.annotation)
        known = [result for result in self.results if type(result).__name__ in said]
        if known and rng.random() < 0.8:
            return [rng.choice(known) for _ in range(2)] if "Sequence" in said else rng.choice(known)
        if "Layer" in said and rng.random() < 0.3:
            return [ts.Layer(view) for view in views(self.numbers)[: rng.choice([2, 3, 4])]]
        if "Layer" in said:
            return [ts.Layer(self.picture()), ts.Layer(self.picture(), at=(12, 3))]
        if "Callable" in said:
            return lambda *arguments: None
        choices = {
            "method": ts.seam.METHODS,
            "blend": ts.layers.BLENDS,
            "repeat": ts.motif.REPEATS,
            "side": ts.seam.SIDES,
        }
        if name in choices:
            return rng.choice(list(choices[name]))
        if "Tileable" in said:
            return rng.choice(["both", "x", "y", "none", True])
        if name.startswith("mask") or name in ("avoid", "source_mask", "obstacles", "keep"):
            values = np.zeros((16, 24), bool)
            values[4:9, 5 : rng.randrange(7, 20)] = True
            return ~values if name.startswith("mask_") else values
        if name == "ground":
            return 0.5 + self.numbers.random((16, 24))
        if "palette" in name or (name == "source" and "str" in said):
            return rng.choice(list(ts.motif.PALETTES))
        if name in ("at", "counts", "size", "arrangement", "cell") or "tuple[int, int]" in said:
            return (
                rng.choice([(1, 2), (24, 16), (32, 32)])
                if name in ("size", "cell")
                else rng.choice([(1, 2), (2, 2)])
            )
        if "Point" in said or name in ("sources", "sinks", "stopovers"):
            return [(rng.uniform(0, 20), rng.uniform(0, 14))]
        if "Recipe" in said or name == "recipe":
            return ts.motif.random_recipe(24, layers=1, iterations=3, seed=rng.randrange(9))
        if "Motif" in said:
            return ts.generate_motif(24, layers=1, iterations=2, seed=rng.randrange(9))
        if "Polyline" in said or name == "points":
            points = self.numbers.random((5, 2)) * 15
            return points if name == "points" else ts.vector.Polyline(points)
        if "SvgSeam" in said or ("str | bytes" in said):
            text = ts.find_seam(self.numbers.random((16, 24)), self.numbers.random((16, 24))).to_svg()
            return text if "bytes" in said else ts.vector.read_svg(text)
        if "ArrayLike" in said or "Image" in said or "NDArray" in said:
            return self.picture()
        if "bool" in said and "float" not in said:
            return rng.random() < 0.5
        if "int" in said or "Seed" in said:
            return rng.choice([1, 2, 3, 4, 8])
        if "float" in said:
            return rng.choice([0.1, 0.5, 1.0, 2.0])
        return rng.choice(HOSTILE)

    def draw(self):
        name = self.rng.choice(sorted(FUNCTIONS))
        careful = self.rng.random() < 0.5
        arguments, keywords = [], {}
        parameters = inspect.signature(FUNCTIONS[name]).parameters.items()
        for key, parameter in parameters:
            if parameter.kind is parameter.VAR_KEYWORD:
                continue
            needed = parameter.default is parameter.empty
            if not needed and self.rng.random() > (0.15 if careful else 0.25):
                continue
            wild = not careful and self.rng.random() < 0.3 and "Callable" not in str(parameter.annotation)
            value = self.rng.choice(HOSTILE) if wild else self.likely(key, parameter)
            if parameter.kind is parameter.KEYWORD_ONLY or not needed:
                keywords[key] = value
            else:
                arguments.append(value)
        takes_more = any(parameter.kind is parameter.VAR_KEYWORD for _, parameter in parameters)
        if takes_more and self.rng.random() < 0.4:
            kinds = [
                ts.seam.HeatOptions,
                ts.texture.LayOptions,
                ts.path.PathOptions,
                ts.motif.SvgOptions,
            ]
            options = inspect.signature(self.rng.choice(kinds)).parameters
            if name in ("generate_motif",):
                options = inspect.signature(ts.motif.random_recipe).parameters
            key = self.rng.choice([*options, "nonsense"])
            if key not in keywords and key not in dict(parameters):
                keywords[key] = (
                    self.rng.choice(HOSTILE)
                    if key == "nonsense" or self.rng.random() < 0.5
                    else self.likely(key, options[key])
                )
        if name == "generate_motif" and careful:
            keywords |= {"iterations": 2, "layers": 1}
        if name == "join_motifs" and str(keywords.get("stages")) == "8":
            keywords["stages"] = 4  # eight, of forty iterations each, take 19 s
        between = keywords.get("between")
        if name == "join_motifs" and isinstance(between, int) and 1 < between < 100:
            keywords["between"] = 1  # eight make 730 motifs in four stages, which take 117 s
        return name, arguments, keywords

    def run(self, number):
        name, arguments, keywords = self.draw()
        problem, code, result = None, 0, None
        with watched() as spent:
            try:
                result = FUNCTIONS[name](*arguments, **keywords)
            except ts.TopoSeamError as error:
                code = 1
                if "\n" in str(error) or len(str(error)) < 10 or len(str(error)) > 2000:
                    problem = f"no sentence: {error!r}"
            except OSError as error:
                code = 1
                if name != "read_svg":
                    problem = repr(error)
            except TooLong:
                problem = "took too long"
            except BaseException as error:
                import traceback

                problem = "".join(traceback.format_exception(error))[-1200:]
        if spent["seconds"] > LONGEST_S or spent["grown"] > LARGEST_BYTES:
            problem = f"{problem or ''} {spent['seconds']} s, {spent['grown'] >> 20} MiB"
        if (
            problem is None
            and code == 0
            and isinstance(
                result,
                (
                    ts.seam.Seam,
                    ts.texture.Synthesis,
                    ts.layers.Composition,
                    ts.motif.Motif,
                    ts.motif.Recipe,
                    ts.vector.Polyline,
                ),
            )
        ):
            self.results = [*self.results[-20:], result]
            with watched():
                shown = repr(result)
            if "\n" in shown:
                problem = f"repr has lines: {shown}"
        words = [name, *map(short, arguments), *(f"{key}={short(value)}" for key, value in keywords.items())]
        tell(case=number, words=words, code=code, problem=problem, **spent)


def short(value):
    """An argument for people."""
    if isinstance(value, np.ndarray):
        return f"array{value.shape}{value.dtype}"
    return repr(value)[:80]


if __name__ == "__main__":
    sys.setrecursionlimit(2000)
    fuzzer = Fuzzer(int(sys.argv[1]))
    for index in range(int(sys.argv[2])):
        fuzzer.run(index)
