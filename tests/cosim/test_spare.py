"""Processes that are started ahead: taken by the next run or sweep, ended where nobody takes them."""

from __future__ import annotations

import sys
from operator import itemgetter

import pytest
import unflushed

from gapsense._os import processes as spare
from gapsense.cosim import ScenarioError, run, sweep
from gapsense.cosim.fmu.instance import is_needed
from gapsense.cosim.run import ahead as of_runs


def answer_of(process):
    """What the first of two numbers is, says a process."""
    process.prepare(itemgetter, 0)
    return process.ask([42, 43], "the test")


def test_next_process_is_the_one_that_was_started_ahead_and_has_loaded_its_modules():
    with spare.ahead("this"):  # which prints a text
        (waiting,) = spare._waiting
        with spare.ahead("this", count=2):  # has what is there already
            taken = spare.process(limit=3.0)
        assert taken is waiting
        assert taken.limit == 3.0
        assert not spare._waiting
        other = spare.process()
        try:
            assert answer_of(taken) == answer_of(other) == 42
            assert "Beautiful is better than ugly." in taken.words()
            assert other.words() == ""
        finally:
            taken.close()
            other.close()
    assert taken.process.returncode == 0


def test_one_that_is_taken_is_followed_by_another_on_request_and_the_last_is_ended():
    with spare.ahead(again=True):
        first, second = spare.process(), spare.process()
        (last,) = spare._waiting
        assert len({id(first), id(second), id(last)}) == 3
        first.close()
        second.close()
    assert not spare._waiting
    assert last.process.returncode is not None
    assert not last.folder.exists()
    with spare.ahead():
        spare.process().close()
        assert not spare._waiting


def test_function_of_a_module_elsewhere_gets_a_process_that_finds_it():
    with spare.ahead():
        guest = spare.process(guest=run)
        assert len(spare._waiting) == 1
        guest.close()


@pytest.mark.skipif(sys.platform == "win32", reason="calls the C library of POSIX")
def test_what_a_library_has_written_is_on_the_disk_after_the_end(tmp_path):
    process = spare.process(guest=unflushed.prepare)
    process.prepare(unflushed.prepare, str(tmp_path / "log.txt"))
    process.ask("the last words", "the test")
    process.close()
    assert process.process.returncode == 0
    assert (tmp_path / "log.txt").read_text() == "the last words"


def test_nothing_is_left_of_what_a_wrong_scenario_did_not_need(write, chain, fmus, monkeypatch):
    started = []
    monkeypatch.setattr(spare, "Process", lambda *a, **k: started.append(kept(*a, **k)) or started[-1])
    path = write(chain.replace("Gain", "Nothing"))
    for function in (run, sweep):
        options = {"isolation": "process"} if function is run else {}
        with pytest.raises(ScenarioError):
            function(path, fmus=fmus, **options)
    assert started
    assert all(process.process.returncode is not None and not process.folder.exists() for process in started)


kept = spare.Process


def test_runs_unpack_no_documentation_no_sources_and_no_binaries_of_other_platforms():
    import fmpy

    own = f"binaries/{fmpy.platform}/"
    needed = ["modelDescription.xml", own + "X.so", f"binaries/{fmpy.platform_tuple}/sub/y.so", "resources/a/b.csv"]
    needed += ["resources/sources/x.c", "extra/org.x/y.xml", "model.png", "binaries/"]
    assert all(map(is_needed, needed))
    assert not any(map(is_needed, ["documentation/index.html", "sources/a.c", "binaries/amiga/X.so"]))


FOREIGN = """
title = "Foreign"
[experiment]
stop = 1.0
base_step = 0.1
[components.source]
fmu = "NAME"
"""


@pytest.mark.parametrize(("name", "engine", "count"), [
    ("Source.fmu", "auto", 1),
    ("PotMagnet.fmu", "auto", 0),
    ("PotMagnet.fmu", "fmu", 1),
    ("Source.fmu", "vectors", 1),
])  # fmt: skip
def test_many_runs_start_processes_ahead_unless_vectors_will_do_them(tmp_path, monkeypatch, name, engine, count):
    monkeypatch.setattr(of_runs, "likely_vectors", lambda engine: engine != "fmu")
    (tmp_path / "scenario.toml").write_text(FOREIGN.replace("NAME", name), encoding="utf-8")
    with of_runs.runs_ahead(1, engine, tmp_path / "scenario.toml"):
        assert len(spare._waiting) == count
    assert not spare._waiting
