"""The plan holds each log once, with its driver and car, whatever its path, and reads none of them."""

from __future__ import annotations

import os
import subprocess
import sys
from fnmatch import fnmatchcase
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canid.analysis.fleet.job import Failure
from canid.analysis.fleet.planning import globs, listing
from canid.analysis.fleet.planning.folders import pattern, whose
from canid.analysis.fleet.planning.plan import planned
from canid.analysis.tables import kinds
from canid.values.errors import ConfigError

NAMES = st.text(alphabet="ab.é", min_size=1, max_size=4).filter(lambda name: name.strip("."))
PATHS = st.lists(NAMES, min_size=1, max_size=4)
PATTERNS = st.lists(
    st.one_of(st.just("**"), st.text(alphabet="ab*?.é[]!-", min_size=1, max_size=6)), min_size=1, max_size=4
)


def textbook(names: list[str], path: list[str]) -> bool:
    """A pattern of names against a path, by trying every number of folders that ** may stand for."""
    if not names:
        return not path
    if names[0] == "**":
        if len(names) == 1:
            return bool(path)
        return any(textbook(names[1:], path[k:]) for k in range(len(path)))
    return bool(path) and fnmatchcase(path[0], names[0]) and textbook(names[1:], path[1:])


@pytest.mark.slow("runs of a fleet in processes of their own")
@settings(max_examples=500, deadline=None)
@given(PATTERNS, PATHS)
def test_patterns_match_what_a_textbook_matcher_does(names: list[str], path: list[str]) -> None:
    """One regular expression of a whole pattern agrees with recursion over names by the standard library's fnmatch."""
    assert bool(globs.of_names(names).fullmatch("/".join(path))) == textbook(names, path)


@settings(max_examples=30, deadline=None)
@given(st.lists(PATHS, min_size=1, max_size=6), PATTERNS)
def test_a_pattern_lists_the_files_that_it_matches(
    tmp_path_factory: pytest.TempPathFactory, paths: list[list[str]], names: list[str]
) -> None:
    """Folders that are not entered hold nothing that matches: the listing equals a filter of all files."""
    root = tmp_path_factory.mktemp("globs")
    made = set()
    for path in paths:
        file = root.joinpath(*path[:-1], path[-1] + ".log")
        if any(parent.is_file() for parent in file.parents) or file.is_dir():
            continue
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(b"x")
        made.add(tuple(file.relative_to(root).parts))
    found = {tuple(one.relative.split("/")) for one in listing.matched(f"{root}/{'/'.join(names)}")}
    hidden = {path for path in made if any(name.startswith(".") for name in path)}
    if not any(map(globs.is_pattern, names)):
        return
    # what precedes the first wildcard is the root
    fixed = next(i for i, name in enumerate(names) if globs.is_pattern(name))
    expected = {
        path[fixed:]
        for path in made - hidden
        if list(path[:fixed]) == names[:fixed] and textbook(names[fixed:], list(path[fixed:]))
    }
    if not any(name.startswith(".") for name in names[:fixed]):
        assert found == expected


def touch(path: Path, content: bytes = b"x") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return path


def test_drivers_and_cars_come_from_folder_names(tmp_path: Path) -> None:
    """One folder is the driver, two are car and driver, none: the log's name; a pattern says otherwise."""
    for name in ("a.log", "anna/b.log", "tesla/ben/c.log", "tesla/ben/2019/d.log"):
        touch(tmp_path / name)
    plan = planned([str(tmp_path)], vehicle="generic")
    generic = "Generic car-following vehicle"
    assert [(Path(one.log).name, one.driver, one.car) for one in plan.logs] == [
        ("a.log", "a", generic),
        ("b.log", "anna", generic),
        ("c.log", "ben", "tesla"),
        ("d.log", "ben", "tesla"),
    ]
    assert len(plan.notes) == 1
    by = planned([str(tmp_path)], vehicle="generic", folders="{group}/{driver}").logs
    assert [(one.driver, one.group_name, one.failure) for one in by] == [
        ("", "", Failure.UNMAPPED),
        ("", "", Failure.UNMAPPED),
        ("ben", "tesla", Failure.NONE),
        ("ben", "tesla", Failure.NONE),
    ]
    assert "{group}/{driver}" in by[0].reason


@pytest.mark.parametrize(
    ("text", "says"),
    [("{car}", "{driver} is missing"), ("{drvier}", 'did you mean "driver"'), ("{driver}/{driver}", "twice")],
)
def test_a_wrong_pattern_of_folders_is_one_line(text: str, says: str) -> None:
    """What is wrong with --folders is said, with the name that was meant."""
    with pytest.raises(ConfigError, match=says):
        pattern(text)


def test_parts_of_names_and_skipped_folders() -> None:
    """A folder's name may hold more than the driver's."""
    assert whose("fleet7/x/drv_anna/a.log", pattern("fleet{car}/*/drv_{driver}")) == ("anna", "7", "")
    assert whose("fleet7/anna/a.log", pattern("fleet{car}/*/{driver}")) is None


def test_a_log_that_several_words_name_is_planned_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder, a file in it, a pattern, a list and other spellings of the same path give one log."""
    log = touch(tmp_path / "data/anna/a b.log")
    (tmp_path / "list.txt").write_text("# logs\ndata/anna/a b.log\n\ndata/**/*.log\r\ndata\n")
    monkeypatch.chdir(tmp_path)
    words = ["data", "data/anna/a b.log", "data/../data/**/*.log", "@list.txt", f"file://{tmp_path}/data"]
    for order in (words, words[::-1]):
        found = listing.listed(order)
        assert [one.log for one in found] == [str(log)]
    assert planned(["@list.txt"], vehicle="generic").logs[0].driver == "anna"


def test_files_of_a_shell_pattern_have_the_root_that_they_share(tmp_path: Path) -> None:
    """logs/*/*.log gives the same drivers whether the shell or canid expands it."""
    files = [touch(tmp_path / f"logs/{driver}/{k}.log") for driver in ("anna", "ben") for k in range(2)]
    expanded = planned([*map(str, files)], vehicle="generic").logs
    quoted = planned([f"{tmp_path}/logs/*/*.log"], vehicle="generic").logs
    assert [(one.log, one.driver) for one in expanded] == [(one.log, one.driver) for one in quoted]
    assert {one.driver for one in quoted} == {"anna", "ben"}


def test_hidden_files_other_files_and_folders_of_results_are_no_logs(tmp_path: Path) -> None:
    """Hidden names, files of other kinds, pipes, and what canid fleet itself wrote, are left out."""
    touch(tmp_path / "a.log")
    for name in (".b.log", ".git/c.log", "d.txt", "e.events.jsonl", "f.toml", "earlier/parts/g.parquet"):
        touch(tmp_path / name)
    touch(tmp_path / "earlier" / listing.MARK, b"{}")
    touch(tmp_path / "out/h.parquet")
    os.mkfifo(tmp_path / "pipe.log")
    found = listing.listed([str(tmp_path)], skip=[str(tmp_path / "out")])
    assert [one.relative for one in found] == ["a.log"]


def test_every_suffix_of_a_table_but_txt_is_a_log_of_a_folder(tmp_path: Path) -> None:
    for suffix in kinds.SUFFIXES:
        touch(tmp_path / f"a{suffix}")
    found = {one.relative for one in listing.listed([str(tmp_path)])}
    assert found == {f"a{suffix}" for suffix in kinds.SUFFIXES if ".txt" not in suffix}


def test_loops_of_links_end_and_nothing_is_listed_twice(tmp_path: Path) -> None:
    """Links to the folder itself, to its parent and between folders: each log once, by its own path."""
    touch(tmp_path / "x/b/a.log")
    for link, target in (
        ("x/loop", "."),
        ("x/b/up", "../.."),
        ("again", "x"),
        ("0", "x/b"),
        ("no.log", "nowhere"),
    ):
        (tmp_path / link).symlink_to(target)
    found = listing.listed([str(tmp_path)])
    assert [one.relative for one in found] == ["no.log", "x/b/a.log"]
    assert planned([str(tmp_path)], vehicle="generic").logs[0].failure is Failure.MISSING


@pytest.mark.parametrize(
    "name",
    [
        b"blank at the end .log",
        "Zoë/\N{SNOWMAN}\u2028line.log".encode(),
        b"\xff\xfe no text/\xe9.log",
        b"new\nline.log",
        b"/".join([b"x" * 100] * 3) + b".log",
        b"[a]*?.log",
    ],
    ids=lambda name: repr(name)[:20],
)
def test_any_path_is_planned_and_has_its_size(tmp_path: Path, name: bytes) -> None:
    """Blanks, Unicode, bytes that are no text, 300 characters, and names that look like patterns."""
    path = touch(Path(os.fsdecode(os.path.join(os.fsencode(tmp_path), name))), b"12345")
    for words in ([str(tmp_path)], [str(path)]):
        assert [(one.log, one.size) for one in planned(words, vehicle="generic").logs] == [(str(path), 5)]


def test_what_names_nothing_is_refused_and_a_line_of_a_list_is_a_failed_log(tmp_path: Path) -> None:
    """A slip in a word stops the command; one line of a list of thousands does not."""
    for word in ("nothing.blf", f"{tmp_path}/*.blf", str(tmp_path), "@none.txt", "nowhere://x/a.blf"):
        with pytest.raises(ConfigError) as refused:
            planned([word], vehicle="generic")
        assert len(refused.value.mistakes) == 1
    log = touch(tmp_path / "a.log")
    (tmp_path / "list.txt").write_text("a.log\ngone.log\n")
    good, gone = planned([f"@{tmp_path}/list.txt"], vehicle="generic").logs
    assert (good.log, good.failure, gone.failure) == (str(log), Failure.NONE, Failure.MISSING)


def test_logs_of_frames_need_a_vehicle_and_tables_do_not(tmp_path: Path) -> None:
    """Tables of named columns are planned without a vehicle file; one log of frames among them is named."""
    touch(tmp_path / "a.parquet")
    touch(tmp_path / "b.csv")
    assert [one.failure for one in planned([str(tmp_path)]).logs] == [Failure.NONE] * 2
    touch(tmp_path / "c.blf")
    with pytest.raises(ConfigError, match=r"c\.blf is a log of CAN frames.*--vehicle"):
        planned([str(tmp_path)])


def test_logs_in_storage_have_the_drivers_of_their_folders() -> None:
    """A folder, a pattern and a file in fsspec's storage in memory; a second listing is the same."""
    import fsspec

    storage = fsspec.filesystem("memory")
    for name, content in (
        ("anna/a.blf", b"12"),
        ("ben/x y.log", b"123"),
        ("ben/notes.txt", b"1"),
        ("c.csv", b""),
    ):
        storage.pipe(f"/canid fleet/{name}", content)
    try:
        whole = planned(["memory://canid fleet"], vehicle="generic").logs
        assert [(one.log, one.driver, one.size) for one in whole] == [
            ("memory:///canid fleet/anna/a.blf", "anna", 2),
            ("memory:///canid fleet/ben/x y.log", "ben", 3),
            ("memory:///canid fleet/c.csv", "c", 0),
        ]
        assert all(one.modified_ns > 1.6e18 for one in whole)
        pattern_of_logs = ["memory://canid fleet/*/*.log", "memory://canid fleet/anna/a.blf"]
        some = planned(pattern_of_logs, vehicle="generic").logs
        assert [(one.log, one.driver) for one in some] == [(whole[1].log, "ben"), (whole[0].log, "anna")]
        with pytest.raises(ConfigError, match="holds no log"):
            planned(["memory://canid fleet/*.trc"], vehicle="generic")
    finally:
        storage.rm("/canid fleet", recursive=True)


@pytest.mark.parametrize(
    ("url", "says"),
    [("s3://bucket/a", r"canid\[s3\]"), ("nothing://a/b", "nothing"), ("zip://a::file:///no.zip", "zip")],
)
def test_storage_that_cannot_be_listed_is_one_line(url: str, says: str) -> None:
    """A package that is missing is named with the extra that has it; all else with what the storage says."""
    if url.startswith("s3:") and find_spec("s3fs") is not None:
        pytest.skip("s3fs is installed")
    with pytest.raises(ConfigError, match=says) as refused:
        planned([url], vehicle="generic")
    assert len(refused.value.mistakes) == 1
    assert "\n" not in str(refused.value)


COUNTING = """
import sys, tracemalloc
from canid.analysis.fleet.planning.plan import planned
seen = {"open": [], "os.scandir": []}
def count(event, args):
    if event in seen and str(args[0]).startswith(sys.argv[1]):
        seen[event].append(args[0])
planned([sys.argv[1] + "/driver 0"], vehicle="generic")
tracemalloc.start()
planned([sys.argv[1] + "/driver 0"], vehicle="generic")
before = tracemalloc.get_traced_memory()[1]
tracemalloc.reset_peak()
sys.addaudithook(count)
plan = planned([sys.argv[1]], vehicle="generic")
each = (tracemalloc.get_traced_memory()[1] - before) // (len(plan.logs) - 100)
print(len(plan.logs), len(seen["open"]), len(seen["os.scandir"]), each)
"""


@pytest.mark.slow("runs of a fleet in processes of their own")
def test_ten_thousand_logs_are_planned_without_reading_one(tmp_path: Path) -> None:
    """One listing of each folder, no file opened, and less than 1 kB of memory for each log."""
    for driver in range(100):
        (tmp_path / f"driver {driver}").mkdir()
        for number in range(100):
            os.close(os.open(tmp_path / f"driver {driver}/drive {number:04d}.blf", os.O_CREAT))
    done = subprocess.run(
        [sys.executable, "-c", COUNTING, str(tmp_path)], capture_output=True, text=True, check=True
    )
    logs, opened, folders, bytes_of_a_log = map(int, done.stdout.split())
    assert (logs, opened, folders) == (10_000, 0, 101)
    assert bytes_of_a_log < 1000


def test_folders_that_are_named_one_by_one_are_drivers(tmp_path: Path) -> None:
    """`canid fleet logs/anna logs/ben`: the folders' own names; one with folders of its own keeps those."""
    for name in ("anna/a.blf", "ben/b.blf", "car/cleo/c.blf"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_bytes(b"0")
    words = [str(tmp_path / name) for name in ("anna", "ben", "car")]
    assert [one.driver for one in planned(words, vehicle="generic").logs] == ["anna", "ben", "cleo"]
    assert [one.driver for one in planned(words[:1], vehicle="generic").logs] == ["a"]
