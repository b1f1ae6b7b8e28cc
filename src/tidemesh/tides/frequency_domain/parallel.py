"""Several independent pieces of work at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor

from threadpoolctl import threadpool_limits


def each(function: Callable, items: Iterable, threads: int) -> list:
    """[function(item), ...], several at a time; the answer is the same bit by bit.

    The functions spend their time in compiled code, which lets other threads run. The
    linear algebra library is held to one thread: on pieces as small as these its own
    threads cost more than they bring.
    """
    with threadpool_limits(1, "blas"):
        if threads <= 1:
            return [function(item) for item in items]
        with ThreadPoolExecutor(threads) as pool:
            return list(pool.map(function, items))
