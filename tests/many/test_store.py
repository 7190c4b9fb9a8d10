"""A store is whole at whatever moment its writer is killed: nothing is lost, nothing is there twice, damage is told."""

from __future__ import annotations

import errno
import importlib.util
import json
import random
import shutil
import signal
import sqlite3
import sys
import time
from base64 import b64encode
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gapsense.many import store as of
from gapsense.many.columns import Columns, contents
from gapsense.many.result import FORMAT, KEY, Campaign, read_campaign
from gapsense.many.store import Store
from gapsense.problems import InputError

COLUMNS = Columns(
    factors={"a.x": ("double", "V"), "a.name": ("string", "")},
    metrics={"m": "A"},
    signals={"a.y": "V"},
    texts={"a.name": [f"n{k}" for k in range(100)]},
)
ABOUT = {"format": FORMAT, "title": "t", "runs": 100, "scenario": "s", "labels": {}, "columns": COLUMNS.facts()}
NAME = "campaign.sqlite"


def opened(folder):
    store = Store(folder / NAME, KEY)
    store.describe(ABOUT)
    return store


def add(store, *runs, broken=5):
    """Runs as a worker might have answered them, of which one failed."""
    entries = []
    for k in runs:
        samples = np.array([[0.0, 0.1], [k, 2.0 * k]]).astype("<f8").tobytes()
        good = {"metrics": {"m": k / 7}, "wall": 0.1, "trajectory": b64encode(samples).decode()}
        asked = {"index": k, "shift": k, "values": {"a.x": 0.5 * k, "a.name": f"n{k}"}}
        entries.append({**asked, **({"error": "broken"} if k == broken else good)})
    store.add(*contents(COLUMNS, entries))


def held(folder):
    """Runs that are there, each as often as it is."""
    return read_campaign(folder).column("run").tolist()


def content(folder):
    """All that a result tells."""
    campaign = read_campaign(folder)
    good = [run for run in campaign.column("run").tolist() if run != 5]
    return {name: str(column.tolist()) for name, column in campaign.table().items()}, {
        run: campaign.trajectory(run)["a.y"].tolist() for run in good
    }


def test_what_is_added_is_read_at_once_and_after_each_step(tmp_path):
    store = opened(tmp_path)
    add(store, 4, 2, broken=2)
    for step in (lambda: None, store.close, lambda: Store(tmp_path / NAME, KEY).close()):
        step()
        campaign = read_campaign(tmp_path)
        table = {name: column.tolist() for name, column in campaign.table().items()}
        assert (table["run"], table["a.x"], table["a.name"]) == ([2, 4], [1.0, 2.0], ["n2", "n4"])
        assert (table["m"][1], table["error"]) == (4 / 7, ["broken", None]) and np.isnan(table["m"][0])
        assert (campaign.rows, campaign.failed, campaign.errors(5)) == (2, 1, [(2, "broken")])
        assert campaign.trajectory(4)["a.y"].tolist() == [4.0, 8.0]
        with pytest.raises(InputError, match="no signals of run 2"):
            campaign.trajectory(2)
    assert campaign.units == {"a.x": "V", "a.name": "", "m": "A", "wall": "s"}


def test_one_file_is_left_and_an_untouched_one_keeps_its_bytes(tmp_path):
    with opened(tmp_path) as store:
        add(store, 1)
    assert [file.name for file in tmp_path.iterdir()] == [NAME]
    before = (tmp_path / NAME).read_bytes()
    with opened(tmp_path) as store:
        assert store.count() == 1
    assert (tmp_path / NAME).read_bytes() == before


def test_runs_of_several_keys_are_told_apart(tmp_path):
    for key in ("a", "b", "a"):
        with Store(tmp_path / "x.sqlite", key) as store:
            store.describe({"of": key})
            store.add({store.count(): b"%b" % key.encode()})
    for key, runs in (("a", [0, 1]), ("b", [0])):
        with Store(tmp_path / "x.sqlite", key, is_reader=True) as store:
            assert store.runs().tolist() == runs and store.about == {"of": key}
            assert store.content(of.RUNS, 0) == key.encode()
            assert [key for key, _ in store.entries().values()] == ["a", "b"]
    with Store(tmp_path / "x.sqlite", "c", is_reader=True) as store:
        assert store.about is None and store.count() == 0


def test_a_run_counts_once(tmp_path):
    with Store(tmp_path / "x.sqlite", "a") as store:
        store.describe({})
        store.add({1: b"first"})
        store.add({1: b"second", 2**48 - 1: b"last"})
        assert store.content(of.RUNS, 1) == b"first" and store.runs().tolist() == [1, 2**48 - 1]
        assert store.runs(below=100).tolist() == [1]
        store.forget([1])
        assert store.content(of.RUNS, 1) is None


def test_store_without_a_file_is_one(tmp_path):
    with of.alone(None), Store(None, KEY) as store:
        store.describe(ABOUT)
        add(store, 3, 5)
        found = Campaign(tmp_path, store, ABOUT, COLUMNS, store.count())
        assert (found.column("m")[0], found.failed) == (3 / 7, 1) and not list(tmp_path.iterdir())


def test_unknown_column_is_told(tmp_path):
    with opened(tmp_path) as store:
        add(store, 1)
    with pytest.raises(InputError, match=r"no column `wal`\. Did you mean `wall`"):
        read_campaign(tmp_path).column("wal")


def test_columns_of_a_growing_result_never_differ_in_length(tmp_path):
    store = opened(tmp_path)
    add(store, 1)
    plain, held_back = read_campaign(tmp_path), read_campaign(tmp_path, hold=True)
    add(store, 2)
    with pytest.raises(InputError, match=r"it has changed since it was read\. Read it again"):
        plain.column("m")
    assert held_back.column("run").tolist() == [1] and held(tmp_path) == [1, 2]


@pytest.mark.parametrize("older", [b"", b"{}", b"no database at all, but a text that is long enough" * 100])
def test_what_is_no_campaign_is_refused(tmp_path, older):
    (tmp_path / NAME).write_bytes(older)
    with pytest.raises(InputError, match=r"not a campaign of this version|it is damaged"):
        read_campaign(tmp_path)
    with pytest.raises(InputError, match="The folder of a campaign's result is expected"):
        read_campaign(tmp_path / "none")


def test_campaign_of_an_earlier_version_is_refused_with_what_reads_it(tmp_path):
    (tmp_path / "campaign.json").write_text('{"format": "gapsense campaign 2"}')
    with pytest.raises(InputError, match=r"of an earlier version.*pandas\.read_parquet.*/runs\"\)`\. Run the campaign"):
        read_campaign(tmp_path)


@pytest.mark.parametrize("kind", ["nfs4", "ext4"])
def test_network_file_system_has_no_log_and_is_told(tmp_path, monkeypatch, caplog, kind):
    mounts = tmp_path / "mounts"
    mounts.write_text(f"none / tmpfs rw 0 0\nhost:/x {tmp_path} {kind} rw 0 0\n")
    monkeypatch.setattr(of, "MOUNTS", mounts)
    store = opened(tmp_path / "out")
    add(store, 1)
    has_log = (tmp_path / "out" / f"{NAME}-wal").exists()
    assert has_log is (kind == "ext4") and ("no write-ahead log" in caplog.text) is not has_log
    assert held(tmp_path / "out") == [1]


# damage


def filled(folder):
    with opened(folder) as store:
        for group in ([9, 1, 5], [7, 3], [2, 8, 0]):
            add(store, *group)


def test_a_run_that_is_counted_is_on_the_disk(tmp_path):
    """As users have it: no other test waits for the disk (tests/conftest.py)."""
    spec = importlib.util.spec_from_file_location("as_users_have_it", of.__file__)
    fresh = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(fresh)
    with fresh.Store(tmp_path / NAME, KEY) as store:
        assert store.connection.execute("PRAGMA synchronous").fetchone() == (2,)  # FULL


RUNS_OF_FILLED = [0, 1, 2, 3, 5, 7, 8, 9]


def computed_again(folder):
    """What a writer does: it computes what is not there."""
    with opened(folder) as store:
        missing = [run for run in RUNS_OF_FILLED if run not in store.runs()]
        add(store, *missing)
    return missing


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_flipped_bit_is_told_or_changes_nothing(tmp_path_factory, caplog, data):
    folder = tmp_path_factory.mktemp("flipped")
    filled(folder)
    expected, file = content(folder), folder / NAME
    damaged = bytearray(file.read_bytes())
    page = data.draw(
        st.integers(0, len(damaged) // of.PAGE - 1)
    )  # most of a page is empty; what is full is at its ends
    place = data.draw(st.integers(0, 140) | st.integers(of.PAGE - 700, of.PAGE - 1))
    damaged[page * of.PAGE + place] ^= 1 << data.draw(st.integers(0, 7))
    file.write_bytes(damaged)
    caplog.clear()
    try:
        assert content(folder) == expected
        is_told = False
    except InputError as error:
        assert NAME in str(error) and "damaged" in str(error) and "Run it again" in str(error)
        is_told = True
    caplog.clear()
    missing = computed_again(folder)
    assert content(folder) == expected
    assert (not missing and not is_told) or NAME in caplog.text
    assert len(missing) <= 1 or "kept as _damaged-campaign.sqlite" in caplog.text


@pytest.mark.parametrize("bit", range(1, 8))
def test_a_file_that_damage_made_one_to_read_only_is_told_and_rebuilt(tmp_path, caplog, bit):
    filled(tmp_path)
    expected, file = content(tmp_path), tmp_path / NAME
    damaged = bytearray(file.read_bytes())
    damaged[18] ^= 1 << bit  # the version of the format for those who write
    file.write_bytes(damaged)
    assert computed_again(tmp_path) == [] and content(tmp_path) == expected
    assert "kept as _damaged-campaign.sqlite" in caplog.text


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.floats(0.0, 1.0, exclude_max=True), st.integers(0, 7))
def test_a_flipped_bit_in_the_log_of_a_killed_writer_costs_no_more_than_runs_that_are_told(
    tmp_path_factory, caplog, share, bit
):
    folder, killed = tmp_path_factory.mktemp("log"), tmp_path_factory.mktemp("killed")
    store = opened(folder)
    for run in RUNS_OF_FILLED:
        add(store, run)
    for name in (NAME, f"{NAME}-wal"):
        shutil.copyfile(folder / name, killed / name)
    expected, log = content(folder), killed / f"{NAME}-wal"
    damaged = bytearray(log.read_bytes())
    damaged[int(share * len(damaged))] ^= 1 << bit
    log.write_bytes(damaged)
    caplog.clear()
    with Store(killed / NAME, KEY) as again:
        there = again.runs().tolist()
    assert there == RUNS_OF_FILLED[: len(there)]  # what is behind the damage is lost, and nothing is wrong
    assert len(there) == len(RUNS_OF_FILLED) or "log of its last runs is damaged" in caplog.text
    computed_again(killed)
    assert content(killed) == expected


def test_table_whose_key_is_no_key_any_more_is_told_and_made_anew(tmp_path, caplog):
    filled(tmp_path)
    expected, file = content(tmp_path), tmp_path / NAME
    file.write_bytes(file.read_bytes().replace(b"runs (id INTEGER", b"runs (id INTEGEQ"))
    with pytest.raises(InputError, match="it is damaged"):
        read_campaign(tmp_path)
    assert computed_again(tmp_path) == [] and content(tmp_path) == expected and "It held 8 runs" in caplog.text


def test_the_same_damage_of_several_runs_is_seen(tmp_path, monkeypatch):
    side = 21  # of a square of runs
    monkeypatch.setattr(of, "GROUP", side**2)
    with Store(tmp_path / "x.sqlite", "a") as store:
        store.describe({})
        store.add({run: bytes([run % 256]) * 90 for run in range(of.GROUP + 5)})
        for runs in ([7], [7, 8], [7, 8 + side * 2], [9, 9 + side], [of.GROUP, of.GROUP + 1]):
            store.connection.execute("BEGIN")
            marks = ", ".join(map(str, map(store.place, runs)))
            changed = "CAST(substr(content, 1, 20) || x'ff00' || substr(content, 23) AS BLOB)"
            store.connection.execute(f"UPDATE runs SET content = {changed} WHERE id IN ({marks})")
            with pytest.raises(InputError, match=f"run.* {', '.join(map(str, runs))} .* damaged"):
                list(store.contents())
            store.connection.execute("ROLLBACK")
        assert sum(map(len, store.contents())) == of.GROUP + 5


def test_damage_of_many_pages_costs_what_lies_between_them(tmp_path, caplog):
    with Store(tmp_path / "x.sqlite", "a") as store:
        store.describe({})
        store.add({run: b"x" * 1000 for run in range(400)})
    damaged = bytearray((tmp_path / "x.sqlite").read_bytes())
    for page in (30, 33):
        damaged[page * of.PAGE : page * of.PAGE + 8] = bytes(8)
    (tmp_path / "x.sqlite").write_bytes(damaged)
    with Store(tmp_path / "x.sqlite", "a") as store:
        assert 370 < store.count() < 400 and store.about == {}
        assert store.runs()[[0, -1]].tolist() == [0, 399]
    assert "It held 3" in caplog.text and (tmp_path / "_damaged-x.sqlite").is_file()


def test_of_what_is_said_there_are_two_copies(tmp_path, caplog):
    filled(tmp_path)
    for _ in range(2):  # the second writer mends what the first one has left
        for name in ("about", "about_copy"):
            with closing(sqlite3.connect(tmp_path / NAME)) as connection:
                connection.execute(f"UPDATE {name} SET content = substr(content, 1, 20)")
                connection.commit()
            assert read_campaign(tmp_path).about["title"] == "t" and "the copy is used" in caplog.text
            opened(tmp_path).close()


def test_run_that_has_lost_its_signals_is_computed_again(tmp_path, caplog):
    filled(tmp_path)
    expected = content(tmp_path)
    with closing(sqlite3.connect(tmp_path / NAME)) as connection:
        connection.execute("DELETE FROM signals WHERE id & 0xFFFF = 7")
        connection.execute("DELETE FROM errors")
        connection.commit()
    assert computed_again(tmp_path) == [5, 7] and content(tmp_path) == expected
    assert f"{NAME}: runs 5, 7 are damaged, and computed again." in caplog.text


# the end of the writer, and of the disk


def test_full_disk_is_told_with_the_file_and_costs_nothing_that_was_added(tmp_path):
    store = opened(tmp_path)
    add(store, 1)
    (pages,) = store.connection.execute("PRAGMA page_count").fetchone()
    store.connection.execute(f"PRAGMA max_page_count = {pages}")
    with pytest.raises(OSError) as caught:
        store.add({run: bytes(5000) for run in range(2, 9)})
    assert (caught.value.errno, caught.value.filename) == (errno.ENOSPC, str(tmp_path / NAME))
    assert held(tmp_path) == [1]
    store.connection.execute("PRAGMA max_page_count = 100000")
    add(store, 2)
    assert held(tmp_path) == [1, 2]


def test_what_the_system_refuses_is_told_in_its_words(tmp_path):
    (tmp_path / "x.sqlite").mkdir()
    with pytest.raises(IsADirectoryError):
        Store(tmp_path / "x.sqlite", "a")


WRITER = """
import sys
sys.path.insert(0, HERE)
from test_store import add, opened
store = opened(Path(sys.argv[1]))
there = set(store.runs().tolist())
left = [k for k in range(100) if k not in there]
for _ in range(GROUPS):
    group = [left.pop(0) for _ in range(min(3, len(left)))]
    if group:
        add(store, *group)
        print(group[-1], flush=True)
sys.stdin.read()
"""
GROUPS = 8  # of one process, which waits then for its end: on no machine is it the first to be done


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGKILL")
def test_sigkill_at_random_moments_loses_nothing_that_was_told_and_repeats_nothing(tmp_path, start):
    chance, told, kills, runs = random.Random(1), -1, 0, []
    code = WRITER.replace("HERE", repr(str(Path(__file__).parent))).replace("GROUPS", str(GROUPS))
    while len(runs) < 100:  # the last one may be there and not be told: the next writer would have nothing to say
        process = start(code, tmp_path)
        for _ in range(chance.randint(1, GROUPS - 1)):
            told = told if told == 99 else int(process.stdout.readline())
        time.sleep(chance.uniform(0.0, 0.002))
        process.send_signal(signal.SIGKILL)
        told = max([told, *map(int, process.stdout.read().split())])
        kills += process.wait() == -signal.SIGKILL
        runs = held(tmp_path)
        assert runs == [*range(len(runs))] and len(runs) > told
    assert kills >= 100 / 3 / GROUPS and content(tmp_path)[1][99] == [99.0, 198.0]
    assert read_campaign(tmp_path).about == json.loads(json.dumps(ABOUT))


def test_writers_wait_for_one_another_and_leave_no_lock(tmp_path, start):
    code = """
import sys, time
from gapsense.many.store import alone
with alone(Path(sys.argv[1])):
    print("mine", flush=True)
    sys.stdin.readline()
"""
    first = start(code, tmp_path / "x.sqlite")
    assert first.stdout.readline() == "mine\n"
    second = start(code, tmp_path / "x.sqlite")
    assert "x.sqlite: another process is using it; waiting for its end." in second.stderr.readline()
    print(file=first.stdin, flush=True)
    assert second.stdout.readline() == "mine\n"
    print(file=second.stdin, flush=True)
    assert (first.wait(20), second.wait(20)) == (0, 0) and not list(tmp_path.iterdir())
