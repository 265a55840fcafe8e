"""What the documents say is what the code does: tables of numbers are made again and compared."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parents[1]


@pytest.mark.slow
def test_the_gallery_has_the_numbers_of_today(tmp_path):
    """``make figures``, into another folder."""
    pytest.importorskip("matplotlib")
    script = (
        "import sys; from pathlib import Path; import make_figures as made, toy_figures\n"
        "made.FIGURES, made.GALLERY = Path(sys.argv[1]) / 'figures', Path(sys.argv[1]) / 'gallery.md'\n"
        "toy_figures.FIGURES = made.FIGURES\n"
        "made.main()"
    )
    shutil.copy(HERE / "docs" / "gallery.md", tmp_path)
    before = (tmp_path / "gallery.md").read_text(encoding="utf-8")
    (tmp_path / "gallery.md").write_text(
        before.partition("<!-- numbers")[0]
        + "<!-- numbers: written by make figures --><!-- end of numbers -->"
        + before.partition("<!-- end of numbers -->")[2],
        encoding="utf-8",
    )
    subprocess.run([sys.executable, "-c", script, str(tmp_path)], cwd=HERE / "docs", check=True, timeout=600)
    assert (tmp_path / "gallery.md").read_text(encoding="utf-8") == before


def rows(text):
    """The lines of a table of benchmarks/quality.py: the variant's name, and its columns."""
    names = "heat|thesis(?:, [^\n]*?)?"
    return {
        name: columns.split() for name, columns in re.findall(rf"^({names})  +(\S.*)$", text, re.MULTILINE)
    }


def variants():
    """What docs/results.md says of the variants of the thesis's method."""
    text = (HERE / "docs" / "results.md").read_text(encoding="utf-8")
    return text.partition("## Variants of the dissertation's method")[2].partition("\n## ")[0]


def measured(*words):
    script = HERE / "benchmarks" / "quality.py"
    ran = subprocess.run(
        [sys.executable, script, *words], capture_output=True, text=True, check=True, cwd=HERE
    )
    return rows(ran.stdout)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_results_state_the_thesis_s_own_cases_as_measured():
    stated = rows(variants().partition("--cases")[2])
    today = measured("--cases")
    assert set(stated) == set(today)
    for name, columns in today.items():
        for was, now in zip(stated[name], columns, strict=True):
            assert was.endswith("*") == now.endswith("*"), name
            assert float(was.rstrip("*")) == pytest.approx(float(now.rstrip("*")), rel=0.01), name


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_results_have_the_main_variants_as_they_are_today(monkeypatch):
    """The others take most of the time; ``make results`` writes all of them."""
    stated = rows(variants().partition("--cases")[0])
    names = ("heat", "thesis", "thesis, Formulation 2")
    today = measured(*(f"--variant={name}" for name in names))
    assert set(today) == set(names)
    monkeypatch.syspath_prepend(str(HERE / "benchmarks"))
    assert set(stated) == set(pytest.importorskip("quality").VARIANTS)
    for name, columns in today.items():
        single, staged, _, median, worst, squares, broke, _ = columns
        told = stated[name]
        for was, now in zip(told[:2], (single, staged), strict=True):
            assert float(was.rstrip("%")) == pytest.approx(float(now.rstrip("%")), abs=4), name
        assert float(told[3]) == pytest.approx(float(median), abs=0.01), name
        assert float(told[4]) == pytest.approx(float(worst), rel=0.1), name
        assert float(told[5]) == pytest.approx(float(squares), rel=0.05), name
        assert told[6] == broke, name


def test_the_sentences_on_the_variants_follow_from_their_table():
    text = " ".join(variants().split())
    stated = rows(variants().partition("--cases")[0])
    usual, unlimited = (stated[f"thesis, plain, move ≤ {move}"] for move in ("0.2", "1"))
    above = [[100 * (float(told[column]) - 1) for column in (3, 4, 5)] for told in (usual, unlimited)]
    assert f"cost {above[0][0]:.0f} %" in text
    assert f"(worst {above[0][1]:.0f} %)" in text
    assert f"it is {above[1][0]:.0f} %" in text
    assert f"by {above[0][2]:.0f} and {above[1][2]:.0f} %" in text
    assert (usual[0], unlimited[0]) == ("92%", "88%")  # "one strip in twelve", "one in eight"
    assert "one strip in twelve keeps several lines" in text
    cases = rows(variants().partition("--cases")[2])["thesis, plain, move ≤ 1"]
    assert f"with 1 it costs {float(cases[1]):.1f} and {float(cases[3]):.1f} times as much" in text


def test_what_is_said_of_workers_is_one_measurement(monkeypatch):
    """The ratio is that of the clocks beside it, and 1,000 frames are as large as the page says."""
    monkeypatch.syspath_prepend(str(HERE / "benchmarks"))
    workers = pytest.importorskip("workers")
    text = (HERE / "docs" / "distributed.md").read_text(encoding="utf-8")
    tables = {
        name: [[cell.strip() for cell in line.strip("|").split("|")] for line in body.strip().splitlines()]
        for name, body in re.findall(
            r"<!-- numbers: written by benchmarks/workers.py, (\w+) -->\n(.*?)<!-- end", text, re.DOTALL
        )
    }
    assert list(tables) == ["processes", "cores", "measured", "parts", "thousand"]
    assert tables["measured"], "that of processes is filled when it is measured"
    for name in ("processes", "cores", "measured"):
        one, two = tables[name][-2:] or (["1", "1", ""], ["2", "1", "1"])
        assert (one[0][0], two[0][0]) == ("1", "2")
        assert float(two[2]) == pytest.approx(float(one[1]) / float(two[1]), abs=0.05)
    said = dict(row for row in tables["thousand"][2:])
    assert said["picture"] == f"{workers.sizes(*workers.THOUSAND)['picture'] / 1e3:.1f} gigapixels"
    assert workers.sizes(*workers.THOUSAND)["frames"] == 24_000
    assert f"{workers.sizes(*workers.FRAMES)['picture']:.0f} megapixels" in text
    hours = [float(said[name].split()[0]) for name in said if name.startswith("time with")]
    assert hours == sorted(hours, reverse=True)
