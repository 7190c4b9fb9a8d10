"""C headers of what the Python FMU and the native one share: the sentences, and the order of calls."""

from __future__ import annotations

from collections.abc import Iterable

from gapsense.fmi.life import ALLOWED, KINDS, PHASES, phases_of
from gapsense.fmi.sentences import SENTENCES

ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n"}


def literal(text: str) -> str:
    """A string literal of C."""
    return '"' + "".join(ESCAPES.get(c) or (c if c.isascii() and c.isprintable() else _octal(c)) for c in text) + '"'


def _octal(letter: str) -> str:
    return "".join(f"\\{byte:03o}" for byte in letter.encode())


def array(kind: str, name: str, items: Iterable[str]) -> str:
    """A constant array; nothing for an empty one, which C does not have."""
    lines = "".join(f"    {item},\n" for item in items)
    return lines and f"static const {kind} {name}[] = {{\n{lines}}};\n"


def sentences() -> str:
    """`sentences.h`: a format for each sentence, `SAY_JUMP` and so on."""
    lines = "".join(f"#define SAY_{key.upper()} {literal(text)}\n" for key, text in SENTENCES.items())
    return f"/* What a component says to its user. Generated from sentences.py. */\n{lines}"


def life() -> str:
    """`life.h`: the phases of an instance, and of each call those in which it is allowed."""
    # of calls for variables, one stands for all kinds
    calls = {call.removeprefix("fmi2").removesuffix("Real"): call for call in ALLOWED if not call.endswith(KINDS[1:])}
    rules = " \\\n".join(
        f"    RULE_OF({name}, {sum(1 << PHASES.index(phase) for phase in ALLOWED[call])}u, {literal(phases_of(call))})"
        for name, call in calls.items()
    )
    return f"""/* Phases of an instance, and which calls are allowed in them. Generated from life.py. */
#ifndef GAPSENSE_LIFE_H
#define GAPSENSE_LIFE_H

typedef enum {{ {", ".join(PHASES).upper()} }} Phase;
#define PHASES {{{", ".join(map(literal, PHASES))}}}

typedef struct {{
    unsigned phases; /* a bit for each */
    const char *text;
}} Rule;

typedef enum {{ {", ".join(f"CALL_{name}" for name in calls)} }} Call;
#define CALLS(RULE_OF) \\
{rules}
#define RULE(name, phases, text) {{phases, text}},

#endif
"""
