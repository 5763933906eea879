"""Executors: what threads and chunks promise, and what of a problem travels to other processes."""

from __future__ import annotations

import math
import os
import pickle
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Generator, Iterator
from contextlib import closing
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tpm_design.errors import RefusedError, RunStoppedError
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.mechanisms import MECHANISMS
from tpm_design.problem import Problem
from tpm_design.runs.dask_workers import CHUNK_SECONDS, HANDLING_SECONDS, DaskWorkers
from tpm_design.runs.executors import SWITCH_INTERVAL, Threads
from tpm_design.runs.shipping import carried_out, packed, portable, unpacked
from tpm_design.study import load_comparison, load_study
from tpm_design.study.design import choose_design
from tpm_design.worker_threads import AHEAD, in_a_thread, in_order

STUDIES = sorted((Path(__file__).parents[1] / "studies").glob("*.yaml"))


@pytest.fixture(scope="module")
def problem() -> Problem:
    return load_study(STUDIES[0]).problem


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_a_queue_grows_between_results(problem: Problem, workers: int) -> None:
    """Each result asks for two more until there are 60: every one ends, in places in the order of asking."""
    asked, found = deque([0]), {}

    def task(_: Problem, item: int) -> int:
        time.sleep(1e-4 * (item % 7))
        return item * item

    with closing(Threads(workers)) as pool:
        count = 1
        for place, result in pool.from_queue(task, problem, asked):
            found[place] = result
            more = min(2, 60 - count)
            asked.extend(range(count, count + more))
            count += more
        with closing(pool.from_queue(task, problem, deque(range(100)))) as results:
            next(results)
    assert found == {place: place * place for place in range(60)}


def test_threads_give_every_result_and_drop_what_was_not_begun(problem: Problem) -> None:
    begun, held = [], threading.Event()

    def task(_: Problem, item: int) -> int:
        begun.append(item)
        if item == 3:
            held.wait()
        return item * item

    with closing(Threads(2)) as pool:
        with closing(pool.as_they_end(task, problem, range(100))) as results:
            # item 3 waits for those behind it: others overtake
            found = [next(results) for _ in range(20)]
            assert 3 not in dict(found)
            held.set()
        assert len(begun) <= 20 + 2 * AHEAD
        found = list(pool.as_they_end(task, problem, range(100)))
    assert sorted(found) == [(place, place * place) for place in range(100)]


def test_threads_share_the_interpreter_often_until_they_are_closed() -> None:
    before = sys.getswitchinterval()
    sys.setswitchinterval(0.004)
    try:
        with closing(Threads(2)):
            assert sys.getswitchinterval() == pytest.approx(SWITCH_INTERVAL)
        assert sys.getswitchinterval() == pytest.approx(0.004)
        with closing(Threads(1)):
            assert sys.getswitchinterval() == pytest.approx(0.004)
    finally:
        sys.setswitchinterval(before)


@pytest.mark.skipif(os.name == "nt", reason="signals are sent otherwise there")
def test_interrupts_at_any_moment_break_no_thread() -> None:
    program = Path(__file__).with_name("interrupted_threads.py")
    done = subprocess.run(
        [sys.executable, program, "600", "1"], capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_no_task_is_under_way_when_its_results_are_closed(problem: Problem) -> None:
    running: set[int] = set()

    def task(_: Problem, item: int) -> None:
        running.add(item)
        time.sleep(0.002)
        running.discard(item)

    with closing(Threads(3)) as pool:
        for ends_after in range(1, 6):
            with closing(pool.as_they_end(task, problem, range(100))) as results:
                for _ in range(ends_after):
                    next(results)
            assert running == set()


def test_what_another_thread_carries_out_comes_in_step_with_whoever_asks() -> None:
    threads, closed = set(), []

    def counted(stop: int) -> Generator[int]:
        try:
            for number in range(stop):
                threads.add(threading.get_ident())
                yield number
            raise ZeroDivisionError
        finally:
            closed.append(stop)

    with closing(in_a_thread(number for number in [1, 2, 3])) as results:
        assert list(results) == [1, 2, 3]
    with closing(in_a_thread(counted(100))) as results:
        assert [next(results) for _ in range(3)] == [0, 1, 2]
        assert closed == []
    assert closed == [100]
    with closing(in_a_thread(counted(2))) as results, pytest.raises(ZeroDivisionError):
        list(results)
    assert threading.get_ident() not in threads


def test_what_a_task_raises_reaches_whoever_asks(problem: Problem) -> None:
    def task(_: Problem, item: int) -> float:
        return 1.0 / item

    for workers in (1, 3):
        with closing(Threads(workers)) as pool, pytest.raises(ZeroDivisionError):
            list(pool.as_they_end(task, problem, [2, 1, 0, 1]))


@given(st.permutations(range(12)))
def test_results_are_put_in_order_as_soon_as_they_can_be(places: list[int]) -> None:
    taken: list[int] = []

    def ending() -> Iterator[tuple[int, str]]:
        for place in places:
            taken.append(place)
            yield place, str(place)

    for number, result in enumerate(in_order(ending())):
        assert result == str(number)
        assert set(range(number + 1)) <= set(taken)
        # no later than with the last one that was missing
        assert taken[-1] <= number or max(taken.index(n) for n in range(number + 1)) == len(taken) - 1


@given(
    left=st.integers(1, 10_000),
    most=st.integers(1, 50),
    threads=st.integers(1, 300),
    each=st.floats(1e-5, 100.0),
)
def test_chunks_are_as_long_as_they_may_be_and_no_longer(
    left: int, most: int, threads: int, each: float
) -> None:
    class Client:
        """Nobody is asked."""

    workers = DaskWorkers(cast(Any, Client()))
    workers._threads = threads
    workers._means.append(each)
    sizes = workers._sizes(left, most)
    assert sum(sizes) == left or (sum(sizes) < left and len(sizes) == most)
    assert min(sizes) >= 1
    assert sizes == sorted(sizes, reverse=True)
    # nobody waits for long, and all workers have some, unless the scheduler could not keep up
    cost = HANDLING_SECONDS / each
    assert max(sizes) <= max(CHUNK_SECONDS / each, threads * cost) + 1
    assert sizes[0] <= max(left / (2 * threads), math.sqrt(left * cost)) + 1


def problems() -> Iterator[Problem]:
    for path in STUDIES:
        comparison = load_comparison(path)
        studies = [load_study(path)] if comparison is None else comparison.studies.values()
        yield from (study.problem for study in studies)


def test_problems_arrive_as_they_were_sent() -> None:
    for sent in problems():
        arrived = unpacked(packed(sent))
        assert arrived == sent
        assert arrived.kind is sent.kind
        assert [goal.metric for goal in arrived.constraints] == [goal.metric for goal in sent.constraints]


def test_a_worker_of_the_same_version_does_what_is_done_here(problem: Problem) -> None:
    design, _ = choose_design(load_study(STUDIES[0]), {})
    mine = version("tpm-design")
    (found,), seconds = carried_out([design], writer=mine, task=evaluate, data=packed(problem))
    assert seconds > 0.0
    assert replace(found, seconds=0.0) == replace(evaluate(problem, design), seconds=0.0)
    with pytest.raises(RunStoppedError, match=f"A worker has tpm-design {mine}, and this is 9.9"):
        carried_out([design], writer="9.9", task=evaluate, data=packed(problem))


def test_a_kind_that_other_processes_do_not_know_is_not_sent(problem: Problem) -> None:
    own = replace(MECHANISMS["orthoglide"], name="own")
    with pytest.raises(RefusedError, match="own is a mechanism from a file"):
        packed(replace(problem, kind=own))


class ParticularError(Exception):
    """An exception that cannot be read back."""

    def __init__(self, one: int, two: int) -> None:
        super().__init__(f"{one} and {two}")


@pytest.mark.parametrize("error", [KeyError("x"), ParticularError(1, 2)])
def test_exceptions_travel_with_their_traceback_in_words(error: Exception) -> None:
    try:
        raise error
    except Exception as caught:
        arrived = pickle.loads(pickle.dumps(portable(caught)))
    assert str(error) in str(arrived)
    assert any("test_exceptions_travel" in note for note in arrived.__notes__)
