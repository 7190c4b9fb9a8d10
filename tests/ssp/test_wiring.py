"""Nested systems are followed back to their sources; what becomes of a value on the way is computed again by hand."""

from __future__ import annotations

from xml.etree.ElementTree import fromstring

import pytest
from hypothesis import given
from hypothesis import strategies as st
from packages import UNITS, bindings, component, connectors, linear, link, structure, system

from gapsense.ssp.bring import Wiring, plain_names
from gapsense.ssp.structure import read_element
from gapsense.ssp.units import read_units
from gapsense.ssp.words import tag

SI = {"V": (1.0, 0.0), "mV": (1e-3, 0.0), "odd": (2.0, 10.0), "": None}
HOPS = st.tuples(
    st.sampled_from([*SI]),
    st.floats(-5, 5).filter(lambda x: abs(x) > 0.1),
    st.floats(-5, 5),
    st.booleans(),
    st.booleans(),
)


def nested(hops) -> str:
    """A source, and a lag so many systems deep: each hop has a unit, a line, whether that is there, and suppression."""

    def inside(k: int) -> tuple[str, str]:
        unit, factor, offset, has_line, suppress = hops[k]
        line = linear(factor, offset) if has_line else ""
        more = 'suppressUnitConversion="true"' * suppress
        if k == len(hops) - 1:
            own = component("lag", "Lag", connectors(u=f"input {unit}".strip()))
            return own, link("{}", "lag.u", line, more)
        deeper, way = inside(k + 1)
        own = system("s", connectors(into=f"input {unit}".strip()), elements=deeper, links=way.replace(*TOP))
        return own, link("{}", "s.into", line, more)

    own, way = inside(0)
    source = component("source", "Source", connectors(y="output V"))
    return system("root", elements=source + own, links=way.replace('startConnector=""', "").replace(*FIRST))


TOP = ('startElement="{}" startConnector=""', 'startConnector="into"')
FIRST = ('startElement="{}"', 'startElement="source" startConnector="y"')


def by_hand(hops, value: float) -> float:
    """The value at the lag: the unit first, then the line, hop by hop."""
    current = "V"
    for unit, factor, offset, has_line, suppress in hops:
        if unit and current != unit and not suppress:
            (a, b), (c, d) = SI[current], SI[unit]
            value = ((a * value + b) - d) / c
        value = factor * value + offset if has_line else value
        current = unit or current
    return value


@given(st.lists(HOPS, min_size=1, max_size=5), st.floats(-100, 100))
def test_what_arrives_is_what_was_sent_hop_by_hop(hops, value):
    root = fromstring(structure(nested(hops)))
    problems: list[str] = []
    outer = read_element(root.find(tag("ssd:System")), (), problems)
    wiring = Wiring(outer, read_units(root, f"{tag('ssd:Units')}/{tag('ssc:Unit')}"), problems)
    path = ("s",) * (len(hops) - 1) + ("lag",)
    way = wiring.way((path, "u"), {}, ())
    assert problems == [] and way.source == (("source",), "y")
    assert way.line.of(value) == pytest.approx(by_hand(hops, value), rel=1e-9, abs=1e-6)


def test_connectors_in_a_ring_end():
    """Systems that hand a value to each other, and none has one."""
    one = system("a", connectors(i="input", o="output"), links=link(".i", ".o"))
    text = system("root", elements=one + one.replace('"a"', '"b"'), links=link("a.o", "b.i") + link("b.o", "a.i"))
    problems: list[str] = []
    wiring = Wiring(read_element(fromstring(structure(text)).find(tag("ssd:System")), (), problems), {}, problems)
    assert wiring.way((("a",), "i"), {}, ()) is None and problems == []


@given(st.lists(st.tuples(st.text(min_size=1, max_size=4), st.text(min_size=1, max_size=4)), unique=True, max_size=8))
def test_every_component_gets_a_name_of_its_own(paths):
    names = plain_names(paths)
    assert len(set(names.values())) == len(paths)
    assert all(name.isidentifier() and name.isascii() for name in names.values())


def test_helpers_make_what_the_schema_allows():
    from gapsense.ssp.package import violations

    text = structure(system("root", elements=component("a", "Lag", connectors(u="input V"), bindings())), units=UNITS)
    assert any("ParameterBindings" in text for text in violations(text.encode(), "ssd"))
    assert violations(text.replace("<ssd:ParameterBindings></ssd:ParameterBindings>", "").encode(), "ssd") == []
