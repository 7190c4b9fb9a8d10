"""Tables of the user: CSV files from anywhere, their problems, and what goes on with them in saved states."""

from __future__ import annotations

from pathlib import Path

import pytest
from stimuli import rows
from subjects import ERROR, OK, Instance, Subject, refused

from gapsense.fmi.ports import Component, Port
from gapsense.fmi.sentences import say
from gapsense.fmi.tables import heads
from gapsense.fmi.values import ValuesError, fields

CONTENTS: dict[str, str] = {
    "empty": "",
    "without rows": "{head}\n",
    "few rows": "{head}\n{0}\n",
    "another column": "time,other\n0,1\n1,2\n",
    "column twice": "{head},{head}\n{0},{0}\n{1},{1}\n{2},{2}\n{3},{3}\n",
    "falling": "{head}\n{0}\n{2}\n{1}\n{3}\n",
    "not finite": "{head}\n{0}\n{1}\n{nan}\n{3}\n",
    "text": "{head}\n{0}\n{1}\n{text}\n{3}\n",
    "cell missing": "{head}\n{0}\n{1}\n2\n{3}\n",
    "other unit": "{milli}\n{0}\n{1}\n{2}\n{3}\n",
    "not closed": '{head}\n{0}\n"{1}\n',
    "other digits": "{head}\n{0}\n{1}\n{digits}\n{3}\n",
    "zero byte": "{head}\n{0}\n{1}\n{2}\n{3}\n\0",
    "latin": "{head}\n{0}\n{1}\n\udce9\n",
}
ORDERS: dict[str, str] = {
    "plain": "{head}\n{0}\n{1}\n{2}\n{3}\n{4}\n",
    "spreadsheet": "\ufeff{head}\r\n{0}\r\n\r\n{1}\r\n{2}\r\n{3}\r\n{4}\r\n",
    "spaces": "{head}\n{0}\n\x1c{1}\u00a0\n\u3000{2}\n{3}\n{4}\n",
    "quoted": '{quoted}\n{0}\n{1}\n"3.0",{rest}\n{3}\n{4}',
}


def tables(component: Component) -> list[Port]:
    """Parameters that name a file."""
    return [port for port in component.ports if port.columns]


def written(folder: Path, name: str, port: Port, content: str) -> str:
    """A file for a table; all its columns rise, those of a grid in blocks."""
    names = heads(port.columns)
    lines = {str(k): ",".join(str(k * (j + 1.5)) for j in range(len(names))) for k in range(5)}
    if is_grid := any(column.startswith("axis:") for column in port.columns):
        lines = {k: "\n".join(f"{k}e-3,{j},{j * (1 + j)}" for j in range(3)) for k in lines}
    odd = {word: ",".join(["2", *[word] * (len(names) - 1)]) for word in ("nan", "text", "\u0665")}
    odd["digits"] = odd.pop("\u0665")
    head, milli = ",".join(names), ",".join(f"{n.partition(' [')[0]} [milli]" for n in names)
    quoted, rest = ",".join(f'"{n}"' for n in names), ",".join(str(2 * (j + 1.5)) for j in range(1, len(names)))
    rest = lines["2"] if is_grid else rest
    for key, text in {**lines, **odd, "head": head, "milli": milli, "quoted": quoted, "rest": rest}.items():
        content = content.replace(f"{{{key}}}", text)
    if is_grid:
        content = content.replace('"3.0",', "")
    path = folder / f"{name} für 100 %s.csv"
    path.write_bytes(content.encode("utf-8", "surrogateescape"))
    return str(path)


def start(one: Instance, port: Port, file: str) -> None:
    """Bring the instance to the end of initialization, with a table in use."""
    one.all(("Reset",))
    laws = [p for p in one.subject.component.ports if "table" in p.choices]
    assert [one.set(law, "table").status for law in laws] == [OK] * len(laws)
    assert one.set(port, file).status == OK
    one.bring("initializing")


def test_files_of_the_user_are_read(subject: Subject, one: Instance, tmp_path: Path) -> None:
    for port in tables(subject.component):
        outputs = []
        for name, content in ORDERS.items():
            start(one, port, written(tmp_path, name, port, content))
            one.all(("ExitInitializationMode",))
            outputs.append(one.run(rows(subject.component, 20)))
        upper = Path(written(tmp_path, "upper", port, ORDERS["plain"])).rename(tmp_path / "UPPER.CSV")
        start(one, port, str(upper))
        one.all(("ExitInitializationMode",))
        outputs.append(one.run(rows(subject.component, 20)))
        assert outputs[1:] == outputs[:-1]


def test_problems_of_files_are_told_in_one_wording(subject: Subject, one: Instance, tmp_path: Path) -> None:
    for port in tables(subject.component):
        files = {name: written(tmp_path, name, port, content) for name, content in CONTENTS.items()}
        files |= {"missing": str(tmp_path / "für/100 %s %n.csv"), "folder": str(tmp_path), "no csv": "/etc/passwd"}
        files |= {
            "empty name": "",
            "long name": "x" * 300 + ".csv",
            "dots": "./none.csv",
            "ours": "../modelDescription.xml",
        }
        for name, file in files.items():
            start(one, port, file)
            with pytest.raises(ValuesError) as caught:
                fields(subject.component, {port.name: file}, subject.folder / "resources")
            answer = one.do("ExitInitializationMode")
            if name in ("latin", "not closed"):  # the reason is that of the reader
                assert answer.status == ERROR and len(answer.log) == 1, (name, answer)
            else:
                text = say("correct_parameters", " ".join(caught.value.problems))
                refused(answer, subject.said(text))


def test_other_files_are_not_told(subject: Subject, one: Instance, tmp_path: Path) -> None:
    """Their headers and cells are nobody's business, and logs are read by many."""
    path = tmp_path / "private.key"
    path.write_text("hidden,word\nhidden,word\n")
    for port in tables(subject.component):
        for file in (path, tmp_path / "private.csv" / ".." / "private.key", Path("/etc/passwd")):
            start(one, port, str(file))
            answer = one.do("ExitInitializationMode")
            assert answer.status == ERROR and "hidden" not in answer.log[0][3] and "root:" not in answer.log[0][3]
            assert "does not end in .csv" in answer.log[0][3]


def test_state_has_the_table_in_it(subject: Subject, one: Instance, tmp_path: Path) -> None:
    """Going on from bytes needs no file any more."""
    for port in tables(subject.component):
        file = written(tmp_path, "plain", port, ORDERS["plain"])
        start(one, port, file)
        one.all(("ExitInitializationMode",), ("GetFMUstate", 0))
        data = one.do("SerializeFMUstate", 0).value
        one.all(("FreeFMUstate", 0))
        straight = one.run(rows(subject.component, 20))
        Path(file).unlink()
        other = subject.new("other")
        other.all(("DeSerializeFMUstate", data, 1), ("SetFMUstate", 1), ("FreeFMUstate", 1))
        assert other.run(rows(subject.component, 20)) == straight
        other.do("free")
