"""``toposeam doctor``: what works, what is missing, and what is wrong."""

import re
import sys

import pytest

import toposeam as ts
from toposeam_cli.commands import doctor
from toposeam_cli.gimp.doctor import Finding
from toposeam_cli.media.pictures import libvips


@pytest.fixture(autouse=True)
def no_gimp(monkeypatch):
    def none(_):
        raise ts.OptionError("no profile")

    monkeypatch.setattr(doctor, "profiles", none)
    monkeypatch.setattr(doctor, "programs", list)


def test_all_is_well_here(toposeam):
    ran = toposeam("doctor")
    assert ran.code == 0
    assert "PROBLEM" not in ran.out
    assert "two pictures are joined" in ran.out
    assert re.search(r"by libvips 8\.\d+", ran.out)
    assert ran.out.rstrip().endswith("Everything needed is here.")


def test_what_is_not_installed_is_named_with_its_extra(toposeam, monkeypatch):
    monkeypatch.setattr(doctor, "find_spec", lambda module: None if module == "zarr" else module)
    ran = toposeam("doctor")
    assert ran.code == 0
    assert (
        "missing  volumes: OME-Zarr in volume\n         → in the checkout: pip install '.[cli,volumes]'"
        in ran.out
    )
    assert ran.out.count("missing") == 1


def test_a_picture_library_that_is_gone_is_a_problem(toposeam, monkeypatch):
    libvips.load_vips.cache_clear()
    monkeypatch.setitem(sys.modules, "pyvips", None)
    ran = toposeam("doctor")
    libvips.load_vips.cache_clear()
    assert ran.code == 1
    assert re.search(r"PROBLEM  pictures are not read or written: .*pip install 'pyvips", ran.out)


def test_a_library_that_joins_wrongly_is_a_problem(toposeam, monkeypatch):
    monkeypatch.setattr(doctor.ts, "stitch", lambda layers: layers[0])
    ran = toposeam("doctor")
    assert ran.code == 1
    assert "PROBLEM  two pictures are joined wrongly" in ran.out


def test_an_installed_plug_in_is_examined(toposeam, monkeypatch, tmp_path):
    class Installed:
        plug_in = tmp_path / "toposeam_gimp"

    Installed.plug_in.mkdir()
    (Installed.plug_in / "toposeam_gimp.py").write_text("")
    monkeypatch.setattr(doctor, "profiles", lambda _: [Installed])
    monkeypatch.setattr(
        doctor, "examine", lambda found: [Finding(False, f"{len(found)} is broken", "mend it")]
    )
    ran = toposeam("doctor")
    assert ran.code == 1
    assert "PROBLEM  1 is broken\n         → mend it" in ran.out
