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

from gapsense._os import native
from gapsense.kernels.lanes import Code, library, plan

SRC = Path(library.__file__).resolve().parents[2]
TRY = """
import sys
from traced import graph
from gapsense.kernels.lanes import Code, plan
code = Code(graph(lambda a, b, c: a * b + c))
made = plan(lambda given: code(given), given=3)
print(made.run(2, given=[[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]).tolist(), made.library is not None)
"""
FOUND = "[[8.0, 14.0]]"


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    """An empty cache that nothing of which is known."""
    monkeypatch.setenv(library.CACHE, str(tmp_path / "cache"))
    for function in (library.load_library, library.tuning_options, library.own_folder, library._warn):
        function.cache_clear()
        monkeypatch.setattr(library, function.__name__, function)
    yield tmp_path / "cache"
    library.load_library.cache_clear()


def text(number: float = 2.0) -> str:
    return library.source(Code(graph(lambda a, b, c: a * b + where_(number, c))))


def where_(number: float, c):
    return c if number == 2.0 else c * c


def child(**environment: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(SRC), str(Path(__file__).parents[1] / "kernels")])
    own = {**os.environ, "PYTHONPATH": path, **environment}
    return subprocess.run([sys.executable, "-c", TRY], env=own, capture_output=True, text=True, check=False)


def test_library_is_kept_and_found_again(fresh, compiler):
    first = library.build_library(text())
    made = first.stat().st_ino
    assert first.parent == fresh and [*fresh.iterdir()] == [first]
    assert library.build_library(text()) == first and first.stat().st_ino == made
    assert library.build_library(text(3.0)) != first


def test_other_options_and_compilers_have_libraries_of_their_own(fresh, compiler, monkeypatch):
    first = library.build_library(text())
    monkeypatch.setattr(library, "FLAGS", (*library.FLAGS, "-DOTHER"))
    library.tuning_options.cache_clear()
    assert library.build_library(text()) != first


def test_many_processes_compile_at_once(tmp_path, compiler):
    environment = {library.CACHE: str(tmp_path / "cache")}
    path = os.pathsep.join([str(SRC), str(Path(__file__).parents[1] / "kernels")])
    own = {**os.environ, "PYTHONPATH": path, **environment}
    running = [subprocess.Popen([sys.executable, "-c", TRY], env=own, stdout=subprocess.PIPE) for _ in range(3)]
    assert {process.communicate()[0].decode().strip() for process in running} == {f"{FOUND} True"}
    assert len([*(tmp_path / "cache").iterdir()]) == 2  # the function, and what calls it


@pytest.mark.parametrize("named", ["no-such-compiler", "false"])
def test_without_a_compiler_python_computes_and_says_so_once(named, tmp_path):
    done = child(CC=named, **{library.CACHE: str(tmp_path)})
    assert done.returncode == 0 and done.stdout.split(" [")[0].strip() == f"{FOUND} False", done.stderr
    assert done.stderr.count("Python computes instead") == 1
    assert not [*tmp_path.iterdir()]


def test_ziglang_compiles_where_there_is_no_other(monkeypatch):
    monkeypatch.setenv("CC", "")
    monkeypatch.setenv("PATH", "")
    for offered, found in (("0.17.1", ("zig", "cc")), (None, None)):
        monkeypatch.setattr(native, "zig_version", lambda offered=offered: offered)
        monkeypatch.setattr(native, "zig_compiler", lambda: ("zig", "cc"))
        assert native.own_compiler() == found


@pytest.mark.slow
def test_the_compiler_of_ziglang_computes_where_there_is_no_other(tmp_path):
    """Python did, on most machines with Windows: 170 s in place of 11 to identify the sample record."""
    if not native.zig_version():
        pytest.skip("no ziglang")
    done = child(CC="", PATH="", **{library.CACHE: str(tmp_path)})
    assert done.stdout.strip() == f"{FOUND} True", done.stderr


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path, compiler):
    (tmp_path / "file").write_text("no folder")
    done = child(**{library.CACHE: str(tmp_path / "file" / "cache"), "TMPDIR": str(tmp_path)})
    assert done.stdout.strip() == f"{FOUND} True", done.stderr


def test_a_library_that_does_not_load_is_told(fresh, compiler, monkeypatch):
    monkeypatch.setattr(library, "SHARED", ("-c",))  # an object file, which is no library
    with pytest.warns(UserWarning, match="Python computes instead"):
        assert library.load_library(text()) is None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert library.load_library(text()) is None


def test_plans_and_kernels_share_what_is_compiled(fresh, compiler):
    one, two, three = (Code(graph(f)) for f in (lambda a, b, c: a + b, lambda a, b, c: a * c, lambda a, b, c: b - c))
    for codes in ((one, two), (two, three), (three,)):
        made = plan(lambda given, codes=codes: [x for code in codes for x in code(given)], given=3)
        assert made.library and made.run(2, given=[[1.0], [2.0], [4.0]]).shape == (len(codes), 2)
    assert len([*fresh.iterdir()]) == 4  # three functions, and what calls them


def cut(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:4096])


def flipped(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)


def emptied(file: Path) -> None:
    file.write_bytes(b"")


def made_folder(file: Path) -> None:
    file.unlink()
    file.mkdir()
    (file / "inside").touch()


def made_link(file: Path) -> None:
    other = file.with_name("elsewhere")
    file.rename(other)
    file.symlink_to(other)


def made_pipe(file: Path) -> None:
    file.unlink()
    os.mkfifo(file)


def given_away(file: Path) -> None:
    os.chown(file, 12345, -1)


def opened(file: Path) -> None:
    file.chmod(0o722)


@pytest.mark.parametrize(
    "harm", [cut, flipped, emptied, made_folder, made_link, made_pipe, opened, given_away], ids=lambda f: f.__name__
)
def test_what_is_not_as_it_was_compiled_is_compiled_anew(harm, fresh, compiler):
    needs_root(harm is given_away)
    file = library.build_library(text())
    content = file.read_bytes()
    harm(file)
    for is_harmed in (True, False):
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            library._warn.cache_clear()
            assert library.build_library(text()) == file
        assert ["compiled again" in str(w.message) for w in told] == [True] * (
            is_harmed and harm in (opened, given_away)
        )
        assert file.lstat().st_mode & 0o170777 == 0o100700 and file.lstat().st_uid == os.geteuid()
        assert file.read_bytes() == content


def test_a_process_that_finds_harmed_libraries_computes_with_new_ones(tmp_path, compiler):
    cache = {library.CACHE: str(tmp_path / "cache")}
    assert child(**cache).stdout.strip() == f"{FOUND} True"
    contents = {file: file.read_bytes() for file in (tmp_path / "cache").iterdir()}
    assert len(contents) == 2  # the function, and what calls it
    for file in contents:
        cut(file)
    done = child(**cache)
    assert done.stdout.strip() == f"{FOUND} True", done.stderr
    assert {file: file.read_bytes() for file in contents} == contents


def needs_root(is_needed: bool) -> None:
    if os.name != "posix" or (is_needed and os.geteuid() != 0):
        pytest.skip("only root can give a file away")


def test_a_library_under_the_name_of_another_is_not_loaded(fresh, compiler):
    first, other = library.build_library(text()), library.build_library(text(3.0))
    good = first.read_bytes()
    first.write_bytes(other.read_bytes())
    assert library.build_library(text()) == first and first.read_bytes() == good
    forged = other.with_name(first.name[: -len(library.ENDING) - 32] + other.name[-len(library.ENDING) - 32 :])
    other.rename(forged)
    first.unlink()
    assert library.build_library(text()) == first


def test_cache_is_for_its_owner_alone(fresh, compiler):
    fresh.mkdir(mode=0o755)
    assert library.build_library(text()).parent == fresh
    assert fresh.stat().st_mode & 0o777 == 0o700


def test_folder_with_files_of_others_keeps_its_mode(fresh, compiler):
    fresh.mkdir(mode=0o755)
    (fresh / "thesis.txt").touch()
    assert library.build_library(text()).parent == fresh
    assert fresh.stat().st_mode & 0o777 == 0o755


def of_another_user(folder: Path) -> None:
    folder.mkdir(mode=0o700)
    os.chown(folder, 12345, -1)


def writable_by_a_group(folder: Path) -> None:
    folder.mkdir()
    folder.chmod(0o770)


def writable_by_all(folder: Path) -> None:
    folder.mkdir()
    folder.chmod(0o777)


def in_a_writable_folder(folder: Path) -> None:
    folder.mkdir()
    folder.parent.chmod(0o777)


def link_to_another_user(folder: Path) -> None:
    of_another_user(folder.with_name("theirs"))
    folder.symlink_to(folder.with_name("theirs"))


def link_of_another_user(folder: Path) -> None:
    folder.with_name("own").mkdir(mode=0o700)
    folder.symlink_to(folder.with_name("own"))
    os.chown(folder, 12345, -1, follow_symlinks=False)


REFUSED = {
    of_another_user: "belongs to another user",
    writable_by_a_group: "can be written by other users",
    writable_by_all: "can be written by other users",
    in_a_writable_folder: "which everybody can write",
    link_to_another_user: "belongs to another user",
    link_of_another_user: "belongs to another user",
}


@pytest.mark.parametrize("harm", REFUSED, ids=lambda f: f.__name__)
def test_folder_in_which_others_can_write_is_not_used(harm, fresh, compiler, monkeypatch):
    needs_root("another" in harm.__name__)
    folder = fresh.with_name("there") / "cache"
    monkeypatch.setenv(library.CACHE, str(folder))
    monkeypatch.setattr(library, "own_folder", lambda: fresh.with_name("own folder"))
    library.own_folder().mkdir()
    folder.parent.mkdir()
    harm(folder)
    with pytest.warns(UserWarning, match="Nothing is kept there") as told:
        assert library.load_library(text()) and library.load_library(text(3.0))
    assert len(told) == 1 and REFUSED[harm] in str(told[0].message)
    assert not [*folder.iterdir()] and len([*library.own_folder().iterdir()]) == 2


def test_link_to_a_folder_of_ones_own_is_followed(fresh, compiler):
    own = fresh.with_name("own")
    own.mkdir(mode=0o700)
    fresh.symlink_to(own)
    assert library.build_library(text()).resolve().parent == own


def test_what_was_not_used_for_long_is_removed(fresh, compiler):
    first, left, foreign = (
        library.build_library(text()),
        fresh / f"{library.PREFIX}killed",
        fresh / "file of somebody else",
    )
    left.mkdir()
    foreign.touch()
    for path in (first, left, foreign):
        os.utime(path, (1.0, 1.0))
    library.build_library(text(3.0))
    assert not first.exists() and not left.exists() and foreign.exists()
    used = library.build_library(text(3.0))
    os.utime(used, (1.0, 1.0))
    library.build_library(text(3.0))
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
