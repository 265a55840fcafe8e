"""One BLAS thread for small systems: with more they take up to a hundred times as long on a busy machine."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any


@cache
def _controller() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit BLAS to one thread within the block; parallel work belongs to independent seams or processes."""
    with _controller().limit(limits=1, user_api="blas"):
        yield
