"""Every command judges where it is to write before it reads anything, or works for minutes in vain."""

import pytest

LINES = (
    "stitch bad.png bad.png --overlap 20 -o {}/x.png",
    "enblend -o {}/x.tif bad.png bad.png",
    "synth bad.png --size 64 -o {}/x.png",
    "tile bad.png -o {}/x.png",
    "tileset bad.png bad.png -o {}/x",
    "fill bad.png --mask bad.png -o {}/x.png",
    "motif --base bad.png -o {}/x.png",
    "repeat bad.png 2x2 --repeat p1 -o {}/x.png",
    "join bad.png bad.png -o {}/x.png",
    "mockup bad.png --on tie -o {}/x.png",
    "path bad.png --from 1,1 --to 2,2 -o {}/x.svg",
    "loop bad.gif -o {}/x.gif",
    "volume bad.npy bad.npy --offset 1,0,0 -o {}/x.npy",
)


@pytest.mark.parametrize("line", LINES, ids=[line.split()[0] for line in LINES])
def test_where_nothing_can_be_written_nothing_is_read(tmp_path, monkeypatch, toposeam, line):
    monkeypatch.chdir(tmp_path)
    for name in ("bad.png", "bad.gif", "bad.npy"):
        (tmp_path / name).write_bytes(b"no picture")
    toposeam(*line.format("nowhere").split()).fails("there is no folder")
    (tmp_path / "there").mkdir()
    read = toposeam(*line.format("there").split())
    assert read.code == 1
    assert "bad." in read.err  # and then what is read is what is wrong
