"""A session without a browser: strokes, undo, what is on disk, and what is refused."""

import zipfile

import numpy as np
import pytest
from edit_pages import walker_pictures
from PIL import Image

import toposeam as ts
from toposeam.layers.canvas.layer import Box
from toposeam_cli.edit.session import Session
from toposeam_cli.edit.strokes import horizon_of
from toposeam_cli.edit.work import claimed_work, read_work, recent_works, work_of


@pytest.fixture
def works(tmp_path, monkeypatch):
    folder = tmp_path / "works"
    monkeypatch.setenv("TOPOSEAM_WORKS", str(folder))
    return folder


@pytest.fixture
def session(tmp_path, works):
    return Session(work_of([walker_pictures(tmp_path)]))


def show(layer, x, y, radius=6.0, to=None):
    points = [[x, y]] if to is None else [[x, y], list(to)]
    return {"kind": "show", "layer": layer, "radius": radius, "points": points}


def test_a_stroke_holds_and_the_rest_costs_little(session):
    other = 1 - int(session.labels[100, 160])
    change = session.push(show(other, 160.0, 100.0, 10))
    assert change.labels.size
    assert not change.lost
    assert session.paint([show(other, 160.0, 100.0, 10)])
    session.settle()
    rows, columns = np.indices(session.shape)
    disc = (columns + 0.5 - 160) ** 2 + (rows + 0.5 - 100) ** 2 < 9**2
    assert (session.labels[disc] == other).all()


def test_undo_and_redo_by_stroke(session):
    first = session.labels.copy()
    other = 1 - int(session.labels[60, 160])
    session.paint([show(other, 160.0, 60.0)])
    session.settle()
    second = session.labels.copy()
    assert (first != second).any()
    session.undo()
    np.testing.assert_array_equal(session.labels, first)
    assert session.can == {"undo": 0, "redo": 1}
    session.redo()
    np.testing.assert_array_equal(session.labels, second)


def test_another_gesture_ends_the_search_of_everything(session):
    other = 1 - int(session.labels[60, 160])
    asked = []
    session.paint([show(other, 160.0, 60.0, 10)])
    change = session.settle(lambda: not asked.append(None))
    assert len(asked) == 1
    assert change.labels.size
    rows, columns = np.indices(session.shape)
    disc = (columns + 0.5 - 160) ** 2 + (rows + 0.5 - 60) ** 2 < 9**2
    assert (session.labels[disc] == other).all()  # the window is searched all the same
    session.paint([show(other, 160.0, 140.0, 10)])
    session.settle()
    session.undo()
    assert (session.labels[disc] == other).all()


def test_a_line_of_the_preview_becomes_level(session, works):
    session.paint([show(0, 170.0, 40.0, 6)])
    session.settle()
    transforms = session.opened.transforms
    horizon = horizon_of(np.array([[40.0, 50.0], [140.0, 62.0]]), session.labels, transforms)
    assert horizon == "0=39.500,49.500,139.500,61.500"
    again = Session(session.work, horizon=horizon)
    points = again.opened.transforms[0].to_canvas(np.array([[39.5, 49.5], [139.5, 61.5]]))
    assert points[0, 1] == pytest.approx(points[1, 1], abs=1e-6)
    assert again.shape[0] > session.shape[0]
    assert [stroke.layer for (stroke,) in again.gestures] == [0]
    reopened = Session(session.work)
    assert reopened.shape == again.shape
    np.testing.assert_array_equal(reopened.labels, again.labels)
    assert horizon_of(np.array([[-900.0, 0.0], [-800.0, 0.0]]), session.labels, transforms) is None


def test_changes_bring_a_page_to_the_same_labels(session):
    shown = np.full(session.shape, -1, int)

    def take(change):
        if change.labels.size:
            shown[change.box.slices] = change.labels.astype(int) - 1

    take(session.all())
    other = 1 - int(session.labels[100, 160])
    take(session.push(show(other, 150.0, 100.0, 5, (165.0, 100.0))))
    take(session.push(show(other, 150.0, 100.0, 5, (180.0, 110.0))))
    take(session.refresh())
    np.testing.assert_array_equal(shown, session.labels)
    session.paint([show(other, 150.0, 100.0, 5, (180.0, 110.0))])
    take(session.settle())
    np.testing.assert_array_equal(shown, session.labels)
    take(session.undo())
    np.testing.assert_array_equal(shown, session.labels)


def test_one_tap_takes_the_whole_walker(session):
    walker = np.zeros(session.shape, bool)
    walker[80:130, 150:175] = True
    shows = int(session.labels[105, 162])
    strokes = session.thing_at(162.0, 105.0, 1 - shows)
    assert strokes
    session.paint(strokes)
    session.settle()
    assert (session.labels[walker] == 1 - shows).mean() > 0.98


def test_a_tap_where_nothing_differs_finds_nothing(session):
    assert session.thing_at(160.0, 20.0, 1 - int(session.labels[20, 160])) == []


def test_a_stroke_where_its_picture_is_not(session):
    change = session.push(show(0, 300.0, 100.0))
    assert change.lost


def test_erasing_part_of_a_stroke(session):
    other = 1 - int(session.labels[60, 160])
    line = show(other, 140.0, 60.0, 4)
    line["points"] = [[float(x), 60.0] for x in range(130, 200, 2)]
    session.paint([line])
    session.settle()
    assert session.erase(np.array([[132.0, 60.0]]), 12.0)
    (gesture,) = session.gestures
    assert len(gesture) == 1
    assert gesture[0].points[:, 0].min() > 10 if other else 140
    assert not session.erase(np.array([[300.0, 190.0]]), 3.0)


def test_strokes_are_on_disk_before_the_solve(session, works):
    other = 1 - int(session.labels[60, 160])
    session.paint([show(other, 160.0, 60.0)])
    again = read_work(session.work.folder)
    assert len(again.gestures) == 1


def test_a_killed_session_goes_on_where_it_was(session):
    other = 1 - int(session.labels[60, 160])
    for y in (60.0, 150.0):
        session.paint([show(other, 160.0, y)])
        session.settle()
    again = Session(read_work(session.work.folder))
    np.testing.assert_array_equal(again.labels, session.labels)
    assert again.can["undo"] == 2
    again.undo()
    assert len(again.gestures) == 1


def test_a_kill_between_stroke_and_solve_loses_nothing(session):
    other = 1 - int(session.labels[60, 160])
    session.paint([show(other, 160.0, 60.0, 8)])
    again = Session(read_work(session.work.folder))
    assert again.labels[60, 160] == other


def test_the_layout_of_a_work_has_places_strokes_and_labels(session):
    from toposeam_cli.media.layouts.layout import read_layout

    other = 1 - int(session.labels[60, 160])
    session.paint([show(other, 160.0, 60.0)])
    session.settle()
    layout = read_layout(session.work.layout)
    assert [layer.transform.matrix[:2, 2].tolist() for layer in layout.layers] == [[0, 0], [100, 0]]
    (stroke,) = layout.strokes
    assert stroke.layer == other
    assert stroke.points == ((60.0, 60.0),) if other else ((160.0, 60.0),)
    assert layout.labels.scale == 1


def test_blended_windows_are_those_of_the_composition(session):
    joined = session.opened.joined
    box = Box(10, 90, 120, 200)
    np.testing.assert_array_equal(session.blended(box), joined.window(slice(10, 120), slice(90, 200))[0])


def test_two_pages_never_hold_one_work(session):
    refused = pytest.raises(ts.OptionError, match="open on another page")
    with claimed_work(session.work), refused, claimed_work(session.work):
        pass


def test_a_work_without_strokes_leaves_nothing(tmp_path, works):
    work = work_of([walker_pictures(tmp_path)])
    with claimed_work(work):
        Session(work)
    assert not work.folder.exists()


def test_recent_works_are_those_that_can_be_opened(session, tmp_path):
    other = 1 - int(session.labels[60, 160])
    session.paint([show(other, 160.0, 60.0)])
    assert [work.files for _, work, _ in recent_works()] == [[tmp_path / "two.toml"]]
    (tmp_path / "two.toml").unlink()
    assert recent_works() == []


def test_a_damaged_work_is_begun_again(session):
    session.paint([show(1, 160.0, 60.0)])
    (session.work.folder / "work.json").write_text("{")
    assert read_work(session.work.folder) is None


@pytest.mark.medium
def test_strokes_survive_another_blend(session):
    other = 1 - int(session.labels[60, 160])
    session.paint([show(other, 160.0, 60.0)])
    session.settle()
    session.work.settings = {"blend": "feather", "tones": "none", "crop": "outside"}
    again = Session(session.work)
    assert again.labels[60, 160] == other


@pytest.mark.medium
@pytest.mark.parametrize("blend", ["none", "soft", "gradient"])
def test_windows_in_every_kind_of_blend(session, blend):
    session.work.settings = {"blend": blend}
    again = Session(session.work)
    other = 1 - int(again.labels[60, 160])
    again.paint([show(other, 160.0, 60.0)])
    again.settle()
    assert again.blended(Box(50, 140, 70, 180)).shape == (20, 40, 3)
    assert again.scene()["blends"] == (blend != "none")


def test_a_canvas_that_goes_all_the_way_round(tmp_path, works):
    rng = np.random.default_rng(0)
    small = Image.fromarray(rng.integers(40, 220, (12, 40, 3), np.uint8))
    turn = np.tile(np.asarray(small.resize((400, 120), Image.Resampling.BICUBIC)), (1, 2, 1))
    text = '[view]\nprojection = "sphere"\nradius = 1.0\nwrap = 400\n'
    for number, left in enumerate((0, 120, 250)):
        Image.fromarray(turn[:, left : left + 190]).save(tmp_path / f"{number}.png")
        text += f'\n[[layer]]\nfile = "{number}.png"\nat = [{left}, 0]\n'
    (tmp_path / "round.toml").write_text(text)
    session = Session(work_of([tmp_path / "round.toml"]))
    assert session.scene()["round"]
    other = 2 - int(session.labels[60, 20])  # pictures 0 and 2 lie there, the last beyond the right edge
    session.paint([show(other, 20.0, 60.0, 5)])
    session.settle()
    assert session.labels[60, 20] == other
    np.testing.assert_array_equal(Session(session.work).labels, session.labels)
    assert session.opened.inside() == [0, 0, 400, 120]
    session.crop_to([30, 20, 100, 60])  # of a whole turn only rows are cropped
    assert session.work.settings["crop"] == "0,20,400,60"


def test_a_crop_is_on_disk_and_in_the_layout(tmp_path, works, monkeypatch):
    from toposeam_cli.edit import preview
    from toposeam_cli.media.layouts.layout import read_layout

    monkeypatch.setattr(preview, "PREVIEW_PIXELS", 16_000)
    session = Session(work_of([walker_pictures(tmp_path)]))
    assert session.opened.crop is None
    assert session.opened.inside() == [0, 0, session.shape[1], session.shape[0]]
    session.crop_to([20, 10, 60, 40])
    text = ",".join(str(round(value / session.opened.scale)) for value in (20, 10, 60, 40))
    assert read_layout(session.work.layout).options["crop"] == text
    again = Session(read_work(session.work.folder))
    np.testing.assert_allclose(again.opened.crop, [20, 10, 60, 40], atol=0.6)


def test_undo_and_redo_of_a_drawn_crop(session):
    session.crop_to([0, 0, 300, 180])
    assert session.can == {"undo": 0, "redo": 0}  # it was chosen, not drawn
    session.crop_to([20, 10, 60, 40])
    session.paint([show(1 - int(session.labels[60, 160]), 160.0, 60.0)])
    session.settle()
    session.crop_to([30, 10, 60, 40])
    crops = [session.opened.crop]
    while session.can["undo"]:
        session.undo()
        crops.append(session.opened.crop)
    assert crops == [[30, 10, 60, 40], [20, 10, 60, 40], [20, 10, 60, 40], [0, 0, 300, 180]]
    assert session.strokes == []
    for _ in range(3):
        session.redo()
    assert read_work(session.work.folder).settings["crop"] == "30,10,60,40"
    assert len(session.strokes) == 1


def test_a_step_of_tone_is_a_place_to_look_at(tmp_path, works):
    plain = np.random.default_rng(3).integers(118, 123, (160, 300, 3)).astype(np.uint8)
    Image.fromarray(plain[:, :200]).save(tmp_path / "left.png")
    Image.fromarray(plain[:, 100:] + np.uint8(5)).save(tmp_path / "right.png")
    layers = "".join(
        f'[[layer]]\nfile = "{name}.png"\nat = [{left}, 0]\n' for name, left in (("left", 0), ("right", 100))
    )
    (tmp_path / "two.toml").write_text(f'[stitch]\nblend = "none"\n\n{layers}')
    session = Session(work_of([tmp_path / "two.toml"]))
    change, whole = session.all(), Box(0, 0, *session.shape)
    assert session.worst() == []  # the pictures are alike
    assert (change.likeness[change.likeness < 255] > 127).all()
    judged = session.judge(whole, session.blended(whole))
    assert judged.labels.size == 0
    assert (judged.likeness[judged.likeness < 255] < 127).all()
    assert session.opened.joined.verdict.step > 1
    assert session.worst()
    assert not session.worst()[0].done
    even = np.full((*session.shape, 3), 120, np.uint8)
    session.judge(whole, even)
    assert all(place.done for place in session.worst())


def test_part_of_a_picture_is_judged_by_itself(session):
    whole, part = Box(0, 0, *session.shape), Box(0, 64, 128, 256)
    session.all()
    pixels = session.blended(whole)
    first = session.judge(whole, pixels).likeness
    second = session.judge(part, pixels[part.slices])
    assert second.squares == Box(0, 8, 4, 12)  # a step of its edges may be that of the box
    np.testing.assert_array_equal(second.likeness, first[second.squares.slices])


def test_too_many_pictures_are_refused():
    from toposeam_cli.edit.opening import check_count

    check_count(100)
    with pytest.raises(ts.OptionError, match="300 pictures are more than the page shows"):
        check_count(300)


def test_layers_of_an_openraster_file(tmp_path, works):
    walker_pictures(tmp_path)
    stack = (
        '<image version="0.0.3" w="320" h="200"><stack><layer name="right" src="data/r.png" x="100" y="0"/>'
        '<layer name="left" src="data/l.png" x="0" y="0"/></stack></image>'
    )
    with zipfile.ZipFile(tmp_path / "two.ora", "w") as archive:
        archive.writestr("mimetype", "image/openraster")
        archive.writestr("stack.xml", stack)
        archive.write(tmp_path / "left.png", "data/l.png")
        archive.write(tmp_path / "right.png", "data/r.png")
    session = Session(work_of([tmp_path / "two.ora"]))
    assert [layer["name"] for layer in session.scene()["layers"]] == ["left", "right"]
    assert session.shape == (200, 320)
    assert session.work.layout.exists()


def test_a_preview_of_a_large_canvas_lies_as_the_whole(tmp_path, works, monkeypatch):
    from toposeam_cli.edit import opening, preview

    monkeypatch.setattr(opening, "ReducedPictures", lambda: preview.ReducedPictures(pixels=16_000))
    session = Session(work_of([walker_pictures(tmp_path)]))
    assert session.shape == (100, 160)
    other = 1 - int(session.labels[50, 80])
    session.paint([show(other, 80.0, 50.0, 4)])
    session.settle()
    (stroke,) = session.gestures[0]
    whole = stroke.points + ([100, 0] if stroke.layer else [0, 0])
    np.testing.assert_allclose(whole, [[160, 100]], atol=1)
    np.testing.assert_allclose(stroke.radius, 8, rtol=0.05)
    again = Session(read_work(session.work.folder))
    np.testing.assert_array_equal(again.labels, session.labels)
