"""Tests that files and folders are written completely or not at all, and that links are not followed."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from basecal.cell.format import writing
from basecal.cell.format.writing import (
    append_durably,
    is_unused,
    make_folder,
    make_timed_folder,
    open_new,
    open_without_links,
    stage_folder,
    temporary_path,
    write_atomically,
    write_new,
    write_output,
    write_private,
)
from basecal.errors import InputError


def names(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


@pytest.mark.parametrize(("name", "unused"), [
    ("", True), (".cell.yaml.0123abcd.part", True), (".gitignore", False), ("valve.part", False), ("a", False),
])  # fmt: skip
def test_folder_with_only_temporary_files_is_unused(tmp_path: Path, name: str, unused: bool) -> None:
    """Only leftovers of an interrupted write count as unused; hidden files and other `.part` files do not."""
    temporary_path(tmp_path / "samples.jsonl").touch()
    if name:
        (tmp_path / name).touch()
    assert is_unused(tmp_path) == unused


def fail(number: int):
    def failing(*_args, **_kwargs):
        raise OSError(number, os.strerror(number))

    return failing


def test_timed_folders_of_one_second_are_numbered(tmp_path):
    """Each timed folder is new, even within one second; none is created through a link."""
    made = [make_timed_folder(tmp_path / "runs", tmp_path) for _ in range(3)]
    assert len({folder.name for folder in made}) == 3
    assert all(folder.is_dir() for folder in made)
    (tmp_path / "elsewhere").symlink_to(tmp_path / "runs")
    with pytest.raises(InputError, match="is a link"):
        make_timed_folder(tmp_path / "elsewhere", tmp_path)


def test_write_creates_folders_and_leaves_no_temporary_file(tmp_path):
    """The text is written in newly made folders with nothing beside it; a failure names the path."""
    path = tmp_path / "runs" / "one" / "a.json"
    write_atomically(path, "grün")
    write_atomically(path, "blue \udcff")
    assert path.read_bytes() == b"blue \\udcff"
    assert [each.name for each in path.parent.iterdir()] == ["a.json"]
    with pytest.raises(InputError, match=r"a\.json/b cannot be written: "):
        write_atomically(path / "b", "x")


def test_output_is_replaced_completely_or_written_to_pipe(tmp_path, monkeypatch):
    """A failed write keeps the old file of the given name; a pipe of that name is written to directly."""
    path = tmp_path / "a.svg"
    write_output(path, b"old")
    monkeypatch.setattr(os, "fsync", fail(errno.ENOSPC))
    with pytest.raises(InputError, match="No space left"):
        write_output(path, "new")
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["a.svg"]
    write_output(Path(os.devnull), "gone")
    with pytest.raises(InputError, match="cannot be written"):
        write_output(tmp_path, "a folder")


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_failed_write_keeps_old_file(tmp_path, monkeypatch, call):
    """A full disk leaves the old file, and no temporary one."""
    path = tmp_path / "a"
    write_atomically(path, "old")
    monkeypatch.setattr(writing.os, call, fail(errno.ENOSPC))
    with pytest.raises(InputError, match="a cannot be written: No space left on device"):
        write_atomically(path, "new")
    assert path.read_text() == "old"
    assert names(tmp_path) == ["a"]


def test_durable_write_syncs_file_and_folder(tmp_path, monkeypatch):
    """The file is synchronised before it gets its name, and the folder afterwards; not if `durable` is false."""
    done = []
    real_sync, real_replace = os.fsync, os.replace
    monkeypatch.setattr(writing.os, "fsync", lambda number: (done.append("sync"), real_sync(number)))
    monkeypatch.setattr(writing.os, "replace", lambda a, b: (done.append("name"), real_replace(a, b)))
    write_atomically(tmp_path / "a", "x")
    assert done == ["sync", "name", "sync"]
    done.clear()
    write_atomically(tmp_path / "a", "x", durable=False)
    assert done == ["name"]


def test_links_are_replaced_not_followed(tmp_path):
    """A link at the file's path is replaced by the file; a folder below the cell that is a link is refused."""
    outside, cell = tmp_path / "outside", tmp_path / "cell"
    outside.mkdir()
    cell.mkdir()
    (outside / "victim").write_text("mine")
    (cell / "a").symlink_to(outside / "victim")
    write_atomically(cell / "a", "x", base_folder=cell)
    assert not (cell / "a").is_symlink()
    (cell / "runs").symlink_to(outside)
    for path in (cell / "runs" / "b", cell / "runs" / "new" / "b"):
        with pytest.raises(InputError, match="runs is a link, and files are written only inside the cell"):
            write_atomically(path, "x", base_folder=cell)
    (tmp_path / "named").symlink_to(cell)
    write_atomically(
        tmp_path / "named" / "c", "x", base_folder=tmp_path / "named"
    )  # the cell folder itself may be a link
    assert names(outside) == ["victim"]
    assert (outside / "victim").read_text() == "mine"


def test_temporary_names_are_unique_and_links_refused(tmp_path):
    """Temporary names differ each time, and an existing file or link of that name is not written to."""
    assert temporary_path(tmp_path / "a") != temporary_path(tmp_path / "a")
    (tmp_path / "victim").write_text("mine")
    (tmp_path / "link").symlink_to(tmp_path / "victim")
    with pytest.raises(FileExistsError):
        open_new(tmp_path / "link")
    with pytest.raises(OSError, match="Too many levels of symbolic links"):
        open_without_links(tmp_path / "link", "ab")
    with open_without_links(tmp_path / "victim", "ab") as file:
        file.write(b"!")
    assert (tmp_path / "victim").read_text() == "mine!"


def test_existing_file_is_not_overwritten(tmp_path):
    """Existing files and dangling links are not overwritten."""
    write_new(tmp_path / "a", "x")
    (tmp_path / "b").symlink_to(tmp_path / "nowhere")
    for name in "ab":
        with pytest.raises(InputError, match="exists and is not overwritten"):
            write_new(tmp_path / name, "y")
    assert names(tmp_path) == ["a", "b"]


@pytest.mark.parametrize("before", [None, [], ["kept", "recording/old"]])
def test_staged_folder_appears_at_once(tmp_path, before):
    """A staged folder fills a missing or empty folder, or joins one with content, which is kept."""
    folder = tmp_path / "cell"
    for name in before or ():
        write_atomically(folder / name, "old")
    if before == []:
        folder.mkdir()
    with stage_folder(folder) as part:
        write_atomically(part / "recording" / "samples.jsonl", "1")
        write_atomically(part / "cell.yaml", "2")
        assert not (folder / "cell.yaml").exists()
    there = ["cell.yaml", "recording", "recording/samples.jsonl", *(before or [])]
    assert names(folder) == sorted(there)
    assert [path.name for path in tmp_path.iterdir()] == ["cell"]


def test_failed_staging_leaves_no_files(tmp_path):
    """Any failure of staging leaves no files."""

    def stage_and_fail(folder, error):
        with stage_folder(folder) as part:
            write_atomically(part / "a", "x")
            raise error

    for error in (KeyboardInterrupt, InputError):
        with pytest.raises(error):
            stage_and_fail(tmp_path / "cell", error)
    with pytest.raises(InputError, match="cannot be written: No space left"), stage_folder(tmp_path / "cell"):
        fail(errno.ENOSPC)()
    assert names(tmp_path) == []


def test_make_folder_creates_parents(tmp_path):
    """`make_folder` creates the folders above, too."""
    make_folder(tmp_path / "a" / "b", tmp_path)
    make_folder(tmp_path / "a" / "c")
    assert names(tmp_path) == ["a", "a/b", "a/c"]


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_private_file_is_readable_by_owner_only(tmp_path, monkeypatch):
    """A private file has mode 600 whatever the umask; it is written completely, without waiting for the disk."""
    synced = []
    monkeypatch.setattr(os, "fsync", synced.append)
    before = os.umask(0)
    try:
        write_private(tmp_path / "key", "secret", base_folder=tmp_path)
        write_atomically(tmp_path / "open", "all")
    finally:
        os.umask(before)
    assert (tmp_path / "key").read_text() == "secret"
    assert (tmp_path / "key").stat().st_mode & 0o777 == 0o600
    assert (tmp_path / "open").stat().st_mode & 0o777 == 0o666
    assert len(synced) == 2  # the public file and its folder


def test_appended_lines_are_synchronised(tmp_path, monkeypatch):
    """Lines are appended to an existing or a new file in a new folder, never through a link.

    An error names the file.
    """
    synchronised = []
    monkeypatch.setattr(os, "fsync", synchronised.append)
    path = tmp_path / "runs" / "lines"
    append_durably(path, "one\n", base_folder=tmp_path)
    append_durably(path, "two \udcff\n")
    assert path.read_bytes() == b"one\ntwo \\udcff\n"
    assert len(synchronised) == 4  # the file and its folder, each time
    (tmp_path / "link").symlink_to(path)
    for wrong in (tmp_path / "link", path / "below"):
        with pytest.raises(InputError, match=f"^{wrong} cannot be written: "):
            append_durably(wrong, "three\n")
    (tmp_path / "elsewhere").symlink_to(tmp_path / "runs")
    with pytest.raises(InputError, match="elsewhere is a link"):
        append_durably(tmp_path / "elsewhere" / "lines", "three\n", base_folder=tmp_path)
    assert path.read_bytes().count(b"\n") == 2


@pytest.mark.parametrize(
    ("before", "after", "removed"),
    [
        (b"", b"3\n", 0),
        (b"1\n", b"1\n3\n", 0),
        (b"1\n{}", b"1\n{}\n3\n", 0),
        (b'1\n\n{"a": ', b"1\n\n3\n", 3),
        (b'{"a": "\xe5', b"3\n", 1),
        (b"[" * 100_000, b"3\n", 1),
    ],
)
def test_incomplete_last_line_is_repaired_before_appending(tmp_path, before, after, removed):
    """A last line without newline is completed or removed, and the removed line's number is returned."""
    path = tmp_path / "lines"
    path.write_bytes(before)
    assert append_durably(path, "3\n") == removed
    assert path.read_bytes() == after


def test_bytes_and_text_are_written_to_pipe(tmp_path):
    """Bytes are written to a pipe unchanged; text with lone surrogates is escaped."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for content, wanted in ((b"\xffraw", b"\xffraw"), ("gr\u00fcn \udcff", "gr\u00fcn \\udcff".encode())):
        reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
        write_output(pipe, content)
        assert os.read(reader, 100) == wanted
        os.close(reader)


@pytest.mark.parametrize(("named", "expected"), [(None, "cell"), ("other", "other")])
def test_staging_error_names_failed_file(tmp_path, named, expected):
    """The error names the failed file if it is known, else the folder."""
    folder = tmp_path / "cell"
    error = OSError(errno.ENOSPC, "No space left", named and str(tmp_path / named))
    with pytest.raises(InputError) as caught, stage_folder(folder):
        raise error
    assert str(caught.value) == f"{tmp_path / expected} cannot be written: No space left"
    assert names(tmp_path) == []
