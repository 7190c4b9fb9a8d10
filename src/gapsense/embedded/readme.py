"""The README beside exported components: what is there, how it is built and called, what to mind."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from gapsense.embedded.design import Design
from gapsense.embedded.example import sample_time
from gapsense.embedded.members import members
from gapsense.version import __version__

TEXT = """# Components for microcontrollers

Exported by Gapsense {version}. C99 (and C++), in `{real}`, with the C library's mathematics and nothing else: no
allocation, no global variable that changes, any number of instances.

{table}

RAM is that of constants, state, inputs and outputs on a 32-bit processor; stack comes to it.

## Try

On a computer:

    gcc -std=c99 -O2 -ffp-contract=off {first}.c {first}_main.c -lm -o {first} && ./{first}

On a Cortex-M4F under QEMU, with the linker script and the start-up code in `cortex_m/` (for a Cortex-M3:
`-mcpu=cortex-m3 -mthumb`, machine `mps2-an385`; for a board: the memory in `link.ld`):

    arm-none-eabi-gcc -std=c99 -Os -ffp-contract=off -fno-math-errno -mcpu=cortex-m4 -mthumb -mfloat-abi=hard \\
        -mfpu=fpv4-sp-d16 -nostartfiles --specs=rdimon.specs -T cortex_m/link.ld \\
        cortex_m/start.c {first}.c {first}_main.c -lm -o {first}.elf
    qemu-system-arm -M mps2-an386 -nographic -semihosting -kernel {first}.elf

## Use

{use}

`-ffp-contract=off` gives the same bits everywhere; without it a compiler may join products and sums.
`-fno-math-errno` lets it use the square root of the processor. Nothing is checked while it runs: keep parameters and
inputs in the ranges that the header says.{survives}
"""


def readme(designs: Sequence[Design]) -> str:
    """Its text."""
    rows = ["| component | what it is | call its step | RAM, bytes |", "| --- | --- | --- | --- |"]
    rows += [f"| `{d.name}` | {d.component.description} | {_when(d)} | {memory(d):,} |" for d in designs]
    first = designs[0]
    return TEXT.format(
        version=__version__,
        real=first.real,
        table="\n".join(rows),
        first=first.name,
        use="\n".join(_use(first)),
        survives=_survivors(designs),
    )


def memory(design: Design) -> int:
    """Bytes of the records that a component keeps, where whole numbers and pointers have four."""
    kept = [member for name, record in members(design).items() if name != "par" for member in record]
    return sum(max(1, member.size) * (8 if member.type == "double" else 4) for member in kept)


def _when(design: Design) -> str:
    period = sample_time(design)
    return f"every {1e6 * period:g} us (`sample_time`)" if period else "with any `dt`"


def _use(design: Design) -> Iterator[str]:
    found, name = members(design), design.name
    kept = " and ".join(f"`{name}_{record}`" for record in ("constants", "state") if record in found)
    yield f"Include `{name}.h`, which has every name with its unit and range.{f' You keep {kept}.' * bool(kept)}\n"
    if "par" in found:
        yield f"- `{name}_defaults()` gives the parameters; change what you like."
        yield f"- `{name}_prepare` computes from them what a step needs: once, and again after each change."
    yield f"- `{name}_initial` takes the first sample{' and starts the state' * ('state' in found)}."
    yield f"- `{name}_step` does one step with every further sample."


def _survivors(designs: Sequence[Design]) -> str:
    names = [f"`{design.name}`" for design in designs if design.component.survives]
    return f"\nLost readings, not a number, are borne by {', '.join(names)}." if names else ""
