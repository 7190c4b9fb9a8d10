"""C headers of what the Python FMU and the native one share: the sentences, and the order of calls."""

from __future__ import annotations

from gapsense.fmi.life import ALLOWED, PHASES, phases_of
from gapsense.fmi.sentences import SENTENCES

ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n"}


def literal(text: str) -> str:
    """A string literal of C."""
    return '"' + "".join(ESCAPES.get(c) or (c if c.isascii() and c.isprintable() else _octal(c)) for c in text) + '"'


def _octal(letter: str) -> str:
    return "".join(f"\\{byte:03o}" for byte in letter.encode())


def sentences() -> str:
    """`sentences.h`: a format for each sentence, `SAY_JUMP` and so on."""
    lines = "".join(f"#define SAY_{key.upper()} {literal(text)}\n" for key, text in SENTENCES.items())
    return f"/* What a component says to its user. Generated from sentences.py. */\n{lines}"


def life() -> str:
    """`life.h`: the phases of an instance, and of each call those in which it is allowed."""
    calls = {call.removeprefix("fmi2").removesuffix("Real"): call for call in ALLOWED if _is_named(call)}
    rules = " \\\n".join(
        f"    RULE_OF({name}, {_bits(ALLOWED[call])}u, {literal(phases_of(call))})" for name, call in calls.items()
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


def _is_named(call: str) -> bool:
    """Of calls for variables, one stands for all kinds."""
    return not call.endswith(("Integer", "Boolean", "String"))


def _bits(phases: tuple[str, ...]) -> int:
    return sum(1 << PHASES.index(phase) for phase in phases)
