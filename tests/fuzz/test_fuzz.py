"""Thousands of bad and good calls, drawn by a seed: no traceback, no leftover, no changed input, nothing that
takes long or much.

``TOPOSEAM_FUZZ=32 pytest tests/fuzz`` does 32 times as many, with other seeds each time if
``TOPOSEAM_FUZZ_SEED`` says so.
"""

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

HERE = Path(__file__).parent
TIMES = int(os.environ.get("TOPOSEAM_FUZZ", "1"))
FIRST = int(os.environ.get("TOPOSEAM_FUZZ_SEED", "0"))
#: No case may be silent for longer, s: what hangs in compiled code hears no alarm.
SILENCE_S = 180.0


def outcomes(script, seed, count, folder):
    """What a fuzzer tells of its cases; the last one is a problem if it does not come to its end."""
    ended = {"case": -1}
    with subprocess.Popen(
        [sys.executable, "-X", "faulthandler", str(HERE / script), str(seed), str(count)],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore"},
    ) as child:
        noise = []
        threading.Thread(target=lambda: noise.extend(child.stderr), daemon=True).start()
        watch = threading.Timer(SILENCE_S, child.send_signal, (signal.SIGABRT,))
        watch.start()
        for line in child.stdout:
            watch.cancel()
            watch = threading.Timer(SILENCE_S, child.send_signal, (signal.SIGABRT,))
            watch.start()
            ended = json.loads(line)
            yield ended
        watch.cancel()
        code = child.wait()
    if code or ended["case"] != count - 1:
        yield {"case": ended["case"] + 1, "problem": f"ended with {code}: {''.join(noise)[-3000:]}"}


def problems(script, seed, count, folder):
    found = list(outcomes(script, seed, count, folder))
    assert len(found) >= count
    bad = [outcome for outcome in found if outcome["problem"]]
    return found, "\n\n".join(f"{each.get('words', each['case'])}\n{each['problem']}" for each in bad[:8])


@pytest.mark.slow
@pytest.mark.timeout(300 + 300 * TIMES)
@pytest.mark.parametrize("seed", range(FIRST, FIRST + 3))
def test_commands(tmp_path, seed):
    found, bad = problems("commands.py", seed, 100 * TIMES, tmp_path)
    assert not bad, bad
    codes = [outcome["code"] for outcome in found]
    assert codes.count(0) > len(codes) / 20, (
        "hardly anything works: the fuzzer does not reach the deeper rooms"
    )


@pytest.mark.slow
@pytest.mark.timeout(300 + 300 * TIMES)
def test_names_write_nothing_to_a_terminal(tmp_path):
    found, bad = problems("terminal.py", FIRST, 60 * TIMES, tmp_path)
    assert not bad, bad
    codes = [outcome["code"] for outcome in found]
    assert codes.count(0) > len(codes) / 20
    assert any("\\x1b" in outcome["said"] for outcome in found), "no strange name was ever shown"


@pytest.mark.slow
@pytest.mark.timeout(300 + 300 * TIMES)
@pytest.mark.parametrize("seed", range(FIRST, FIRST + 2))
def test_functions(tmp_path, seed):
    found, bad = problems("functions.py", seed, 140 * TIMES, tmp_path)
    assert not bad, bad
    codes = [outcome["code"] for outcome in found]
    assert codes.count(0) > len(codes) / 20, (
        "hardly anything works: the fuzzer does not reach the deeper rooms"
    )


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_every_argument_is_refused_in_a_sentence(tmp_path):
    """Each argument of each function in turn, with each value that may be wrong."""
    ran = subprocess.run(
        [sys.executable, HERE / "sweep.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore"},
    )
    assert ran.returncode == 0, ran.stderr[-3000:]
    found = {line["function"]: line["bad"] for line in map(json.loads, ran.stdout.splitlines())}
    assert len(found) > 40
    assert not any(found.values()), {name: bad for name, bad in found.items() if bad}
