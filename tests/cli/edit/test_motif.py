"""Motifs of the page without a browser: what messages change, what is grown, who gets in."""

import dataclasses
import json
import multiprocessing
import threading

import numpy as np
import pytest
from edit_pages import OWN, PORT, TOKEN, hear, live

pytest.importorskip("starlette")
pytest.importorskip("httpx2")

from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

import toposeam as ts
from toposeam.motif.recipe import unpack_base
from toposeam_cli.edit.messages import MessageError
from toposeam_cli.edit.motif import solver
from toposeam_cli.edit.motif.hub import MotifPages, save_words
from toposeam_cli.edit.motif.messages import GROWTHS, parsed
from toposeam_cli.edit.motif.session import MotifSession
from toposeam_cli.edit.motif.sketch import Sketch, Wall, erased
from toposeam_cli.edit.motif.work import MotifWork, motif_work
from toposeam_cli.edit.server import application


@pytest.fixture
def works(tmp_path, monkeypatch):
    monkeypatch.setenv("TOPOSEAM_WORKS", str(tmp_path / "works"))
    return tmp_path / "works"


class SmallWork(MotifWork):
    """A work that begins with a small motif."""

    def first(self, seed):
        recipe = ts.motif.random_recipe(48, style="vein", layers=2, repeat="p4", seed=7, palette="sea")
        return Sketch(recipe=recipe)


@pytest.fixture
def work(works):
    return SmallWork(works / "motif", None)


@pytest.fixture
def session(work):
    session = MotifSession(work)
    grown(session, session.begin())
    return session


def grown(session, task):
    *_, last = ts.motif.grow(task.recipe, start=task.start, kept=task.kept, most=task.most)
    session.show(last.densities)
    return last.densities


def said(**message):
    return parsed(json.dumps(message))


MESSAGES = [
    {"kind": "dice", "seed": 9, "style": "chain", "repeat": "pm"},
    {"kind": "style", "style": "cutout", "layer": None},
    {"kind": "style", "style": "cutout", "layer": 1},
    {"kind": "repeat", "repeat": "p6m"},
    {"kind": "repeat", "repeat": "brick 1/3"},
    {"kind": "set", "name": "mass", "value": 0.4, "layer": 0, "done": True},
    {"kind": "set", "name": "filter_radius", "value": 4, "layer": None, "done": True},
    {"kind": "layers", "count": 1},
    {"kind": "layers", "count": 4},
    {"kind": "add", "layer": 0, "role": "sources", "points": [[0.2, 0.3], [0.25, 0.3]]},
    {"kind": "move", "layer": 0, "role": "sinks", "index": 0, "points": [[0.9, 0.1]], "done": True},
    {"kind": "wall", "points": [[0.1, 0.1], [0.5, 0.2]], "radius": 0.04},
]


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: message["kind"])
def test_a_change_grows_and_is_taken_back_at_once(session, message):
    before, shown = session.describe(), session.shown()
    task = session.change(said(**message))
    assert session.describe() != before
    densities = grown(session, task)
    assert len(densities) == len(session.recipe.layers)
    assert session.change({"kind": "undo"}) is None  # nothing is solved
    again = session.describe()
    assert (again["undo"], again["redo"]) == (0, 1)
    assert {**again, "redo": 0} == before
    assert np.array_equal(session.shown(), shown)
    session.change({"kind": "redo"})
    assert session.describe()["undo"] == 1


def test_a_change_begins_from_what_is_shown(session):
    shown = session.shown()
    task = session.change(said(kind="set", name="mass", value=0.4, layer=None, done=True))
    assert np.array_equal(task.start, shown)
    assert session.change(said(kind="dice", seed=1, style=None, repeat=None)).start is None


def test_what_is_dragged_is_one_step_and_small(session):
    for value, done in ((0.3, False), (0.35, False), (0.4, True)):
        task = session.change(said(kind="set", name="mass", value=value, layer=None, done=done))
        assert task.most == (256 if done else 128)
    assert session.describe()["undo"] == 1
    session.change({"kind": "undo"})
    assert session.describe()["undo"] == 0


def test_colours_solve_nothing(session):
    inks = [[0.1, 0.2, 0.3], [0.9, 0.1, 0.1]]
    message = said(kind="colours", paper=[0, 0, 0], inks=inks, inking="opaque", done=True)
    shown = session.shown()
    assert session.change(message) is None
    assert np.array_equal(session.shown(), shown)
    assert session.recipe.paper == (0, 0, 0)
    assert [list(layer.ink) for layer in session.recipe.layers] == inks
    assert session.recipe.inking == "opaque"


def test_dice_keep_what_is_locked_and_the_colours(session):
    session.change(said(kind="dice", seed=5, style="leaf", repeat="pgg"))
    described = session.describe()
    assert {layer["style"] for layer in described["layers"]} == {"leaf"}
    assert described["repeat"] == "pgg"
    assert np.allclose(described["layers"][2]["ink"], ts.motif.palette("sea", 3).inks[2])


def test_relatives_are_grown_small_and_one_is_taken(session):
    tasks = session.breed(3)
    assert len({task.recipe for task in tasks}) == len(tasks) == 8
    assert {task.recipe.repeat for task in tasks} == {"p4"}
    *_, last = ts.motif.grow(tasks[2].recipe, most=tasks[2].most)
    session.bred(2, last.densities)
    task = session.change(said(kind="relative", number=2))
    assert task.recipe == tasks[2].recipe
    assert np.array_equal(task.start, last.densities)
    assert session.change(said(kind="relative", number=50)) is None


def test_a_session_goes_on_where_it_was(work, session):
    session.change(said(kind="wall", points=[[0.1, 0.1], [0.5, 0.2]], radius=0.04))
    session.change(said(kind="repeat", repeat="pm"))
    session.change({"kind": "undo"})
    described = session.describe()
    assert described["walls"]
    assert MotifSession(work).describe() == described
    (work.folder / "motif.json").write_text("{")
    assert MotifSession(work).describe()["undo"] == 0


def test_a_motif_without_a_sink_is_refused(session):
    before = session.describe()
    everywhere = [[x / 40, y / 40] for x in range(41) for y in range(41)]
    with pytest.raises(ts.OptionError, match="heat s"):
        session.change(said(kind="erase", points=everywhere, radius=0.1))
    assert session.describe() == before


def test_walls_keep_strokes_out_under_every_rule():
    for repeat in ("none", "reflect", "p4m", "pgg", "brick", "p6"):
        recipe = ts.motif.random_recipe(64, style="vein", layers=1, repeat=repeat, seed=2)
        wall = Wall(points=((0.3, 0.2), (0.5, 0.55)), radius=0.05)
        walled = Sketch(recipe=recipe, walls=(wall,)).whole()
        *_, free = ts.motif.grow(recipe)
        *_, grown = ts.motif.grow(walled)
        at = tuple(int(64 * place) for place in (0.375, 0.4))
        around = np.s_[at[0] - 1 : at[0] + 2, at[1] - 1 : at[1] + 2]
        assert grown.densities[0][around].mean() < 0.2, repeat
        assert grown.densities[0].mean() == pytest.approx(free.densities[0].mean(), rel=0.05)


def test_walls_of_a_motif_with_a_base_image():
    base = np.tile(np.linspace(0.2, 1, 64, dtype=np.float32), (64, 1))
    recipe = ts.motif.random_recipe(64, style="vein", layers=1, repeat="p1", seed=2, base=base)
    walled = Sketch(recipe=recipe, walls=(Wall(points=((0.8, 0.5),), radius=0.1),)).whole()
    shown, before = unpack_base(walled.base), unpack_base(recipe.base)
    assert shown[32, 51] == pytest.approx(0.2, abs=0.01)
    assert before[32, 51] > 0.8
    assert shown[10, 10] == before[10, 10]
    assert (walled.base_strength, walled.base_law) == (recipe.base_strength, recipe.base_law)


def test_the_eraser_takes_what_it_touches_only():
    recipe = ts.motif.random_recipe(
        48, layers=1, repeat="p2", seed=1, sources=[(0.2, 0.2), (0.6, 0.6)], sinks=[(0.5, 0.1)]
    )
    wall = Wall(points=tuple((0.1 * k, 0.9) for k in range(1, 9)), radius=0.02)
    left = erased(Sketch(recipe=recipe, walls=(wall,)), [(0.8, 0.8), (0.4, 0.9)], 0.03)
    assert [spot[:2] for spot in left.recipe.layers[0].sources] == [(0.6, 0.6)]  # its half turn was rubbed
    assert left.recipe.layers[0].sinks == recipe.layers[0].sinks
    assert [len(part.points) for part in left.walls] == [3, 4]


@pytest.mark.parametrize(
    "message",
    [
        {"kind": "nothing"},
        {"kind": "dice", "seed": -1, "style": None, "repeat": None},
        {"kind": "dice", "seed": 1, "style": "baroque", "repeat": None},
        {"kind": "repeat", "repeat": "p5"},
        {"kind": "repeat", "repeat": ["p4"]},
        {"kind": "set", "name": "mass", "value": 7, "layer": None, "done": True},
        {"kind": "set", "name": "size", "value": 0.3, "layer": None, "done": True},
        {"kind": "set", "name": "mass", "value": float("nan"), "layer": None, "done": True},
        {"kind": "layers", "count": 9},
        {"kind": "add", "layer": 0, "role": "sources", "points": [[2, 0.3]]},
        {"kind": "add", "layer": 0, "role": "sources", "points": [[0.1, 0.3]] * 61},
        {"kind": "wall", "points": [[0.1, 0.1]], "radius": 3},
        {"kind": "wall", "points": [[0.1, 0.1]] * 3000, "radius": 0.1},
        {"kind": "colours", "paper": [0, 0, 2], "inks": [[0, 0, 0]], "inking": "opaque", "done": True},
        {"kind": "colours", "paper": [0, 0, 0], "inks": [], "inking": "opaque", "done": True},
        {"kind": "save", "format": "exe", "columns": 1, "rows": 1, "px": 256},
        {"kind": "save", "format": "png", "columns": 1000, "rows": 1, "px": 256},
        {"kind": "save", "format": "png", "columns": 1, "rows": 1, "px": 10**6},
    ],
    ids=lambda message: message["kind"],
)
def test_messages_that_no_page_of_motifs_sends(message):
    with pytest.raises(MessageError):
        said(**message)


def test_a_save_is_a_command_that_anybody_can_repeat(tmp_path):
    wanted = {"columns": 3, "rows": 2, "width": 100, "height": 173}
    source = tmp_path / "save.toml"
    words = save_words(wanted, source, tmp_path / "fall.png")
    assert words[:-2] == ["--from", str(source), "--force", "--sheet", "3x2", "--pixels", "300x346"]
    assert words[-2:] == ["-o", str(tmp_path / "fall.png")]
    assert "--pixels" not in save_words(wanted, source, tmp_path / "fall.svg")


@pytest.mark.parametrize("ending", GROWTHS)
def test_growth_is_saved_beside_a_picture(tmp_path, ending):
    wanted = {"columns": 1, "rows": 1, "width": 100, "height": 100, "format": ending[1:]}
    target = tmp_path / f"motif{ending}"
    words = save_words(wanted, tmp_path / "save.toml", target)
    assert words[-4:] == ["--animate", str(target), "-o", str(tmp_path / "save.png")]


def listened(connection, kind, until=lambda head: True, most=600):
    for _ in range(most):
        assert connection.poll(60), f"{kind} never came"
        found, head, blocks = connection.recv()
        if found == kind and until(head):
            return head, blocks
    raise AssertionError(kind)


def settled(head):
    return head["share"] == 1


@pytest.fixture
def solving(work):
    ours, theirs = multiprocessing.Pipe()
    running = threading.Thread(target=solve, args=(theirs, work), daemon=True)
    running.start()
    yield ours
    ours.close()
    running.join(10)


def solve(connection, work):
    with pytest.raises((EOFError, OSError)):
        solver.MotifSolver(connection, work).serve()


def test_the_solver_streams_settles_and_runs_the_recipe(solving):
    head, _ = listened(solving, "state")
    assert head["repeat"] == "p4"
    head, blocks = listened(solving, "density")
    assert [len(block) for block in blocks] == [48 * 48] * 2
    listened(solving, "density", settled)
    solving.send(said(kind="set", name="mass", value=0.35, layer=None, done=True))
    head, blocks = listened(solving, "density", settled)
    levels = np.frombuffer(blocks[0], np.uint8).reshape(head["shape"]) / 255
    assert levels.mean() == pytest.approx(0.35, abs=0.02)
    assert not head["final"]
    head, blocks = listened(solving, "density", lambda head: head["final"])  # it rested
    recipe = ts.motif.random_recipe(48, style="vein", layers=2, repeat="p4", seed=7, palette="sea")
    layers = tuple(dataclasses.replace(layer, mass=0.35) for layer in recipe.layers)
    made = ts.generate_motif(dataclasses.replace(recipe, layers=layers))
    assert blocks[0] == np.rint(255 * made.densities[0]).astype(np.uint8).tobytes()


def test_the_solver_says_what_cannot_be_and_goes_on(solving):
    listened(solving, "density", settled)
    everywhere = [[x / 40, y / 40] for x in range(41) for y in range(41)]
    solving.send(said(kind="erase", points=everywhere, radius=0.1))
    head, _ = listened(solving, "failed")
    assert head["text"].count(". ") == 0
    solving.send(said(kind="repeat", repeat="pm"))
    head, _ = listened(solving, "state", lambda head: head["repeat"] == "pm")
    listened(solving, "density", settled)


def test_every_page_sees_the_motif(work):
    pages = MotifPages(work, None, lambda: None)
    with TestClient(application(pages, TOKEN, PORT), base_url=OWN) as client:
        assert client.get(f"/{TOKEN}/").text.count("motif/main.js") == 1
        assert client.get(f"/{TOKEN}/page/motif/motif.js").status_code == 200
        assert client.get("/page/motif/motif.js").status_code == 403
        posted = client.post(f"/{TOKEN}/drop?name=a.png", content=b"1", headers={"origin": OWN})
        assert posted.status_code == 409
        with live(client) as first:
            hello, _ = hear(first, "hello")
            assert hello["owner"]
            assert len(hello["palettes"]) == len(ts.motif.PALETTES)
            hear(first, "density")
            with live(client) as second:
                assert not hear(second, "hello")[0]["owner"]
                hear(second, "state")
                hear(second, "density")
            with live(client) as hostile:
                hostile.send_text('{"kind": "save", "format": "../../x", "columns": 1, "rows": 1, "px": 99}')
                with pytest.raises(WebSocketDisconnect):
                    [hostile.receive_bytes() for _ in range(300)]


def test_a_file_is_begun_with_and_a_strange_one_said(works, tmp_path):
    recipe = ts.motif.random_recipe(32, layers=1, repeat="pm", seed=3)
    from toposeam_cli.motifs.recipe_files import to_toml

    path = tmp_path / "mine.toml"
    path.write_text(to_toml(recipe))
    assert MotifSession(motif_work(path)).recipe == recipe
    path.write_text("seed = 3\n")
    with pytest.raises(ts.OptionError, match="whole recipe"):
        MotifSession(motif_work(path))
    many = ts.motif.random_recipe(16, layers=9, seed=1)
    path.write_text(to_toml(many))
    with pytest.raises(ts.OptionError, match="more than the page shows"):
        MotifSession(motif_work(path))
