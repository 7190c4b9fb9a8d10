"""A result is whole at whatever moment its writer is killed: nothing is lost, nothing is there twice."""

from __future__ import annotations

import json
import random
import signal
import sys
import time
from base64 import b64encode
from contextlib import suppress

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gapsense.campaign import store as of
from gapsense.many.columns import Columns
from gapsense.many.result import read
from gapsense.many.store import Manifest, Store, read_manifest
from gapsense.problems import InputError

COLUMNS = Columns({"a.x": ("double", "V"), "a.name": ("string", "")}, {"m": "A"}, {"a.y": "V"})
BARE = Columns({}, {"m": "A"})


def new(columns=COLUMNS, runs=100):
    return Manifest({"title": "t", "runs": runs, "scenario": "s", "labels": {}}, columns)


def line(run, error=None):
    samples = np.array([[0.0, 0.1], [run, 2.0 * run]]).astype("<f8")
    signals = {"trajectory": b64encode(samples.tobytes()).decode()}
    own = {"error": error} if error else {"metrics": {"m": run / 7}, "wall": 0.1, **signals}
    return {"run": run, "seed": run, "values": {"a.x": 0.5 * run, "a.name": f"n{run}"}, **own}


def held(folder):
    """Runs that are there, each as often as it is."""
    return sorted(read(folder).column("run").tolist())


def test_what_is_appended_is_read_at_once_and_after_each_step(tmp_path):
    store = Store(tmp_path, new())
    store.append([line(4), line(2, "broken")])
    for step in (lambda: None, store.fold, store.compact, lambda: Store(tmp_path, read_manifest(tmp_path))):
        step()
        campaign = read(tmp_path)
        table = campaign.table().to_pydict()
        assert (table["run"], table["a.x"], table["a.name"]) == ([2, 4], [1.0, 2.0], ["n2", "n4"])
        assert (table["m"], table["error"]) == ([None, 4 / 7], ["broken", None])
        assert (campaign.rows, campaign.failed, campaign.errors(5)) == (2, 1, [(2, "broken")])
        assert campaign.trajectory(4)["a.y"].tolist() == [4.0, 8.0]
        with pytest.raises(InputError, match="no signals of run 2"):
            campaign.trajectory(2)
    assert campaign.units == {"a.x": "V", "a.name": "", "m": "A", "wall": "s"}


@settings(max_examples=25)
@given(st.integers(0, 400))
def test_torn_line_is_no_run_and_those_before_it_are(tmp_path_factory, kept):
    folder = tmp_path_factory.mktemp("torn")
    Store(folder, new(BARE)).append([line(k) for k in range(3)])
    journal = next(folder.glob("journal-*"))
    content = journal.read_bytes()
    journal.write_bytes(content[: min(kept, len(content))])
    ends = [k for k in range(len(content)) if content[k : k + 1] == b"\n"]
    whole = sum(kept >= end for end in ends)  # the end of a line is no part of what it says
    assert held(folder) == [*range(whole)]
    again = Store(folder, read_manifest(folder))
    assert again.known(5).tolist() == [k < whole for k in range(5)]
    again.append([line(k) for k in range(whole, 5)])
    assert held(folder) == [*range(5)]


class Killed(BaseException):
    pass


@pytest.mark.parametrize("calls", range(12))
@pytest.mark.parametrize("step", ["fold", "compact", "forget_failed"])
def test_end_at_any_write_or_removal_loses_and_repeats_nothing(tmp_path, monkeypatch, step, calls):
    monkeypatch.setattr(of, "FILE_RUNS", 6)
    store = Store(tmp_path, new())
    for group in ([9, 1, 5], [7, 3], [2, 8, 0, 11]):
        store.append([line(k, "broken" if k == 5 else None) for k in group])
        if step != "fold":
            store.fold()
    left = [calls]

    def counting(function):
        def counted(*arguments, **options):
            left[0] -= 1
            if left[0] < 0:
                raise Killed
            return function(*arguments, **options)

        return counted

    with monkeypatch.context() as patch:
        for owner, name in ((of, "write_atomically"), (of.Path, "unlink"), (of, "write_manifest")):
            patch.setattr(owner, name, counting(getattr(owner, name)))
        with suppress(Killed):
            getattr(store, step)()
    everything = [0, 1, 2, 3, 5, 7, 8, 9, 11]
    forgotten = [k for k in everything if k != 5]
    assert held(tmp_path) in ([everything, forgotten] if step == "forget_failed" else [everything])
    again = Store(tmp_path, read_manifest(tmp_path))
    assert held(tmp_path) in ([everything, forgotten] if step == "forget_failed" else [everything])
    again.compact()
    assert read(tmp_path).column("run").tolist() == held(tmp_path)
    counted = {f"runs/{file.name}" for file in (tmp_path / "runs").iterdir()}
    assert counted == {part.file for part in again.manifest.parts}
    assert read(tmp_path).trajectory(9)["a.y"].tolist() == [9.0, 18.0]


def test_journal_is_folded_when_it_is_long(tmp_path, monkeypatch):
    monkeypatch.setattr(of, "FOLD_RUNS", 10)
    store = Store(tmp_path, new())
    for k in range(25):
        store.append([line(k)])
    assert [part.rows for part in store.manifest.parts] == [10, 10]
    assert len(next(tmp_path.glob("journal-*")).read_text().splitlines()) == 5
    monkeypatch.setattr(of, "FOLD_BYTES", 300)
    store.append([line(25)])
    assert [part.rows for part in store.manifest.parts] == [10, 10, 6]
    assert held(tmp_path) == [*range(26)]


def test_compact_result_is_in_order_in_few_files(tmp_path, monkeypatch):
    monkeypatch.setattr(of, "FILE_RUNS", 40)
    store, runs = Store(tmp_path, new(BARE)), [*range(100)]
    random.Random(3).shuffle(runs)
    for k in range(0, 100, 9):
        store.append([line(run) for run in runs[k : k + 9]])
        store.fold()
    store.compact()
    tables = [pq.read_table(tmp_path / part.file)["run"].to_pylist() for part in store.manifest.parts]
    assert tables == [[*range(40)], [*range(40, 80)], [*range(80, 100)]]
    before = store.manifest
    store.compact()
    assert store.manifest == before  # what is in order is left as it is


@pytest.mark.parametrize(
    "content", ["{", "[]", '{"format": "gapsense campaign 0"}', '{"format": "gapsense campaign 1"}']
)
def test_what_is_no_campaign_is_refused(tmp_path, content):
    (tmp_path / "campaign.json").write_text(content)
    with pytest.raises(InputError, match="no campaign of this version"):
        read(tmp_path)
    with pytest.raises(InputError, match="The folder of a campaign's result is expected"):
        read(tmp_path / "none")


# damage


def filled(folder):
    """Two files of runs and of signals, and a journal."""
    store = Store(folder, new())
    for group in ([9, 1, 5], [7, 3], [2, 8, 0]):
        store.append([line(k, "broken" if k == 5 else None) for k in group])
        if 2 not in group:
            store.fold()
    return store


RUNS_OF_FILLED = [0, 1, 2, 3, 5, 7, 8, 9]


def content(folder):
    """All that a result tells."""
    campaign = read(folder)
    good = [run for run in campaign.column("run").tolist() if run != 5]
    return campaign.table().to_pydict(), {run: campaign.trajectory(run)["a.y"].tolist() for run in good}


def computed_again(folder):
    """What a writer does: it computes what is not there."""
    again = Store(folder, read_manifest(folder))
    missing = [run for run in RUNS_OF_FILLED if not again.known(10)[run]]
    again.append([line(run, "broken" if run == 5 else None) for run in missing])
    again.fold()
    again.compact()
    return missing


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_flipped_bit_is_told_or_changes_nothing(tmp_path_factory, caplog, data):
    folder = tmp_path_factory.mktemp("flipped")
    filled(folder)
    expected = content(folder)
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    assert len(files) == 7
    file = data.draw(st.sampled_from(files))
    damaged = bytearray(file.read_bytes())
    place = data.draw(st.integers(0, len(damaged) - 1))
    damaged[place] ^= 1 << data.draw(st.integers(0, 7))
    file.write_bytes(damaged)
    caplog.clear()
    is_torn = file.name.startswith("journal") and place == len(damaged) - 1  # as if it were being written
    try:
        found = content(folder)
        assert is_torn or found == expected
        is_told = file.name in caplog.text  # damage of the manifest costs nothing but a word
    except InputError as error:
        assert (file.name in str(error) and "damaged" in str(error)) or "checksum" in str(error)
        is_told = True
    caplog.clear()
    missing = computed_again(folder)
    assert content(folder) == expected
    assert len(missing) <= 3 and (
        is_torn or file.name.startswith("campaign") or not missing or file.name in caplog.text
    )
    assert is_told or is_torn or file.name == of.COPY


def test_a_file_that_is_gone_is_computed_again(tmp_path, caplog):
    store = filled(tmp_path)
    expected = content(tmp_path)
    for part in (store.manifest.parts[0], store.manifest.trajectories[1]):
        (tmp_path / part.file).unlink()
    with pytest.raises(InputError, match=r"it is damaged or gone\. Run the campaign again"):
        read(tmp_path).table()
    assert computed_again(tmp_path) == [1, 3, 5, 7, 9]
    assert "It held runs 1 to 9; they are computed again." in caplog.text
    assert content(tmp_path) == expected


def test_a_damaged_file_is_put_aside(tmp_path):
    part = filled(tmp_path).manifest.parts[0]
    (tmp_path / part.file).write_bytes(b"nothing")
    computed_again(tmp_path)
    assert next(tmp_path.glob("runs/_damaged-*")).read_bytes() == b"nothing"
    assert pq.read_table(tmp_path / "runs").num_rows == len(RUNS_OF_FILLED)  # readers pass over it


def test_of_two_damaged_manifests_neither_is_believed(tmp_path):
    filled(tmp_path)
    for name in (of.MANIFEST, of.COPY):
        text = (tmp_path / name).read_text()
        (tmp_path / name).write_text(text.replace('"runs": 100', '"runs": 101'))
    with pytest.raises(InputError, match=r"it is damaged\. Choose another folder"):
        read(tmp_path)


def test_a_run_counts_once_and_only_if_it_is_asked_for(tmp_path):
    store = Store(tmp_path, new(runs=4))
    store.append([line(1), line(3), line(1, "again"), line(4), line(-1), {**line(2), "run": "2"}])
    assert held(tmp_path) == [1, 3] and read(tmp_path).failed == 0
    store.fold()
    assert held(tmp_path) == [1, 3] and read(tmp_path).failed == 0


def test_unknown_column_is_told(tmp_path):
    Store(tmp_path, new()).append([line(1)])
    with pytest.raises(InputError, match=r"no column `wal`\. Did you mean `wall`"):
        read(tmp_path).column("wal")


WRITER = """
import sys
from gapsense.campaign import store as of
from test_store import COLUMNS, line, new
of.FOLD_RUNS = 7
of.FILE_RUNS = 20
folder = Path(sys.argv[1])
store = of.Store(folder, of.read_manifest(folder) or new(runs=10_000))
left = [int(k) for k in (~store.known(10_000)).nonzero()[0]]
while left:
    group = [left.pop(0) for _ in range(min(3, len(left)))]
    store.append([line(k) for k in group])
    print(group[-1], flush=True)
    if group[-1] % 50 < 3:
        store.fold()
        store.compact()
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGKILL")
def test_sigkill_at_random_moments_loses_nothing_that_was_told_and_repeats_nothing(tmp_path, start):
    folder, chance = tmp_path / "result", random.Random(1)
    told = -1
    for _ in range(12):
        process = start(f"import sys\nsys.path.insert(0, {str(of.Path(__file__).parent)!r})\n{WRITER}", folder)
        process.stdout.readline()
        time.sleep(chance.uniform(0.0, 0.25))
        process.send_signal(signal.SIGKILL)
        told = max([told, *map(int, process.stdout.read().split())])
        runs = held(folder)
        assert runs == [*range(len(runs))] and len(runs) > told
    assert told > 100
    assert json.loads((folder / "campaign.json").read_text())["number"] > 10
