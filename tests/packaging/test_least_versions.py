"""No version that pyproject.toml allows or constraints.txt pins has a known hole; what tests need is pinned."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import NamedTuple

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
# what users install; the others are of developers
OF_USERS = sorted(set(EXTRAS) - {"dev", "bench", "fuzz"})
# of every environment, which `pip freeze` leaves out
WITH_PIP = {"pip", "setuptools", "wheel"}


class Advisory(NamedTuple):
    """A hole, and which versions have it."""

    package: str
    affected: str
    id: str
    what: str
    source: str


ADVISORIES = [
    Advisory(**one)
    for one in tomllib.loads((Path(__file__).parent / "known_vulnerable.toml").read_text("utf-8"))[
        "advisories"
    ]
]


def pins() -> dict[str, Version]:
    """Package -> version of constraints.txt."""
    lines = (ROOT / "constraints.txt").read_text("utf-8").splitlines()
    words = [line.partition("==") for line in lines]
    return {canonicalize_name(name): Version(version) for name, _, version in words}


def declared(extras: Iterable[str]) -> list[Requirement]:
    """Of the core and of extras, with those that an extra names in the form canid[...]."""
    texts = [*PROJECT["dependencies"], *(text for extra in extras for text in EXTRAS[extra])]
    out = [Requirement(text) for text in texts]
    more = {extra for one in out if one.name == "canid" for extra in one.extras}
    own = [one for one in out if one.name != "canid"]
    return own + (declared(more) if more else [])


def least(specifier: SpecifierSet) -> Version | None:
    """The lowest version that is allowed; None: any."""
    bounds = [
        Version(one.version.removesuffix(".*"))
        for one in specifier
        if one.operator in (">=", "==", "~=", ">")
    ]
    return max(bounds, default=None)


def open_to(requirements: Iterable[Requirement], advisories: Iterable[Advisory]) -> list[str]:
    """Requirements whose lowest version has a hole."""
    by_name: dict[str, list[Advisory]] = {}
    for advisory in advisories:
        by_name.setdefault(advisory.package, []).append(advisory)
    out = []
    for one in requirements:
        low = least(one.specifier)
        out += [
            f"{one}: {advisory.id}, {advisory.affected}"
            for advisory in by_name.get(canonicalize_name(one.name), ())
            if low is None or low in SpecifierSet(advisory.affected, prereleases=True)
        ]
    return out


def closure(roots: Iterable[Requirement], pinned: Mapping[str, Version]) -> dict[str, str]:
    """Packages that requirements need here, each with one that needs it; not those of packages of another version."""
    out: dict[str, str] = {}
    seen: set[tuple[str, str]] = set()
    pending = [(one, "canid") for one in roots]
    while pending:
        one, of = pending.pop()
        if one.marker is not None and not one.marker.evaluate({"extra": ""}):
            continue
        name = canonicalize_name(one.name)
        out.setdefault(name, of)
        for extra in ("", *one.extras):
            if (name, extra) not in seen:
                seen.add((name, extra))
                pending += [(more, name) for more in _needed(name, extra, pinned)]
    return out


def _needed(name: str, extra: str, pinned: Mapping[str, Version]) -> Iterator[Requirement]:
    try:
        of = distribution(name)
    except PackageNotFoundError:
        return
    if Version(of.version) != pinned.get(name, Version(of.version)):
        return
    for text in of.requires or ():
        one = Requirement(text)
        if one.marker is None or one.marker.evaluate({"extra": extra}):
            one.marker = None
            yield one


def test_no_version_that_is_allowed_has_a_known_hole() -> None:
    """The least versions of the core and of every extra, by the list of advisories."""
    assert open_to(declared(EXTRAS), ADVISORIES) == []


def test_no_pin_has_a_known_hole() -> None:
    pinned = pins()
    assert [
        f"{one.package}=={pinned[one.package]}: {one.id}"
        for one in ADVISORIES
        if one.package in pinned and pinned[one.package] in SpecifierSet(one.affected, prereleases=True)
    ] == []


def test_what_a_users_package_requires_has_a_least_version_of_its_own() -> None:
    """A hole in what another package brings (h11, tornado) is closed by a bound here, since theirs allow it."""
    direct = {canonicalize_name(one.name) for one in declared(OF_USERS)}
    brought = closure(declared(OF_USERS), pins())
    assert sorted({one.package for one in ADVISORIES if one.package in brought} - direct) == []


def test_every_package_of_the_tests_is_pinned() -> None:
    """The closure of canid[dev], by the metadata of what is installed: what has no pin changes from one day to the next."""
    pinned = pins()
    assert {
        name: of
        for name, of in closure(declared(["dev"]), pinned).items()
        if name not in {*pinned, *WITH_PIP}
    } == {}


@pytest.mark.long("resolves versions")
def test_every_pin_can_be_installed_on_the_oldest_python() -> None:
    """By what the packages say of themselves: a pin that wants 3.11.5 ends `make` on Debian 12, which has 3.11.2."""
    pinned = pins()
    oldest = least(SpecifierSet(PROJECT["requires-python"]))
    assert oldest is not None
    wanted = {
        name: distribution(name).metadata.get("Requires-Python", "")
        for name in closure(declared(["dev"]), pinned)
        if name in pinned and Version(distribution(name).version) == pinned[name]
    }
    assert len(wanted) > 100
    assert {
        name: text for name, text in wanted.items() if not SpecifierSet(text).contains(f"{oldest}.0")
    } == {}


def test_every_bound_accepts_its_pin() -> None:
    pinned = pins()
    of_dev = {canonicalize_name(one.name): one for one in declared(["dev"])}
    assert [
        f"{one} and {name}=={pinned[name]}"
        for name, one in of_dev.items()
        if not one.specifier.contains(pinned[name], prereleases=True)
    ] == []


def test_the_list_is_well_formed() -> None:
    """Every entry is of one package that is required or pinned, of a range with an end, and has a source."""
    known = {*pins(), *(canonicalize_name(one.name) for one in declared(EXTRAS))}
    for one in ADVISORIES:
        assert one.package == canonicalize_name(one.package)
        assert one.package in known
        assert [each.operator for each in SpecifierSet(one.affected)] == ["<"]
        assert one.source.startswith("https://")
    assert len({(one.package, one.id) for one in ADVISORIES}) == len(ADVISORIES)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("x>=1.2", True),
        ("x", True),
        ("x>=1.3", False),
        ("x~=1.2.5", True),
        ("X[a]>=1.3,<2", False),
        ("y>=1", False),
    ],
)
def test_a_version_with_a_hole_is_found(text: str, found: bool) -> None:
    advisories = [Advisory("x", "<1.3", "CVE-1", "", "")]
    assert bool(open_to([Requirement(text)], advisories)) is found
