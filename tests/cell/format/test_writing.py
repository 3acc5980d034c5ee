"""Files and folders appear whole or not at all, and links are not followed."""

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
def test_only_what_a_write_left_counts_as_nothing(tmp_path: Path, name: str, unused: bool) -> None:
    """Hidden files and parts of somebody else are somebody's."""
    temporary_path(tmp_path / "samples.jsonl").touch()
    if name:
        (tmp_path / name).touch()
    assert is_unused(tmp_path) == unused


def fail(number: int):
    def failing(*_args, **_kwargs):
        raise OSError(number, os.strerror(number))

    return failing


def test_folders_of_one_second_have_numbers(tmp_path):
    """Each is new, whoever makes another at once; none is made through a link."""
    made = [make_timed_folder(tmp_path / "runs", tmp_path) for _ in range(3)]
    assert len({folder.name for folder in made}) == 3
    assert all(folder.is_dir() for folder in made)
    (tmp_path / "elsewhere").symlink_to(tmp_path / "runs")
    with pytest.raises(InputError, match="is a link"):
        make_timed_folder(tmp_path / "elsewhere", tmp_path)


def test_a_file_is_written_whole(tmp_path):
    """The text, in folders made for it, nothing beside it; where that cannot be, an error with the path."""
    path = tmp_path / "runs" / "one" / "a.json"
    write_atomically(path, "grün")
    write_atomically(path, "blue \udcff")
    assert path.read_bytes() == b"blue \\udcff"
    assert [each.name for each in path.parent.iterdir()] == ["a.json"]
    with pytest.raises(InputError, match=r"a\.json/b cannot be written: "):
        write_atomically(path / "b", "x")


def test_what_is_asked_for_is_whole_or_goes_into_a_pipe(tmp_path, monkeypatch):
    """A file of a name that was given is the old one or the new one; a pipe of that name is written to."""
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
def test_a_file_that_fails_is_as_it_was(tmp_path, monkeypatch, call):
    """A full disk leaves the old file, and nothing beside it."""
    path = tmp_path / "a"
    write_atomically(path, "old")
    monkeypatch.setattr(writing.os, call, fail(errno.ENOSPC))
    with pytest.raises(InputError, match="a cannot be written: No space left on device"):
        write_atomically(path, "new")
    assert path.read_text() == "old"
    assert names(tmp_path) == ["a"]


def test_what_is_durable_is_synchronised(tmp_path, monkeypatch):
    """The file before it gets its name, and the folder after that; not where it need not be."""
    done = []
    real_sync, real_replace = os.fsync, os.replace
    monkeypatch.setattr(writing.os, "fsync", lambda number: (done.append("sync"), real_sync(number)))
    monkeypatch.setattr(writing.os, "replace", lambda a, b: (done.append("name"), real_replace(a, b)))
    write_atomically(tmp_path / "a", "x")
    assert done == ["sync", "name", "sync"]
    done.clear()
    write_atomically(tmp_path / "a", "x", durable=False)
    assert done == ["name"]


def test_links_are_replaced_and_not_followed(tmp_path):
    """A link where the file goes gives way to it; a folder that is a link is refused below the cell."""
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
    write_atomically(tmp_path / "named" / "c", "x", base_folder=tmp_path / "named")  # the cell itself may be one
    assert names(outside) == ["victim"]
    assert (outside / "victim").read_text() == "mine"


def test_names_beside_are_never_taken(tmp_path):
    """They differ each time, and one that is there nevertheless is not written to."""
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


def test_what_is_there_is_not_overwritten(tmp_path):
    """Not even by a link that leads nowhere."""
    write_new(tmp_path / "a", "x")
    (tmp_path / "b").symlink_to(tmp_path / "nowhere")
    for name in "ab":
        with pytest.raises(InputError, match="exists and is not overwritten"):
            write_new(tmp_path / name, "y")
    assert names(tmp_path) == ["a", "b"]


@pytest.mark.parametrize("before", [None, [], ["kept", "recording/old"]])
def test_a_staged_folder_appears_at_once(tmp_path, before):
    """Into a folder that is not there, an empty one, and one that holds something, which stays."""
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


def test_a_staged_folder_that_fails_leaves_nothing(tmp_path):
    """Whatever ended it."""

    def written(folder, error):
        with stage_folder(folder) as part:
            write_atomically(part / "a", "x")
            raise error

    for error in (KeyboardInterrupt, InputError):
        with pytest.raises(error):
            written(tmp_path / "cell", error)
    with pytest.raises(InputError, match="cannot be written: No space left"), stage_folder(tmp_path / "cell"):
        fail(errno.ENOSPC)()
    assert names(tmp_path) == []


def test_folders_are_made(tmp_path):
    """Those above too."""
    make_folder(tmp_path / "a" / "b", tmp_path)
    make_folder(tmp_path / "a" / "c")
    assert names(tmp_path) == ["a", "a/b", "a/c"]


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_what_is_private_only_its_owner_reads(tmp_path, monkeypatch):
    """Whatever the mask allows others; written whole, without waiting for the disk."""
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
    assert len(synced) == 2  # the open one and its folder


def test_lines_are_appended_and_on_the_disk(tmp_path, monkeypatch):
    """Into a new file, whose folder is made, and to what is there; through no link, and an error names the file."""
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
def test_a_line_that_was_cut_off_does_not_spoil_the_next(tmp_path, before, after, removed):
    """A last line without its end is completed or removed, and the removed one is counted."""
    path = tmp_path / "lines"
    path.write_bytes(before)
    assert append_durably(path, "3\n") == removed
    assert path.read_bytes() == after


def test_bytes_and_text_go_into_a_pipe_alike(tmp_path):
    """As they are, what is half a character escaped."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for content, wanted in ((b"\xffraw", b"\xffraw"), ("gr\u00fcn \udcff", "gr\u00fcn \\udcff".encode())):
        reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
        write_output(pipe, content)
        assert os.read(reader, 100) == wanted
        os.close(reader)


@pytest.mark.parametrize(("named", "told"), [(None, "cell"), ("other", "other")])
def test_what_cannot_be_staged_is_named(tmp_path, named, told):
    """The file of the fault where it is known, else the folder."""
    folder = tmp_path / "cell"
    error = OSError(errno.ENOSPC, "No space left", named and str(tmp_path / named))
    with pytest.raises(InputError) as caught, stage_folder(folder):
        raise error
    assert str(caught.value) == f"{tmp_path / told} cannot be written: No space left"
    assert names(tmp_path) == []
