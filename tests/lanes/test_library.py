"""The compiled library: kept, made anew when it must be, and not needed by anybody."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import warnings
from pathlib import Path

import pytest
from traced import graph

from gapsense.lanes import Code, library, plan

SRC = Path(library.__file__).resolve().parents[2]
TRY = """
import sys
from traced import graph
from gapsense.lanes import Code, plan
code = Code(graph(lambda a, b, c: a * b + c))
made = plan(lambda given: code(given), given=3)
print(made.run(2, given=[[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]).tolist(), made.library is not None)
"""
FOUND = "[[8.0, 14.0]]"


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    """An empty cache that nothing of which is known."""
    monkeypatch.setenv(library.CACHE, str(tmp_path / "cache"))
    for function in (library.loaded, library.tuned, library.own_folder, library._tell):
        function.cache_clear()
        monkeypatch.setattr(library, function.__name__, function)
    yield tmp_path / "cache"
    library.loaded.cache_clear()


def text(number: float = 2.0) -> str:
    return library.source([Code(graph(lambda a, b, c: a * b + where_(number, c)))])


def where_(number: float, c):
    return c if number == 2.0 else c * c


def child(**environment: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(SRC), str(Path(__file__).parents[1] / "kernels")])
    own = {**os.environ, "PYTHONPATH": path, **environment}
    return subprocess.run([sys.executable, "-c", TRY], env=own, capture_output=True, text=True, check=False)


def test_library_is_kept_and_found_again(fresh, compiler):
    first = library.built(text())
    made = first.stat().st_ino
    assert first.parent == fresh and [*fresh.iterdir()] == [first]
    assert library.built(text()) == first and first.stat().st_ino == made
    assert library.built(text(3.0)) != first


def test_other_options_and_compilers_have_libraries_of_their_own(fresh, compiler, monkeypatch):
    first = library.built(text())
    monkeypatch.setattr(library, "FLAGS", (*library.FLAGS, "-DOTHER"))
    library.tuned.cache_clear()
    assert library.built(text()) != first


def test_many_processes_compile_at_once(tmp_path, compiler):
    environment = {library.CACHE: str(tmp_path / "cache")}
    path = os.pathsep.join([str(SRC), str(Path(__file__).parents[1] / "kernels")])
    own = {**os.environ, "PYTHONPATH": path, **environment}
    running = [subprocess.Popen([sys.executable, "-c", TRY], env=own, stdout=subprocess.PIPE) for _ in range(3)]
    assert {process.communicate()[0].decode().strip() for process in running} == {f"{FOUND} True"}
    assert len([*(tmp_path / "cache").iterdir()]) == 1


@pytest.mark.parametrize("named", ["no-such-compiler", "false"])
def test_without_a_compiler_numpy_computes_and_says_so_once(named, tmp_path):
    done = child(CC=named, **{library.CACHE: str(tmp_path)})
    assert done.returncode == 0 and done.stdout.split(" [")[0].strip() == f"{FOUND} False", done.stderr
    assert done.stderr.count("Python computes instead") == 1
    assert not [*tmp_path.iterdir()]


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path, compiler):
    (tmp_path / "file").write_text("no folder")
    done = child(**{library.CACHE: str(tmp_path / "file" / "cache"), "TMPDIR": str(tmp_path)})
    assert done.stdout.strip() == f"{FOUND} True", done.stderr


def test_a_library_that_does_not_load_is_told(fresh, compiler):
    file = library.built(text())
    file.write_bytes(b"torn")
    with pytest.warns(UserWarning, match="Python computes instead"):
        assert library.loaded(text()) is None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert library.loaded(text()) is None


def test_what_was_not_used_for_long_is_removed(fresh, compiler):
    first, left, foreign = library.built(text()), fresh / f"{library.PREFIX}killed", fresh / "file of somebody else"
    left.mkdir()
    foreign.touch()
    for path in (first, left, foreign):
        os.utime(path, (1.0, 1.0))
    library.built(text(3.0))
    assert not first.exists() and not left.exists() and foreign.exists()
    used = library.built(text(3.0))
    os.utime(used, (1.0, 1.0))
    library.built(text(3.0))
    assert used.stat().st_mtime > time.time() - 60.0


def test_cache_is_where_caches_are(monkeypatch, tmp_path):
    monkeypatch.delenv(library.CACHE, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert library.cache_folder() == tmp_path / "gapsense"
    monkeypatch.setenv(library.CACHE, str(tmp_path / "own"))
    assert library.cache_folder() == tmp_path / "own"


def test_plan_without_library_is_the_same(monkeypatch):
    made = plan(lambda given: Code(graph(lambda a, b, c: a * b + c))(given), given=3)
    made.__dict__["library"] = None
    assert made.run(1, given=[2.0, 3.0, 4.0]).tolist() == [[10.0]]
