# SPDX-License-Identifier: GPL-3.0-or-later
"""The next picture is decoded in a thread of its own while the caller works on the one before."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor


def ahead[T](items: Iterator[T]) -> Iterator[T]:
    """The same items in the same order, each made while the caller works on the one before.

    What making one raises is raised here where the item would come. When the caller ends early, by an error, an
    interrupt or because it has enough, the item that is being made is waited for, and the thread has ended.
    """
    end = object()
    with ThreadPoolExecutor(1, "rockfall-ahead") as thread:
        coming = thread.submit(next, items, end)
        while (item := coming.result()) is not end:
            coming = thread.submit(next, items, end)
            yield item  # type: ignore[misc]
