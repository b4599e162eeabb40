# SPDX-License-Identifier: GPL-3.0-or-later
"""Output is whole or not there: on a full disk, beside another run, after one that died, when it is interrupted."""

import errno
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from rockfall.core.cli import main
from rockfall.core.errors import InputError
from rockfall.core.interrupts import Interrupt
from rockfall.core.output import LOCK, output_file, output_folder, output_stream, write_text


@contextmanager
def room_for(size: int) -> Iterator[None]:
    """Files cannot grow over `size` bytes: the system refuses that as it refuses to write to a full disk."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_output_appears_whole_and_spares_other_files(tmp_path):
    out = tmp_path / "deep" / "out"
    with output_folder(out) as folder:
        (folder / "a.csv").write_text("1")
        (folder / "frames").mkdir()
        (folder / "frames" / "0.png").write_text("2")
        assert not out.exists()
    assert (out / "a.csv").read_text() == "1"
    (out / "mine.txt").write_text("keep")
    with output_folder(out) as folder:
        (folder / "a.csv").write_text("3")
    assert sorted(path.name for path in out.iterdir()) == ["a.csv", "frames", "mine.txt"]
    assert (out / "a.csv").read_text() == "3"
    assert [path.name for path in out.parent.iterdir()] == ["out"]


def write_and_fail(out):
    with output_folder(out) as folder:
        (folder / "a.csv").write_text("half")
        raise ValueError("half way")


def test_nothing_is_left_of_output_that_failed(tmp_path):
    with pytest.raises(ValueError, match="half way"):
        write_and_fail(tmp_path / "deep" / "out")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "a.csv").write_text("old")
    with pytest.raises(ValueError, match="half way"):
        write_and_fail(tmp_path / "out")
    assert (tmp_path / "out" / "a.csv").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_only_an_error_of_the_output_itself_is_called_one(tmp_path):
    with (
        pytest.raises(InputError, match=r"a\.csv: The output cannot be written \("),
        output_folder(tmp_path / "out") as out,
    ):
        (out / "missing" / "a.csv").write_text("1")
    with pytest.raises(FileNotFoundError, match=r"other\.csv"), output_folder(tmp_path / "out"):
        (tmp_path / "other.csv").read_text()
    with pytest.raises(OSError, match=r"^no file at all$"), output_folder(tmp_path / "out"):
        raise OSError("no file at all")
    assert list(tmp_path.iterdir()) == []


def test_output_does_not_replace_a_file_or_folder_of_another_kind(tmp_path):
    (tmp_path / "out").write_text("a file")
    with pytest.raises(InputError, match="This is a file, not a folder"), output_folder(tmp_path / "out"):
        pass
    below = tmp_path / "out" / "deep"
    with pytest.raises(InputError, match=r"deep: The output folder cannot be made \("), output_folder(below):
        pass
    (tmp_path / "dir" / "a.csv").mkdir(parents=True)
    with pytest.raises(InputError, match="folder is where a file"), output_folder(tmp_path / "dir") as folder:
        (folder / "a.csv").write_text("new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dir", "out"]


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_file_that_has_no_room_is_named_and_the_old_one_stays(tmp_path):
    write_text(tmp_path / "a.toml", "old")
    with room_for(1000), pytest.raises(InputError) as refused:
        write_text(tmp_path / "a.toml", "x" * 100_000)
    too_large = os.strerror(errno.EFBIG)  # in the language of the machine
    assert str(refused.value).startswith(f"{tmp_path / 'a.toml'}: The file cannot be written ({too_large}). Make")
    assert (tmp_path / "a.toml").read_text() == "old"
    assert names(tmp_path) == ["a.toml"]


def test_a_staged_file_that_has_no_room_is_named_where_it_would_be(tmp_path):
    (tmp_path / "old").mkdir()
    for place in (tmp_path / "new", tmp_path / "old"):
        with room_for(1000), pytest.raises(InputError) as refused, output_folder(place) as folder:
            write_text(folder / "a.csv", "x" * 100_000)
        assert refused.value.file == place / "a.csv"
    assert names(tmp_path) == ["old"]
    assert names(tmp_path / "old") == []


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EIO])
def test_a_disk_that_says_at_last_that_it_is_full_leaves_the_old_output(tmp_path, monkeypatch, number):
    with output_folder(tmp_path / "out") as folder:
        write_text(folder / "a.csv", "old")

    def full(descriptor):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(InputError, match="cannot be written"), output_file(tmp_path / "out" / "a.csv") as draft:
        draft.write_text("new")
    with (
        pytest.raises(InputError, match=r"a\.csv: The file cannot be written"),
        output_folder(tmp_path / "out") as folder,
    ):
        write_text(folder / "a.csv", "new")
    assert (tmp_path / "out" / "a.csv").read_text() == "old"
    assert names(tmp_path / "out") == ["a.csv"]


def test_two_runs_into_one_folder_do_not_mix(tmp_path):
    for place in (tmp_path / "new", tmp_path):
        with (
            output_folder(place) as folder,
            pytest.raises(InputError, match="Another run of Rockfall is writing here"),
            output_folder(place),
        ):
            pass
        assert not folder.exists()
    with output_stream(tmp_path / "a.csv") as stream, output_folder(tmp_path) as folder:  # beside it is no harm
        stream.write("1")
        write_text(folder / "b.csv", "2")
    assert names(tmp_path) == ["a.csv", "b.csv", "new"]


def test_what_a_killed_run_has_left_is_removed_by_the_next_one(tmp_path):
    script = (
        "import os, sys; from rockfall.core.output import output_folder\n"
        "with output_folder(sys.argv[1]) as folder:\n"
        "    (folder / 'half.csv').write_text('half'); print(flush=True); sys.stdin.read()"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "dead")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        child.stdout.readline()
        with pytest.raises(InputError, match="Another run"), output_folder(tmp_path / "dead"):
            pass
        write_text(tmp_path / "a.csv", "1")
        assert (tmp_path / ".dead.part" / LOCK).exists()
        child.kill()
    write_text(tmp_path / "a.csv", "2")
    assert names(tmp_path) == ["a.csv"]


def test_a_signal_while_files_are_moved_waits_until_all_are(tmp_path, monkeypatch):
    (tmp_path / "out").mkdir()
    before, replace = signal.getsignal(signal.SIGINT), os.replace

    def interrupted(*names, **folders):
        signal.raise_signal(signal.SIGINT)
        replace(*names, **folders)

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(Interrupt, match="out is complete"), output_folder(tmp_path / "out") as folder:
        (folder / "a.csv").write_text("1"), (folder / "b.csv").write_text("2")
    assert names(tmp_path / "out") == ["a.csv", "b.csv"]
    assert signal.getsignal(signal.SIGINT) == before


def test_devices_and_links_are_written_to(tmp_path):
    write_text(os.devnull, "nothing")
    (tmp_path / "true.toml").write_text("old")
    (tmp_path / "link.toml").symlink_to(tmp_path / "true.toml")
    write_text(tmp_path / "link.toml", "new")
    assert (tmp_path / "true.toml").read_text() == "new"
    assert (tmp_path / "link.toml").is_symlink()


@pytest.mark.parametrize("room", [0, 2000])
def test_a_command_on_a_full_disk_says_which_file_and_keeps_the_old_output(tmp_path, room):
    pytest.importorskip("resource")
    picks, out = tmp_path / "picks.csv", tmp_path / "out"
    rows = [f"a,{0.8 * i},{5 * i},0,{-3 * i},{'impact' if i else 'release'}" for i in range(30)]
    picks.write_text("\n".join(["trajectory,time_s,x_m,y_m,z_m,kind", *rows, ""]))
    assert main(["reconstruct", str(picks), "--out", str(out)]) == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    assert min(map(len, before.values())) > room
    code = (
        "import resource, sys; from rockfall.core.cli import main\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({room}, {room})); sys.exit(main(sys.argv[1:]))"
    )
    command = [sys.executable, "-c", code, "reconstruct", str(picks), "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    said = (
        f"{out / 'impacts.csv'}: The file cannot be written" if room else f"{out}: The output cannot be written there"
    )
    assert done.stderr.startswith(f"rockfall: {said} ({os.strerror(errno.EFBIG)}). Make")
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_a_command_that_is_asked_to_end_ends_as_after_an_interrupt(monkeypatch, capsys, name):
    number = getattr(signal, name, None) or pytest.skip("not on this system")
    before = signal.getsignal(number)
    monkeypatch.setattr("rockfall.core.commands.models.run", lambda arguments: signal.raise_signal(number))
    assert main(["models"]) == 128 + number
    assert capsys.readouterr().err == "rockfall: interrupted, nothing was written.\n"
    assert signal.getsignal(number) == before


def test_a_child_ends_with_its_parent_however_that_ends():
    child = "import time; from rockfall.core.children import end_with_parent; end_with_parent(); time.sleep(100)"
    parent = (
        "import sys, time; from rockfall.core.children import child\n"
        "with child([sys.executable, '-c', sys.argv[1]], stdout=None, stderr=None): print(flush=True); time.sleep(100)"
    )
    with subprocess.Popen([sys.executable, "-c", parent, child], stdout=subprocess.PIPE) as process:
        process.stdout.readline()
        process.kill()
        assert process.stdout.read() == b""  # which ends when the child has, for it has this pipe, too
