# SPDX-License-Identifier: GPL-3.0-or-later
"""What somebody else has put where Rockfall writes is never emptied, removed or written through."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from rockfall.core import output
from rockfall.core.errors import InputError
from rockfall.core.open_folders import may_be_planted
from rockfall.core.output import LOCK, OURS, output_file, output_folder, write_text

NOBODY = 65534
AS_ROOT = pytest.mark.skipif(
    sys.platform != "linux" or os.geteuid() != 0, reason="only root can make files of other users"
)


@pytest.fixture(autouse=True)
def no_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(output, "BETWEEN_S", 0.0)


def tree(folder: Path) -> dict[str, bytes | None]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


def refused(out: Path, fill: Callable[[Path], None], said: str) -> None:
    with pytest.raises(InputError, match=said), output_folder(out) as folder:
        fill(folder)


def as_a_folder(place: Path) -> None:
    (place / "deep").mkdir(parents=True)
    (place / "deep" / "mine.csv").write_text("mine")


def as_an_empty_folder(place: Path) -> None:
    place.mkdir()


def with_an_empty_lock(place: Path) -> None:
    as_a_folder(place)
    (place / LOCK).touch()


def with_words_of_its_own(place: Path) -> None:
    as_a_folder(place)
    (place / LOCK).write_bytes(OURS + b"or not")


def with_a_lock_that_is_a_link(place: Path) -> None:
    as_a_folder(place)
    (place.parent / "elsewhere").write_bytes(OURS)
    (place / LOCK).symlink_to(place.parent / "elsewhere")


def with_a_lock_of_two_names(place: Path) -> None:
    as_a_folder(place)
    (place.parent / "elsewhere").write_bytes(OURS)
    os.link(place.parent / "elsewhere", place / LOCK)


def with_a_pipe(place: Path) -> None:
    as_a_folder(place)
    os.mkfifo(place / LOCK)


def as_a_file(place: Path) -> None:
    place.write_text("mine")


def as_a_link_to_a_folder(place: Path) -> None:
    as_a_folder(place.parent / "elsewhere")
    place.symlink_to(place.parent / "elsewhere")


def as_a_link_to_one_of_ours(place: Path) -> None:
    as_a_link_to_a_folder(place)
    (place / LOCK).write_bytes(OURS)


FOREIGN = (
    as_a_folder, as_an_empty_folder, with_an_empty_lock, with_words_of_its_own, with_a_lock_that_is_a_link,
    with_a_lock_of_two_names, with_a_pipe, as_a_file, as_a_link_to_a_folder, as_a_link_to_one_of_ours,
)  # fmt: skip


@pytest.mark.skipif(os.name == "nt", reason="links and pipes")
@pytest.mark.parametrize("make", FOREIGN, ids=lambda make: make.__name__)
def test_what_has_the_name_of_a_staging_folder_is_refused_and_left(tmp_path, make):
    place = tmp_path / ".out.part"
    make(place)
    before = tree(tmp_path)
    for _ in range(2):
        with pytest.raises(InputError, match="was not made by Rockfall") as refused, output_folder(tmp_path / "out"):
            pass
        assert refused.value.file == place
    with pytest.raises(InputError, match="was not made by Rockfall"):
        write_text(tmp_path / "out", "a file")
    assert tree(tmp_path) == before
    write_text(tmp_path / "other", "beside it")  # looks for what dead processes have left
    assert tree(tmp_path) == before | {"other": b"beside it"}


def test_what_a_dead_run_has_left_is_still_removed(tmp_path):
    as_a_folder(tmp_path / ".dead.part")
    (tmp_path / ".dead.part" / LOCK).write_bytes(OURS)
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "mine.csv").write_text("mine")
    (tmp_path / ".dead.part" / "link").symlink_to(tmp_path / "kept")
    write_text(tmp_path / "a", "1")
    assert tree(tmp_path) == {"a": b"1", "kept": None, "kept/mine.csv": b"mine"}


def test_the_output_may_be_a_link_and_lie_behind_one(tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "disk")
    for place in (tmp_path / "link", tmp_path / "link" / "out"):
        with output_folder(place) as folder:
            write_text(folder / "a.csv", "1")
    assert tree(tmp_path / "disk") == {"a.csv": b"1", "out": None, "out/a.csv": b"1"}
    assert (tmp_path / "link").is_symlink()


def test_a_link_that_leads_nowhere_is_refused_before_the_work(tmp_path):
    (tmp_path / "out").symlink_to(tmp_path / "gone")
    with pytest.raises(InputError, match="leads nowhere"), output_folder(tmp_path / "out"):
        pytest.fail("it began")


@pytest.mark.parametrize("name", ["maps", "figures"])
def test_a_link_in_place_of_a_part_is_refused_before_the_work(tmp_path, name):
    (tmp_path / "out").mkdir(), (tmp_path / "photos").mkdir()
    (tmp_path / "out" / name).symlink_to(tmp_path / "photos")
    with pytest.raises(InputError, match="A link is in the output") as refused, output_folder(tmp_path / "out"):
        pytest.fail("it began")
    assert refused.value.file == tmp_path / "out" / name


@pytest.mark.parametrize("link", ["deep", "deep/deeper", "deep/a.csv", "b.csv"])
def test_no_link_in_the_output_is_followed_or_replaced(tmp_path, link):
    out, other = tmp_path / "out", tmp_path / "other"
    other.mkdir()
    for name in ("a.csv", "b.csv"):
        (other / name).write_text("mine")
    (out / link).parent.mkdir(parents=True)
    (out / link).symlink_to(other if "." not in link else other / Path(link).name)
    before = tree(tmp_path)

    def fill(folder: Path) -> None:
        (folder / "deep" / "deeper").mkdir(parents=True)
        for name in ("a.csv", "deep/a.csv", "deep/deeper/b.csv", "b.csv"):
            write_text(folder / name, "ours")

    refused(out, fill, "A link is in the output")
    assert tree(tmp_path) == before


def test_a_link_that_is_put_there_meanwhile_is_not_followed(tmp_path):
    out, other = tmp_path / "out", tmp_path / "other"
    other.mkdir()
    (other / "a.csv").write_text("mine")

    def fill(folder: Path) -> None:
        write_text(folder / "a.csv", "ours")
        out.symlink_to(other)

    refused(out, fill, "Something else has been put")
    assert (other / "a.csv").read_text() == "mine"


def test_a_staging_folder_that_is_exchanged_meanwhile_keeps_what_is_in_it(tmp_path):
    """Whoever may write into the folder of the output can move ours away and put a link in its place."""
    other = tmp_path / "other"
    as_a_folder(other)

    def fill(folder: Path) -> None:
        write_text(folder / "a.csv", "ours")
        folder.parent.rename(tmp_path / "moved")
        (tmp_path / ".out.part").symlink_to(other)
        write_text(folder.parent / "deep" / "ours.csv", "ours")
        raise InputError("It fails, and all is to be removed")

    refused(tmp_path / "out", fill, "It fails")
    assert (other / "deep" / "mine.csv").read_text() == "mine"
    assert (tmp_path / ".out.part").is_symlink()


@AS_ROOT
def test_what_another_user_has_left_is_not_touched(tmp_path):
    as_a_folder(tmp_path / ".out.part")
    (tmp_path / ".out.part" / LOCK).write_bytes(OURS)
    for path in ((tmp_path / ".out.part"), (tmp_path / ".out.part" / LOCK)):
        os.chown(path, NOBODY, NOBODY)
        before = tree(tmp_path)
        with pytest.raises(InputError, match="or by another user"), output_folder(tmp_path / "out"):
            pass
        assert tree(tmp_path) == before
        os.chown(path, 0, 0)
    write_text(tmp_path / "a", "1")
    assert tree(tmp_path) == {"a": b"1"}


@AS_ROOT
def test_a_link_of_another_user_in_a_shared_folder_is_not_followed(tmp_path):
    shared, mine = tmp_path / "shared", tmp_path / "mine"
    shared.mkdir(), mine.mkdir()
    (shared / "out").symlink_to(mine)
    (mine / "a.csv").write_text("mine")
    os.chown(shared / "out", NOBODY, NOBODY, follow_symlinks=False)
    assert not may_be_planted(shared / "out")
    shared.chmod(0o1777)
    assert may_be_planted(shared / "out")
    for place in (shared / "out", shared / "out" / "deep"):
        with pytest.raises(InputError, match="link of another user"), output_folder(place):
            pass
    (shared / "a.csv").symlink_to(mine / "a.csv")
    os.chown(shared / "a.csv", NOBODY, NOBODY, follow_symlinks=False)
    with pytest.raises(InputError, match="link of another user"), output_file(shared / "a.csv"):
        pass
    assert tree(mine) == {"a.csv": b"mine"}


@AS_ROOT
def test_a_folder_that_may_not_be_written_to_is_said_and_left(tmp_path):
    """Permissions do not bind root, so that another user tries."""
    tmp_path.chmod(0o755)
    for folder in tmp_path.parents:
        if folder != Path("/tmp") and not folder.stat().st_mode & 1:
            folder.chmod(folder.stat().st_mode | 0o011)
    (tmp_path / "out").mkdir()
    code = (
        "import os, sys\nfrom rockfall.core.output import output_folder, write_text\n"
        f"os.setgid({NOBODY}), os.setuid({NOBODY})\n"
        "for name in ('out', 'new', 'new/deep'):\n"
        "    try:\n"
        "        with output_folder(os.path.join(sys.argv[1], name)): print('began')\n"
        "    except Exception as error: print(type(error).__name__, str(error).partition(': ')[2])\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.stdout.splitlines() == [
        f"InputError The output {what} (Permission denied). Choose another folder for the output."
        for what in ("cannot be written there", "cannot be written there", "folder cannot be made")
    ], done.stderr
    assert tree(tmp_path) == {"out": None}
