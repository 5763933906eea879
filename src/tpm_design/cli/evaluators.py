"""Who evaluates: threads, or a Dask cluster where --dask asks for one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager

from tpm_design.errors import RefusedError, UsageError
from tpm_design.runs.executors import Executor, Threads
from tpm_design.study import Study

LOCAL = "local"


def check_dask(dask: str | None, workers: int | None, studies: Iterable[Study]) -> None:
    """Refuse what cannot be evaluated by a Dask cluster, before one is started. Raises UsageError or
    RefusedError."""
    if dask is None:
        return
    if dask != LOCAL and workers is not None:
        raise UsageError(
            "The workers of a Dask cluster that runs already are as many as it has.",
            where="--workers",
            remedy="Leave it out, or write --dask local for so many processes of this machine.",
        )
    for study in studies:
        if study.plug_in is not None:
            raise RefusedError(
                f"The mechanism of {study.name} is a file of its own, which the workers of a Dask cluster do "
                "not have.",
                where="--dask",
                remedy="Leave --dask out: threads evaluate it.",
            )


@contextmanager
def evaluators(dask: str | None, workers: int) -> Iterator[Executor]:
    """The cluster at an address, "local" for so many processes of this machine; None: threads.
    Raises UsageError."""
    if dask is None:
        with closing(Threads(workers)) as threads:
            yield threads
        return
    from tpm_design.runs.dask_workers import dask_workers

    with dask_workers(dask, workers) as cluster:
        yield cluster
