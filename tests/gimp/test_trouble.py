"""When the engine, the disk or the user gives up: a sentence, the picture as it was, and nothing left
behind.
"""

import os
import signal
import subprocess
import threading
import time
from pathlib import Path

import pytest
from inside import STITCH, refused, succeeded
from pictures import photograph, write_png
from processes import wait_for
from running import Gimp, needs_gimp

import toposeam as ts
from toposeam_engine.serving import PROTOCOL

needs_gimp()


@pytest.fixture
def still_life(image, samples):
    return image(
        [samples / "still_life_left.png", samples / "still_life_right.png"], offsets=[(0, 0), (310, -6)]
    )


def test_no_engine(gimp, engine, still_life):
    engine()
    refused(gimp, still_life, "TOPOSEAM_PYTHON")


def test_an_engine_that_cannot_start(gimp, engine, still_life):
    engine('echo "No module named toposeam_engine" >&2; exit 1')
    refused(gimp, still_life, "No module named toposeam_engine Run “toposeam gimp install”")


def test_an_engine_of_another_release(gimp, engine, still_life):
    engine("""echo '{"event": "hello", "protocol": 1, "version": "9.9"}'; sleep 60""")
    refused(
        gimp, still_life, "the installed TopoSeam is 9.9; run “toposeam gimp install” and start GIMP again"
    )


def test_an_engine_that_talks_nonsense_and_ends(gimp, engine, still_life):
    engine(
        f"""echo '{{"event": "hello", "protocol": {PROTOCOL}, "version": "{ts.__version__}"}}'; """
        "echo nonsense; echo '[]'; exit 3"
    )
    refused(gimp, still_life, "ended unexpectedly (code 3)")


@pytest.fixture
def long_work(gimp, image, tmp_path):
    """A call that takes the engine many seconds, under way in a thread; `pid` of its engine, and `answer`
    when it ended.
    """
    whole, names = photograph(1300, 4200), []
    for left in range(0, 3000, 700):
        names.append(tmp_path / f"from-{left}.png")
        write_png(names[-1], whole[:, left : left + 1400])
    loaded = image(names, offsets=[(0, 0)] * len(names))

    class Work:
        before = gimp.tree(image=loaded["image"])
        image = loaded["image"]
        answer = None

        def call(self):
            self.answer = gimp.run(
                procedure="plug-in-toposeam-panorama", image=loaded["image"], layers=loaded["layers"]
            )

    work = Work()
    thread = threading.Thread(target=work.call)
    thread.start()
    work.engine = wait_for(lambda: gimp.child("toposeam_engine"))
    wait_for(lambda: gimp.leftovers())
    time.sleep(1)
    work.thread = thread
    yield work
    thread.join(180)


def ended(process):
    try:
        return "Z" in Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return True


def test_an_engine_killed_in_the_middle(gimp, long_work):
    os.kill(long_work.engine, signal.SIGKILL)
    long_work.thread.join(180)
    assert long_work.answer["status"] == "execution-error"
    assert "killed" in long_work.answer["message"]
    assert "nothing was changed" in long_work.answer["message"]
    assert gimp.tree(image=long_work.image) == long_work.before
    assert not gimp.leftovers()


def test_cancelling_ends_the_engine_and_changes_nothing(gimp, long_work):
    # GIMP's Cancel button kills the plug-in, which cannot clean up then.
    plug_in = gimp.child("toposeam_gimp.py", "-run")
    os.kill(plug_in, signal.SIGKILL)
    long_work.thread.join(180)
    assert long_work.answer["status"] != "success"
    wait_for(lambda: ended(long_work.engine))
    wait_for(lambda: not gimp.leftovers())
    assert gimp.tree(image=long_work.image) == long_work.before


def test_a_full_disk(real_gimp, tmp_path, samples):
    small = tmp_path / "gimp"
    small.mkdir()
    gimp = Gimp(small)
    try:
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "none", str(small / "tmp")], check=True)
        loaded = gimp.load(
            files=[str(samples / f"still_life_{side}.png") for side in ("left", "right")],
            offsets=[[0, 0], [310, -6]],
        )
        refused(
            gimp,
            loaded,
            f"no space left in the temporary folder {small / 'tmp'}. 3 MiB are needed. Free some",
        )
        subprocess.run(["mount", "-o", "remount,size=100m", str(small / "tmp")], check=True)
        succeeded(gimp.stitch(loaded))
    finally:
        gimp.close()
        subprocess.run(["umount", str(small / "tmp")], check=False)


def test_crashed_requests_are_swept_away(gimp, still_life):
    old = gimp.folder / "tmp" / "toposeam-request-crashed"
    old.mkdir()
    (old / "alive").touch()
    (old / "toposeam-request").write_text("nonce")
    os.utime(old / "alive", (0, 0))
    succeeded(gimp.run(procedure=STITCH, image=still_life["image"], layers=still_life["layers"]))
    assert not gimp.leftovers()
