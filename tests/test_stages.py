"""The table of where a command's time goes."""

import pytest

from test_house import HERE


@pytest.fixture
def stages(monkeypatch):
    monkeypatch.syspath_prepend(str(HERE / "benchmarks"))
    import stages

    return stages


@pytest.mark.medium
def test_all_of_a_stitch_is_charged_to_stages(stages, tmp_path):
    pictures = [str(HERE / f"samples/coffee_{one}.jpg") for one in "ab"]
    found = stages.stages_of(["stitch", *pictures, "-o", "out.png", "-q"], tmp_path)
    assert {"start, imports", "features"} <= set(found) <= set(stages.ORDER)
    assert found.get("other", 0.0) < 0.1 * sum(found.values())
    assert stages.stages_of(["stitch", pictures[0], "-o", "out.png"], tmp_path) == {}


def test_every_stage_names_modules_that_are_there(stages):
    modules = [path.as_posix() for room in ("core", "cli") for path in (HERE / room).rglob("*.py")]
    assert not [
        part for part in stages.STAGES if part[0] != "<" and not any(part in path for path in modules)
    ]


def test_a_table_adds_up(stages):
    columns = {"ours": {"read": 1.0, "warp": 3.0}, "theirs": {"warp": 1.0}, "none": {}}
    head, *rows = stages.table(columns).splitlines()
    assert head.split() == ["ours", "theirs"]
    assert [row.split() for row in rows] == [
        ["read", "1.00", "25%"],
        ["warp", "3.00", "75%", "1.00", "100%"],
        ["all", "4.00", "100%", "1.00", "100%"],
    ]
