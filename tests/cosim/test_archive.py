"""An FMU is an archive of a stranger: what could do harm, or cannot be true, is refused with a sentence."""

import re
import stat
import zipfile
import zlib
from xml.etree import ElementTree

import pytest

from gapsense.cosim import check
from gapsense.cosim.fmu import archive
from gapsense.cosim.fmu.archive import UnusableError
from gapsense.cosim.fmu.descriptions import describe

XML = "modelDescription.xml"
EXCHANGE = '<ModelExchange modelIdentifier="Gain"/>'
ENTITIES = '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><x>&b;</x>'
EXTERNAL = '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/hostname">]><x>&a;</x>'


@pytest.fixture
def altered(fmus, tmp_path, monkeypatch):
    """Writes the FMU Gain with one change: to its members, or to the text of its model description.

    What another test found in the same file is not remembered: some of them lower the limits.
    """
    monkeypatch.setenv("GAPSENSE_CACHE", str(tmp_path / "cache"))

    def altered(change=None, text=None, name="Gain"):
        with zipfile.ZipFile(fmus / f"{name}.fmu") as source:
            members = {info.filename: source.read(info) for info in source.infolist()}
        if text:
            before = members[XML].decode()
            members[XML] = text(before).encode()
            assert before != text(before)
        path = tmp_path / "Altered.fmu"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as target:
            if change:
                change(target, members)
            for member, content in members.items():
                target.writestr(member, content)
        return path

    return altered


def refused(path):
    with pytest.raises(UnusableError) as caught:
        describe(path)
    text = str(caught.value)
    assert text.endswith(".") and len(text) < 800 and "\n" not in text
    return text


def link(target, _):
    info = zipfile.ZipInfo("resources/link")
    info.external_attr = (stat.S_IFLNK | 0o777) << 16
    target.writestr(info, "/etc/passwd")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda z, _: z.writestr("../../outside.txt", "x"), "`../../outside.txt` would be unpacked outside its folder"),
        (lambda z, _: z.writestr("/outside.txt", "x"), "`/outside.txt` would be unpacked outside its folder"),
        (lambda z, _: z.writestr("resources/a\\..\\b", "x"), "a name with a backslash"),
        (lambda z, _: z.writestr("C:/b", "x"), "a colon"),
        (lambda z, _: z.writestr("a\tb", "x"), "a control character"),
        (lambda z, _: z.writestr("a" * 600, "x"), "a name of more than 500 characters"),
        (link, "`resources/link` is a link or a device"),
        (lambda z, _: z.writestr("a", "x", compress_type=zipfile.ZIP_LZMA), "is not packed by `deflate`"),
        (lambda z, m: z.writestr("resources", "x"), "`resources` is a file and a folder"),
        (lambda _, m: m.pop(XML), f"the archive has no {XML}"),
        (lambda _, m: m.pop("binaries/linux64/Gain.so"), "it has no library `binaries/linux64/Gain.so` for this"),
    ],
)
def test_member_that_could_do_harm_is_refused(altered, change, words):
    assert words in refused(altered(change))


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_member_that_is_there_twice_is_taken_if_both_are_the_same(altered):
    doubled = altered(lambda z, m: [z.writestr(name, m[name]) for name in (XML, "binaries/linux64/Gain.so")])
    assert describe(doubled).name == describe(altered()).name


@pytest.mark.parametrize("packing", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
@pytest.mark.parametrize("member", ["binaries/linux64/Gain.so", "resources/more.txt"])
def test_member_with_a_changed_byte_is_refused(altered, member, packing):
    def add(z, members):
        content = members.pop(member, b"some text that is read by nobody " * 9)
        z.writestr(member, content, compress_type=packing)

    path = altered(add)
    with zipfile.ZipFile(path) as whole:
        info = whole.getinfo(member)
    data = bytearray(path.read_bytes())
    data[info.header_offset + 30 + len(member) + info.compress_size // 2] ^= 1
    path.write_bytes(data)
    assert f"its member `{member}` is damaged" in refused(path)


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_member_that_is_there_twice_is_refused(altered):
    assert "`binaries/linux64/Gain.so` is there twice" in refused(
        altered(lambda z, m: z.writestr("binaries/linux64/Gain.so", "x"))
    )


def test_bombs_are_refused_before_anything_is_unpacked(altered, monkeypatch):
    def zeros(z, _):
        for k in range(3):
            z.writestr(f"resources/{k}", bytes(50_000_000))

    assert re.search(r"unpacks to 15\d MB, \d+ times its size; at most 100 times", refused(altered(zeros)))
    monkeypatch.setattr(archive, "LARGEST_CONTENT", 1000)
    assert "at most 0 GB are unpacked" in refused(altered())
    monkeypatch.setattr(archive, "MOST_MEMBERS", 3)
    assert "at most 3 are unpacked" in refused(altered())


def test_size_that_is_a_lie_does_not_unpack_more(altered):
    def lie(z, members):
        z.writestr("resources/zeros", bytes(10_000_000))
        z.getinfo("resources/zeros").file_size = 10

    path = altered(lie)
    with zipfile.ZipFile(path) as again, pytest.raises((zipfile.BadZipFile, zlib.error)):
        again.read("resources/zeros")


def test_encrypted_member_is_refused(altered):
    path = altered()
    data = bytearray(path.read_bytes())
    place = data.index(b"PK\x01\x02")
    data[place + 8] |= 1
    path.write_bytes(data)
    assert "is encrypted" in refused(path)


def test_damaged_archive_is_refused(altered):
    path = altered()
    path.write_bytes(path.read_bytes()[:-40])
    assert "not a readable FMU" in refused(path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (lambda _: ENTITIES, "declares a document type"),
        (lambda _: EXTERNAL, "declares a document type"),
        (
            lambda t: t.replace("<fmiModelDescription", "<!DOCTYPE a><fmiModelDescription", 1),
            "declares a document type",
        ),
        (lambda t: '<?xml version="1.0" encoding="utf-7"?>' + t, "is encoded as `utf-7`"),
        (lambda t: t[:-40], "is not XML"),
        (lambda _: "<x/>", "FMI without a version found"),
        (lambda t: t.replace('"2.0"', '"1.0"', 1), "FMI 1.0 found, FMI 2.0 or 3.0 co-simulation expected"),
        (lambda t: t.replace('modelIdentifier="Gain"', 'modelIdentifier="../Gain"'), "model identifier is `../Gain`"),
        (lambda t: t.replace('modelIdentifier="Gain"', 'modelIdentifier="Other"'), "no library `binaries/"),
        (lambda t: t.replace('name="u"', 'name="y"'), 'The variable name "y"'),
        (lambda t: t.replace('name="u" valueReference="1"', 'name="u" valueReference="0"'), "share the value"),
        (lambda t: t.replace('min="-1000"', 'min="a lot"'), "'a lot' is not a valid value"),
        (lambda t: t.replace('min="-1000"', 'min="NaN"'), "`min` of its variable `u` is not a number"),
        (lambda t: t.replace('valueReference="1"', 'valueReference="1e3"'), "is not a valid value"),
        (lambda t: t.replace('<Unknown index="3"', '<Unknown index="0"'), "refers to variable 0 in `Unknown`"),
        (lambda t: t.replace('<Unknown index="3"', '<Unknown index="99"'), "refers to variable 99"),
        (lambda t: t.replace('index="3"', 'index="3" dependencies="1 -1"'), "refers to variable -1"),
        (
            lambda t: re.sub("<CoSimulation[^>]*>", '<ModelExchange modelIdentifier="Gain"/>', t),
            "without co-simulation found",
        ),
    ],
)
def test_description_that_lies_is_refused(altered, text, words):
    assert words in refused(altered(text=text))


def test_description_of_many_megabytes_is_refused(altered, monkeypatch):
    monkeypatch.setattr(archive, "LARGEST_DESCRIPTION", 100)
    assert "its modelDescription.xml has more than" in refused(altered())


def test_description_cannot_flood_the_message(altered):
    def many(text):
        return text.replace("<Real", '<Real wrong="1"').replace("<Integer", '<Integer wrong="1"') + " "

    assert len(refused(altered(text=many))) < 800


@pytest.mark.parametrize("name", ["Gain.fmu", "parts/Gain.fmu"])
def test_nobody_is_told_to_build_a_foreign_fmu(altered, write, name):
    text = f'title = "x"\n[experiment]\nstop = 1.0\nbase_step = 0.1\n[components.a]\nfmu = "{name}"\n'
    path = write(text)
    assert "there is no FMU" in check(path)[0]
    (path.parent / name).parent.mkdir(exist_ok=True)
    (path.parent / name).write_text("no archive")
    assert "not a readable FMU" in check(path)[0]
    assert not any("gapsense build" in problem for problem in check(path))


def test_variability_that_an_exporter_leaves_out_is_no_mistake(altered):
    def without(text):
        root = ElementTree.fromstring(text)
        for variable in root.find("ModelVariables"):
            variable.attrib.pop("variability", None)
        return ElementTree.tostring(root, "unicode")

    assert describe(altered(text=without)).variables["mode"].type == "Integer"
    assert describe(altered(text=without, name="Source")).variables["inverted"].is_parameter
