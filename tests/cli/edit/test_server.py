"""The server: who gets in, what it takes, and what it says, without a browser."""

import json
import socket
from pathlib import Path

import pytest
from edit_pages import OWN, PORT, TOKEN, hear, live, program, unpacked, walker_pictures

pytest.importorskip("starlette")
pytest.importorskip("httpx2")

from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from toposeam_cli.edit.messages import MessageError, packed, parsed
from toposeam_cli.edit.server import Hub, application
from toposeam_cli.edit.work import work_of


@pytest.fixture
def works(tmp_path, monkeypatch):
    monkeypatch.setenv("TOPOSEAM_WORKS", str(tmp_path / "works"))
    return tmp_path / "works"


@pytest.fixture
def hub(works):
    return Hub(work_of([]), None, lambda: None)


@pytest.fixture
def client(hub):
    with TestClient(application(hub, TOKEN, PORT), base_url=OWN) as client:
        yield client


def test_the_page_and_its_parts_come_with_the_token(client):
    page = client.get(f"/{TOKEN}/")
    assert page.status_code == 200
    assert "default-src 'none'" in page.headers["content-security-policy"]
    assert page.headers["referrer-policy"] == "no-referrer"
    for part in ("main.js", "style.css", "words.json", "seams.js"):
        answer = client.get(f"/{TOKEN}/page/{part}")
        assert answer.status_code == 200, part
        assert answer.headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize(
    "path", ["/", "/wrong/", "/page/main.js", "/live", "//", "/right-toke/", "/right-token2/", "/%00/", "/é/"]
)
def test_nothing_without_the_token(client, path):
    assert client.get(path).status_code == 403


@pytest.mark.parametrize(
    "headers",
    [
        {"host": "evil.example"},
        {"host": f"evil.example:{PORT}"},
        {"host": f"127.0.0.1:{PORT + 1}"},
        {"host": f"127.0.0.1.evil.example:{PORT}"},
        {"host": ""},
        {"origin": "http://evil.example"},
        {"origin": f"http://127.0.0.1:{PORT + 1}"},
        {"origin": "null"},
        {"origin": f"https://127.0.0.1:{PORT}"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
    ],
)
def test_requests_of_strangers_are_refused(client, headers):
    assert client.get(f"/{TOKEN}/", headers=headers).status_code == 403
    with pytest.raises(WebSocketDisconnect), live(client, **headers):
        pass


def test_sockets_need_token_and_origin(client):
    with pytest.raises(WebSocketDisconnect), live(client, "wrong"):
        pass
    address = f"ws://127.0.0.1:{PORT}/{TOKEN}/live"
    own = {"host": f"127.0.0.1:{PORT}"}
    with pytest.raises(WebSocketDisconnect), client.websocket_connect(address, headers=own):
        pass


def test_posts_need_an_origin(client):
    assert client.post(f"/{TOKEN}/drop?name=a.jpg", content=b"x").status_code == 403


@pytest.mark.parametrize(
    "path",
    [
        "page/../../server.py",
        "page/%2e%2e/server.py",
        "page/..%2f..%2fsession.py",
        "page//etc/passwd",
        "page/%2fetc%2fpasswd",
        "saved/..%2f..%2fwork.json",
        "saved/anything",
        "page/",
    ],
)
def test_no_file_is_read_but_those_of_the_page(client, path):
    assert client.get(f"/{TOKEN}/{path}").status_code in (403, 404)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "null",
        "{",
        '{"kind": "evil"}',
        '{"kind": ["stroke"]}',
        '{"kind": "stroke"}',
        '{"kind": "save", "format": "../x"}',
        '{"kind": "settings", "settings": {"output": "/etc/passwd"}}',
        '{"kind": "settings", "settings": {"blend": "--output=x"}}',
        '{"kind": "settings", "settings": {"crop": "1,2,3,4"}}',
        '{"kind": "crop", "box": [[0, 0], [0, 5]]}',
        '{"kind": "take", "x": NaN, "y": 1, "layer": 0}',
        '{"kind": "take", "x": 1e300, "y": 1, "layer": 0}',
        '{"kind": "take", "x": 1, "y": 1, "layer": -1}',
        '{"kind": "take", "x": true, "y": 1, "layer": 0}',
        '{"kind": "open", "files": ["/etc/passwd"]}',
        json.dumps({"kind": "erase", "radius": 3, "points": [[0, 0]] * 5000}),
        json.dumps({"kind": "erase", "radius": 3, "points": [[0, 0, 0]]}),
        json.dumps({"kind": "erase", "radius": 0, "points": [[0, 0]]}),
        json.dumps({"kind": "erase", "radius": 3, "points": []}),
        "[" * 100_000,
        json.dumps({"kind": "undo", "more": "x" * 300_000}),
    ],
)
def test_messages_that_no_page_sends_end_the_socket(client, text):
    with pytest.raises(MessageError):
        parsed(text)
    with live(client) as ws:
        hear(ws, "hello")
        ws.send_text(text)
        with pytest.raises(WebSocketDisconnect):
            ws.receive_bytes()
    with live(client) as ws:  # the server goes on
        assert hear(ws, "hello")[0]["owner"]


def test_a_message_keeps_only_what_it_means():
    text = '{"kind": "take", "x": 1, "y": 2.5, "layer": 0, "path": "/etc"}'
    assert parsed(text) == {"kind": "take", "x": 1.0, "y": 2.5, "layer": 0}
    assert unpacked(packed("state", {"a": 1}, [b"xy", b""])) == (
        {"a": 1, "kind": "state", "sizes": [2, 0]},
        [b"xy", b""],
    )


def drop(client, name, content):
    return client.post(f"/{TOKEN}/drop", params={"name": name}, content=content, headers={"origin": OWN})


@pytest.mark.parametrize(
    "name", ["../../x.png", "/etc/x.png", "C:\\x.png", "..", ".x", "", "a/b\0.png", "x" * 500]
)
def test_dropped_names_lead_nowhere(client, hub, works, name):
    with live(client) as ws:
        hear(ws, "hello")
        number = drop(client, name, b"data").json()["file"]
        work = hub.dropped.as_work([number])
    (path,) = work.files
    assert path.parent == work.pictures
    assert path.read_bytes() == b"data"
    assert path.resolve().is_relative_to(works.resolve())
    assert len(path.name) <= 120


def test_what_is_dropped_and_not_used_is_gone_in_the_end(works):
    hub = Hub(work_of([]), None, lambda: None)
    with TestClient(application(hub, TOKEN, PORT), base_url=OWN) as client, live(client) as ws:
        hear(ws, "hello")
        assert drop(client, "a.png", b"x" * 1000).status_code == 200
        assert any(works.rglob("0"))
    assert list(works.rglob("*")) == []


def test_a_full_disk_while_dropping_is_one_sentence(client, monkeypatch):
    from pathlib import Path

    class Full:
        def __enter__(self):
            return self

        def __exit__(self, *_):
            return None

        def write(self, data):
            raise OSError(28, "No space left on device")

    usual = Path.open
    monkeypatch.setattr(
        Path, "open", lambda path, mode="r", **more: Full() if mode == "wb" else usual(path, mode, **more)
    )
    with live(client) as ws:
        hear(ws, "hello")
        answer = drop(client, "a.png", b"x")
    assert answer.status_code == 400
    assert "free some space" in answer.json()["text"]


def test_only_a_page_drops(client):
    assert drop(client, "a.png", b"x").status_code == 409


def test_no_picture_dropped_is_said(client):
    with live(client) as ws:
        hear(ws, "hello")
        ws.send_text('{"kind": "open", "files": [3]}')
        assert "drop at least two" in hear(ws, "failed")[0]["text"]


@pytest.fixture
def opened(tmp_path, works):
    hub = Hub(work_of([walker_pictures(tmp_path)]), None, lambda: None)
    with TestClient(application(hub, TOKEN, PORT), base_url=OWN) as client:
        yield client


def stroke(kind="show", layer=0, done=True, points=((160.0, 60.0),)):
    return json.dumps(
        {
            "kind": "stroke",
            "id": 1,
            "stroke": kind,
            "layer": layer,
            "radius": 6,
            "points": [list(point) for point in points],
            "done": done,
        }
    )


@pytest.mark.slow
def test_pictures_scene_stroke_undo_over_the_socket(opened):
    with live(opened) as ws:
        assert hear(ws, "prints")[0]["names"] == ["left.png", "right.png"]
        assert hear(ws, "print")[1][0][:2] == b"\xff\xd8"
        scene, blocks = hear(ws, "scene")
        assert len(blocks) == 3
        assert blocks[1][8:12] == b"WEBP"
        head, (labels, _) = hear(ws, "state")
        height, width = scene["shape"]
        assert len(labels) == height * width
        layer = 2 - labels[60 * width + 160]
        ws.send_text(stroke(layer=layer, done=False))
        assert hear(ws, "state")[0]["undo"] == 0
        ws.send_text(stroke(layer=layer))
        head, _ = hear(ws, "state")
        assert (head["undo"], head["done"], head["id"]) == (1, True, 1)
        ws.send_text(stroke(layer=99))
        ws.send_text('{"kind": "blend", "box": [0, 0, 50, 60]}')
        head, (jpeg,) = hear(ws, "blend")
        assert head["box"] == [0, 0, 50, 60]
        assert jpeg[:2] == b"\xff\xd8"
        ws.send_text('{"kind": "undo"}')
        assert hear(ws, "state")[0]["redo"] == 1


@pytest.mark.slow
def test_a_second_page_looks_on_until_it_takes_over(opened):
    with live(opened) as first:
        assert hear(first, "hello")[0]["owner"]
        hear(first, "rest")
        with live(opened) as second:
            assert not hear(second, "hello")[0]["owner"]
            _, (labels, _) = hear(second, "state")
            layer = 2 - labels[60 * 320 + 160]
            second.send_text(stroke(layer=layer))
            second.send_text('{"kind": "takeover"}')
            assert hear(second, "role")[0]["owner"]
            assert not hear(first, "role")[0]["owner"]
            second.send_text(stroke(layer=layer))
            assert hear(first, "state")[0]["undo"] == 1  # the stroke before was not heard


@pytest.mark.slow
def test_the_end_of_one_save_leaves_the_next_alone(hub, monkeypatch):
    begun, heard = [], []
    monkeypatch.setattr(
        "toposeam_cli.edit.server.Worker", lambda function, arguments, take: begun.append(take) or object()
    )
    monkeypatch.setattr(hub, "tell", heard.append)
    for _ in range(2):
        hub._write("stitch", [], Path("joined.png"))
        begun[-1](("saved", "joined.png", 1.0))
    hub._write("stitch", [], Path("joined.png"))
    running = hub._saving
    begun[1](None)  # the process of the second has ended by now
    assert hub._saving is running
    assert not any(b"cancelled" in message for message in heard)
    begun[2](None)
    assert hub._saving is None
    assert b"cancelled" in heard[-1]


def test_pictures_that_do_not_belong_together(tmp_path, works):
    import numpy as np
    from PIL import Image

    rng = np.random.default_rng(1)
    files = []
    for name in ("a.png", "b.png"):
        Image.fromarray(rng.integers(0, 255, (90, 120, 3), np.uint8)).save(tmp_path / name)
        files.append(tmp_path / name)
    for given, sentence in ((files, "a.png"), (files[:1], "only one picture")):
        hub = Hub(work_of(given), None, lambda: None)
        with TestClient(application(hub, TOKEN, PORT), base_url=OWN) as client, live(client) as ws:
            text = hear(ws, "refused")[0]["text"]
            assert sentence in text
            assert "\n" not in text


@pytest.mark.slow
def test_the_program_ends_with_nothing_left(tmp_path):
    works = tmp_path / "works"
    layout = walker_pictures(tmp_path)
    with program(layout, works=works) as (running, address):
        assert address.startswith("http://127.0.0.1:")
        port = int(address.split(":")[2].split("/")[0])
        with socket.create_connection(("127.0.0.1", port)) as raw:
            raw.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            assert b" 403 " in raw.recv(100)
        with socket.create_connection(("127.0.0.1", port)) as raw:
            raw.sendall(b"\x16\x03\x01" + b"\xff" * 2000)
            raw.recv(100)
        assert running.poll() is None
    assert list(works.rglob("*")) == []
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", port))


@pytest.mark.medium
def test_a_port_that_is_taken_is_said(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with program("--port", port, works=tmp_path / "works") as (running, address):
            assert address == ""
            assert f"port {port} cannot be used" in running.stderr.read()


def test_all_words_are_in_all_languages():
    import re

    from toposeam_cli.edit.server import PAGE

    table = json.loads((PAGE / "words.json").read_text(encoding="utf-8"))
    count = len(table["languages"])
    assert all(len(own) == count and all(own) for own in table["words"].values())
    used = set()
    for path in PAGE.glob("*.js"):
        used |= set(re.findall(r"""word\('([a-z_]+)'""", path.read_text(encoding="utf-8")))
    assert used <= set(table["words"])


def test_the_page_has_the_languages_of_the_plug_in():
    from pathlib import Path

    import toposeam_gimp
    from toposeam_cli.edit.server import PAGE

    locale = Path(toposeam_gimp.__file__).parent / "locale"
    table = json.loads((PAGE / "words.json").read_text(encoding="utf-8"))
    assert {each.name for each in locale.iterdir() if each.is_dir()} | {"en"} == set(table["languages"])
