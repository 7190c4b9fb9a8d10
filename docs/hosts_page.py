"""The table of hosts: in which tools the components ran, as the tests found it, and what was not tried.

`pytest tests/conformance/test_hosts.py -m slow` tries the hosts that a machine has and keeps what comes out in
build/hosts; `python docs/hosts_page.py build/hosts docs` writes the page.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gapsense._os.files import write_atomically

PAGE = "hosts.md"
KINDS = {"python": "Python FMU", "native": "native FMU", "native3": "native FMU, FMI 3.0"}
NOT_TRIED = (
    ("Simulink, Dymola, OpenModelica, TwinCAT", "not available on the test machines: the native FMU is for them"),
    (
        "pathsim-fmi, but by hand",
        "FMI 3.0: 0.1.1 reads each output into one number; of 14 components 8 ran, all with `gapsense build --scalars`",
    ),
    ("fmusim of the Reference-FMUs, FMU Compliance Checker", "no sources at hand; earlier Python FMUs ran in both"),
    ("macOS", "no such machine: the native FMUs have binaries, but whether they load is not known"),
    ("Windows itself", "native FMUs by wine alone; Python FMUs have pythonfmu's own binary there"),
    ("processors other than x86_64 and aarch64", "no binaries; every native FMU has its sources"),
)
ABOUT = """# Hosts

In which hosts the components were run, made by `python docs/hosts_page.py`. Each of them ran on the inputs of its
`reference.csv`, in libcosim on its start values beside FMPy, and the host had to end with exit code 0. A difference
is the largest one of all outputs, relative to their nominal values. What every FMU must do in any host, wrong orders of
calls, damaged states, calls without sense, is in `tests/conformance/`; [what to take when](native.md).

"""


def page(results: Sequence[dict[str, Any]]) -> str:
    """The page in Markdown."""
    head = ("host", "version", "on", "kind", "components", "same bits", "largest difference")
    tried = markdown(head, [row(result) for result in results])
    missing = markdown(("not tried", "why"), NOT_TRIED)
    return f"{ABOUT}{tried}\n\n## Not tried\n\n{missing}\n"


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table."""
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows))


def row(result: dict[str, Any]) -> tuple[str, ...]:
    """Row of one host, for all components of one kind."""
    found: dict[str, float] = result["differences"]
    worst = max(found, key=lambda name: found[name])
    others = f"{found[worst]:.1g} ({worst})" if found[worst] else "none"
    same = str(sum(value == 0.0 for value in found.values()))
    kind = KINDS[result["kind"]]
    return result["host"], result["version"], result["platform"], kind, str(len(found)), same, others


def main(results: str, docs: str) -> None:
    """Write the page from the results that the tests have kept."""
    files = sorted(Path(results).glob("*.json"))
    found = [json.loads(path.read_text(encoding="utf-8")) for path in files]
    write_atomically(Path(docs) / PAGE, lambda file: print(page(found), end="", file=file))


if __name__ == "__main__":
    main(*sys.argv[1:3])
