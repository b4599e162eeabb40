# SPDX-License-Identifier: GPL-3.0-or-later
"""The next pictures are decoded in a thread of their own while the caller works on those before."""

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor

AHEAD = 2
"""Pictures that are decoded before they are asked for: one is being worked on, one is there, one is being made."""


def ahead[T](items: Iterator[T], most: int = AHEAD) -> Iterator[T]:
    """The same items in the same order, up to `most` of them made beforehand.

    What making one raises is raised here where the item would come. When the caller ends early, by an error, an
    interrupt or because it has enough, the item being made is waited for and no further one is begun.
    """
    end = object()
    waiting: deque[Future[T | object]] = deque()
    with ThreadPoolExecutor(1, "rockfall-ahead") as thread:
        try:
            waiting.extend(thread.submit(next, items, end) for _ in range(most))
            while (item := waiting.popleft().result()) is not end:
                waiting.append(thread.submit(next, items, end))
                yield item  # type: ignore[misc]
        finally:
            for other in waiting:
                other.cancel()
