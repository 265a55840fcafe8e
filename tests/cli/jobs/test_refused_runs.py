"""What is refused before any job begins."""

from pathlib import Path

import pytest

from toposeam.errors import OptionError
from toposeam_cli.jobs.runner import Job, run


@pytest.mark.parametrize("content", ["precious", '{"name": 3}\n', "[]\n", "a\nb\n"])
def test_a_file_that_is_no_table_of_results_is_kept(tmp_path, content):
    table = tmp_path / "table"
    table.write_text(content)
    with pytest.raises(OptionError, match="choose another file"):
        list(run([], journal=table))
    assert table.read_text() == content


@pytest.mark.parametrize(
    ("jobs", "phrase"),
    [
        ([Job("a", "m:f", {}), Job("a", "m:f", {})], "two jobs are called 'a'"),
        (
            [Job("a", "m:f", {}, (Path("x.png"),)), Job("b", "m:f", {}, (Path("../{here}/x.png"),))],
            "'a' and 'b' both write",
        ),
        ([Job("a", "m:f", {}, (Path("x.png"),)), Job("b", "m:f", {}, (), (Path("x.png"),))], "'a' writes"),
        ([Job("a", "m:f", {}, (Path("x.png"),), (Path("x.png"),))], "itself writes"),
    ],
)
def test_jobs_in_each_other_s_way_are_refused_before_any_work(tmp_path, monkeypatch, jobs, phrase):
    monkeypatch.chdir(tmp_path)
    there = [
        Job(
            job.name,
            job.function,
            {},
            tuple(Path(str(path).format(here=tmp_path.name)) for path in job.outputs),
            job.inputs,
        )
        for job in jobs
    ]
    with pytest.raises(OptionError, match=phrase):
        run(there, journal=tmp_path / "results.jsonl")
    assert not list(tmp_path.iterdir())
