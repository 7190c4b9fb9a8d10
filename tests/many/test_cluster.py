"""A campaign on a real cluster of separate processes, of which some are killed, gives the table of one process."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from studies_of_ramps import NOISE, STUDY, rows

from gapsense import campaign, read_campaign
from gapsense.problems import InputError
from gapsense.version import __version__

pytest.importorskip("distributed")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform == "win32", reason="sends SIGKILL")]
LONG = NOISE.replace("stop = 10.0", "stop = 100.0")
MANY = STUDY.replace("seeds = 2", "seeds = 20") + '[trajectories]\nsignals = ["noise.y"]\ndecimation = 100\n'
QUIET = {"stdin": None, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}


class Cluster(NamedTuple):
    address: str
    scheduler: subprocess.Popen
    add: Callable[..., subprocess.Popen]


@pytest.fixture
def cluster(start, tmp_path, monkeypatch):
    """Starter of a scheduler with so many workers."""
    monkeypatch.setenv("DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT", "10s")

    def make(count: int, protocol: str = "tcp", **options: object) -> Cluster:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        address = f"{protocol}://127.0.0.1:{port}"
        (tmp_path / "there").mkdir(exist_ok=True)
        where = {**QUIET, "cwd": tmp_path / "there"}
        scheduler = start(
            "distributed.cli.dask_scheduler", "--protocol", protocol, "--host", "127.0.0.1", "--port", port,
            "--no-dashboard", **where,
        )  # fmt: skip

        def add(*arguments: str, **more: object) -> subprocess.Popen:
            words = [address, "--no-dashboard", *(arguments or ("--nthreads", "1", "--no-nanny"))]
            return start("distributed.cli.dask_worker", *words, **{**where, **options, **more})

        await_port(port)
        made = Cluster(address, scheduler, add)
        workers[:] = [add() for _ in range(count)]
        return made

    workers: list[subprocess.Popen] = []
    make.workers = workers
    return make


def await_port(port: int) -> None:
    """Wait until a process listens: on a busy machine a scheduler takes a while to load."""
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        with socket.socket() as caller:
            if caller.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)


def at(done_at: int, action: Callable[[], object]) -> Callable[[int, int], None]:
    """Progress that does something once when so many runs are done."""
    left = [action]

    def progress(done: int, total: int) -> None:
        if done >= done_at and left:
            left.pop()()

    return progress


@pytest.mark.parametrize("victim", [None, "worker"])
def test_cluster_gives_the_table_of_one_process_also_if_a_worker_is_killed(write, fmus, cluster, tmp_path, victim):
    study, alone = write(MANY, LONG), tmp_path / "alone"
    expected = campaign(study, 1, alone, fmus)
    made = cluster(2)
    killed = at(20, cluster.workers[0].kill if victim else lambda: None)
    result = campaign(study, None, tmp_path / "cluster", fmus, made.address, progress=killed)
    assert (result.computed, result.failed) == (120, 0)
    assert (cluster.workers[0].poll() is not None) is (victim is not None)
    assert rows(result) == rows(expected)
    for run in (0, 57, 119):
        kept, other = result.trajectory(run), expected.trajectory(run)
        assert {name: kept[name].tolist() for name in kept} == {name: other[name].tolist() for name in other}


def test_worker_with_a_nanny_and_threads_and_one_that_comes_late(write, fmus, cluster, tmp_path):
    study = write(MANY, LONG)
    made = cluster(0)
    made.add("--nthreads", "2", "--nworkers", "1")
    late = at(10, made.add)
    result = campaign(study, None, tmp_path / "cluster", fmus, made.address, progress=late)
    assert rows(result) == rows(campaign(study, 2, tmp_path / "alone", fmus))


def test_killed_scheduler_ends_the_campaign_and_another_one_goes_on(write, fmus, cluster, tmp_path):
    study, out = write(MANY, LONG), tmp_path / "out"
    made = cluster(2)
    with pytest.raises(RuntimeError, match=r"scheduler has gone\. Finished runs are kept"):
        campaign(study, None, out, fmus, made.address, progress=at(20, made.scheduler.kill))
    there = read_campaign(out).rows
    assert 20 <= there < 120
    result = campaign(study, None, out, fmus, cluster(2).address)
    assert (result.rows, result.computed) == (120, 120 - there)
    assert rows(result) == rows(campaign(study, 2, tmp_path / "alone", fmus))


CLIENT = """
import sys
from gapsense import campaign, read_campaign
told = lambda done, total: print(done, flush=True)
campaign(sys.argv[1], None, sys.argv[2], fmus, sys.argv[3], progress=told)
"""


def test_killed_client_goes_on_from_another_process_and_place(write, fmus, start, cluster, tmp_path):
    study, out, made = write(MANY, LONG), tmp_path / "out", cluster(2)
    process, told = start(CLIENT, study, out, made.address), 0
    while told < 30:
        told = int(process.stdout.readline())
    process.send_signal(signal.SIGKILL)
    told = max([told, *map(int, process.stdout.read().split())])
    there = read_campaign(out).rows
    assert told <= there < 120
    result = campaign(study, 2, out, fmus)  # here, not there
    assert result.computed == 120 - there
    assert rows(result) == rows(campaign(study, None, tmp_path / "other", fmus, made.address))


FAULTY = (
    LONG
    + '[components.coil]\nfmu = "Faulty"\nset = { fault = "FAULT", at = 5.0, only = 2 }\n[inputs]\n"coil.u" = 0.0\n'
)


@pytest.mark.parametrize("fault", ["nan", "kill", "hang"])
def test_run_that_ends_its_process_is_a_row_and_ends_no_worker(write, fmus, cluster, tmp_path, fault):
    text = FAULTY.replace("FAULT", fault).replace("noise = 10", "noise = 10\ncoil = 0")
    study, made = write(STUDY, text.replace("stop = 100.0", "stop = 100.0\nstep_limit = 1.0")), cluster(1)
    result = campaign(study, None, tmp_path / "out", fmus, made.address)
    assert [index for index, _ in result.errors(9)] == [2]
    assert rows(result) == rows(campaign(study, 1, tmp_path / "alone", fmus))
    assert cluster.workers[0].poll() is None


def test_files_and_fmus_come_to_workers_that_see_none_of_the_clients_folders(
    write, fmus, cluster, tmp_path, monkeypatch
):
    scenario = NOISE + '[sweep]\n"source.table.file" = ["a.toml", "b.toml"]\n'
    study = write('title = "Files"\nscenario = "demo"\n', scenario)
    for name in ("a", "b"):
        (tmp_path / "demo" / f"{name}.toml").write_text(name)
    mine, made = tmp_path / "fmus", cluster(1)
    mine.mkdir()
    for file in fmus.glob("*.fmu"):
        (mine / file.name).write_bytes(file.read_bytes())
    opened = []

    def watch(done: int, total: int) -> None:
        """Files below the client's folder that processes of the worker have open or map."""
        for own in Path("/proc").glob("[0-9]*/maps"):
            try:
                opened.extend(line for line in own.read_text().splitlines() if str(mine) in line)
            except OSError:
                continue

    monkeypatch.chdir(tmp_path)  # where the names that are given here say something, and there nothing
    result = campaign(study.name, None, "out", mine.name, made.address, progress=watch)
    assert result.failed == 0 and result.rows == 2 and not opened


def test_cluster_is_left_as_it_was(write, fmus, cluster, tmp_path):
    from distributed import Client

    made, places = cluster(1), Path(f"/proc/{cluster.workers[0].pid}/task")
    campaign(write(), None, tmp_path / "out", fmus, made.address)
    with Client(made.address, set_as_default=False) as client:
        assert client.run(lambda dask_worker: [name for name in dask_worker.plugins if "gapsense" in name]) == {
            address: [] for address in client.nthreads()
        }
    end = time.monotonic() + 10.0
    while descendants(places) and time.monotonic() < end:
        time.sleep(0.1)
    assert not descendants(places)


def descendants(tasks: Path) -> list[str]:
    return [pid for task in tasks.iterdir() for pid in (task / "children").read_text().split()]


def test_cluster_that_cannot_do_it_is_refused_with_what_to_do(write, fmus, cluster, tmp_path, monkeypatch):
    monkeypatch.setattr("gapsense.many.cluster.PATIENCE", 3.0)
    with pytest.raises(InputError, match=r"no answer from a Dask scheduler at `tcp://127.0.0.1:9`"):
        campaign(write(), None, tmp_path / "out", fmus, "tcp://127.0.0.1:9")
    for address in ("here", "", "tcp://", "tcp://here", "tls:nope", "mail://here:8786", "tcp://here:port"):
        with pytest.raises(
            InputError, match=rf"`{address}` is not an address of a Dask scheduler \(.*Give one such as"
        ):
            campaign(write(), None, tmp_path / "out", fmus, address)
    with pytest.raises(InputError, match=r"has no workers. Start some: `dask worker tcp://"):
        campaign(write(), None, tmp_path / "out", fmus, cluster(0).address)


TLS = "DASK_DISTRIBUTED__COMM__TLS__"


@pytest.fixture
def certificate(tmp_path):
    """Settings of Dask for encryption, with a certificate that signs itself."""
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    made = ("openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost")
    subprocess.run([*made, "-keyout", key, "-out", certificate], check=True, capture_output=True)
    roles = {f"{TLS}{role}__{what}": file for role in ("SCHEDULER", "WORKER", "CLIENT")
             for what, file in (("CERT", certificate), ("KEY", key))}  # fmt: skip
    return {name: str(file) for name, file in {f"{TLS}CA_FILE": certificate, **roles}.items()}


@pytest.fixture
def encrypted(monkeypatch):
    """Gives this process settings of Dask, which it reads when it starts."""
    import dask

    def give(settings: dict[str, str]) -> None:
        for name, value in settings.items():
            monkeypatch.setenv(name, value)
        dask.config.refresh()

    yield give
    monkeypatch.undo()
    dask.config.refresh()


def test_encrypted_cluster_by_the_settings_of_dask(write, fmus, cluster, certificate, encrypted, tmp_path):
    encrypted(certificate)
    study, made = write(), cluster(1, "tls")
    result = campaign(study, None, tmp_path / "out", fmus, made.address)
    assert made.address.startswith("tls://") and (result.rows, result.failed) == (12, 0)
    assert rows(result) == rows(campaign(study, 1, tmp_path / "alone", fmus))


@pytest.mark.parametrize("wrong", ["none", "no client", "no file", "no certificate", "open"])
def test_settings_for_encryption_that_do_not_do_are_told(write, fmus, certificate, encrypted, tmp_path, wrong):
    (tmp_path / "text.pem").write_text("no certificate")
    changes = {
        "none": (dict.fromkeys(certificate, ""), "needs settings for TLS, which are missing"),
        "no client": ({f"{TLS}CLIENT__CERT": ""}, "needs settings for TLS, which are missing"),
        "no file": ({f"{TLS}CLIENT__CERT": "/nope"}, r"the settings for TLS cannot be used \(.*No such file"),
        "no certificate": ({f"{TLS}CA_FILE": str(tmp_path / "text.pem")}, "the settings for TLS cannot be used"),
        "open": ({"DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION": "true"}, "is not encrypted, but Dask's"),
    }
    settings, why = changes[wrong]
    encrypted({**certificate, **settings})
    address = "127.0.0.1:9" if wrong == "open" else "tls://127.0.0.1:9"
    with pytest.raises(InputError, match=why) as caught:
        campaign(write(), None, tmp_path / "out", fmus, address)
    assert len(caught.value.problems) == 1


def test_worker_with_another_gapsense_is_refused(write, fmus, cluster, tmp_path):
    other = tmp_path / "elsewhere" / "gapsense"
    other.mkdir(parents=True)
    (other / "__init__.py").write_text('raise ImportError("no such package here")\n')
    hidden = {**os.environ, "PYTHONPATH": str(other.parent)}
    with pytest.raises(
        InputError, match=r"tcp://.*: Gapsense is not installed there \(no such package here\). Install"
    ):
        campaign(write(), None, tmp_path / "out", fmus, cluster(1, env=hidden).address)
    import shutil

    import gapsense

    shutil.rmtree(other)
    shutil.copytree(Path(gapsense.__file__).parent, other, ignore=shutil.ignore_patterns("__pycache__"))
    (other / "units.py").write_text((other / "units.py").read_text() + "\n")
    with pytest.raises(InputError, match="its sources of Gapsense or its version of numpy differ from those here"):
        campaign(write(), None, tmp_path / "out", fmus, cluster(1, env=hidden).address)
    (other / "version.py").write_text((other / "version.py").read_text().replace(__version__, "0.0.9"))
    with pytest.raises(InputError, match=re.escape(f"it has Gapsense 0.0.9, {__version__} is expected. Install that")):
        campaign(write(), None, tmp_path / "out", fmus, cluster(1, env=hidden).address)
