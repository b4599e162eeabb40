# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that are decoded in a thread of their own: the same ones, and an end of that thread however it comes."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.footage import sources
from rockfall.core.footage.ahead import ahead
from rockfall.core.footage.background import no_motion
from rockfall.core.footage.sources import frames
from rockfall.core.footage.tracking import track_block
from rockfall.core.footage.video import open_video, read_frames
from rockfall.core.progress import CancelledError

FILM = Path(__file__).parent.parent / "data" / "videos" / "variable.mp4"
AHEAD_OF_US = "rockfall-ahead"


def decoding() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name.startswith(AHEAD_OF_US)]


def counting(made: list[int], most: int, error: Exception | None = None) -> Iterator[int]:
    for number in range(most):
        made.append(number)
        yield number
    if error is not None:
        raise error


@pytest.fixture(autouse=True)
def _no_thread_is_left() -> Iterator[None]:
    yield
    assert not decoding()


def test_the_same_items_come_in_the_same_order_and_are_made_elsewhere() -> None:
    made: list[int] = []
    threads = set()

    def items() -> Iterator[int]:
        for number in counting(made, 50):
            threads.add(threading.current_thread())
            yield number

    assert list(ahead(items())) == list(range(50))
    assert threading.current_thread() not in threads
    assert len(threads) == 1
    assert list(ahead(iter([]))) == []


def test_no_more_than_one_is_made_beforehand() -> None:
    """However slow the caller is: the pictures of a film do not fit into memory."""
    made: list[int] = []
    for number in ahead(counting(made, 30)):
        time.sleep(0.003)
        assert len(made) <= number + 2
    assert len(made) == 30


def test_an_error_comes_through_after_what_was_made_before_it() -> None:
    seen = []
    with pytest.raises(InputError, match="cannot be decoded"):  # noqa: PT012
        for number in ahead(counting([], 5, InputError("Frame 5 cannot be decoded"))):
            seen.append(number)
    assert seen == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("error", [CancelledError(), KeyboardInterrupt()])
def test_an_error_of_the_caller_ends_the_thread(error: BaseException) -> None:
    """Already while the error is handled, with all that its traceback holds."""
    made: list[int] = []

    def work() -> None:
        for number in ahead(counting(made, 1000)):
            if number == 7:
                raise error

    try:
        work()
    except type(error):
        assert not decoding()
    assert 8 <= len(made) <= 9


def test_whoever_has_enough_just_stops() -> None:
    made: list[int] = []
    assert next(ahead(counting(made, 1000))) == 0
    assert len(made) <= 2
    assert not decoding()


def test_what_is_being_made_when_the_caller_stops_is_waited_for() -> None:
    made, begun, go = [], threading.Event(), threading.Event()

    def items() -> Iterator[int]:
        for number in range(10):
            if number:
                begun.set()
                go.wait()
            made.append(number)
            yield number

    stream = ahead(items())
    assert next(stream) == 0
    begun.wait()
    threading.Timer(0.5, go.set).start()
    stream.close()  # type: ignore[attr-defined]
    assert made == [0, 1]


def test_frames_of_a_file_are_decoded_beside_the_caller(monkeypatch: pytest.MonkeyPatch) -> None:
    threads = set()

    def watched(*arguments: object) -> Iterator[tuple[int, np.ndarray]]:
        for found in read_frames(*arguments):  # type: ignore[arg-type]
            threads.add(threading.current_thread())
            yield found

    monkeypatch.setattr(sources, "read_frames", watched)
    video = open_video(FILM)
    assert [index for index, _ in frames(video, range(67))] == list(range(67))
    assert threads
    assert threading.current_thread() not in threads


def made_clip(path: Path) -> Path:
    """A light block that crosses a rough ground, as a file."""
    rng = np.random.default_rng(4)
    ground = cv2.GaussianBlur(rng.integers(0, 255, (240, 320, 3), np.uint8), (0, 0), 2)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 30, (320, 240))
    for number in range(24):
        picture = ground.copy()
        cv2.circle(picture, (30 + 9 * number, 60 + 4 * number), 8, (250, 250, 250), -1)
        writer.write(picture)
    writer.release()
    return path


@pytest.mark.parametrize("what", ["Following the background", "Following the block"])
def test_work_that_is_cancelled_ends_the_thread(what: str, tmp_path: Path) -> None:
    """By an error raised in the progress, as Esc in Blender does."""
    seen: list[bool] = []

    def esc(text: str, done: int = 0, total: int = 0) -> None:
        if text == what and done == 5 and total > 10:
            seen.append(bool(decoding()))
            raise CancelledError

    video = open_video(made_clip(tmp_path / "clip.avi"))
    background = None if "background" in what else no_motion(0, 23)
    known = None if background is None else np.empty(0, np.intp)  # looking for repeated pictures would decode them all
    try:
        track_block(video, 8, (102.0, 92.0), background=background, repeated=known, progress=esc)
    except CancelledError:
        assert not decoding()
    assert seen == [True]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signal")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_command_at_once_and_leaves_nothing(tmp_path: Path, number: signal.Signals) -> None:
    """The thread is in the middle of a picture that takes long to make."""
    slow = (
        "import sys, time\n"
        "from rockfall.core.footage import sources\n"
        "from rockfall.core.footage.video import read_frames\n"
        "def slowly(*arguments):\n"
        "    for frame in read_frames(*arguments):\n"
        "        print('decoding', file=sys.stderr, flush=True)\n"
        "        time.sleep(0.2)\n"
        "        yield frame\n"
        "sources.read_frames = slowly\n"
        "from rockfall.core.cli import main\n"
        "sys.exit(main())\n"
    )
    out = tmp_path / "out"
    command = [sys.executable, "-c", slow, "track", str(FILM), "--click", "30,30,20", "--out", str(out)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=os.environ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if "decoding" in line:
                break
        process.send_signal(number)
        process.communicate(timeout=20)
    assert process.returncode == 128 + number
    assert not list(tmp_path.iterdir())
