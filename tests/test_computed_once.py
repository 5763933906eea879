"""Properties that are computed when first asked for."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from tpm_design.computed_once import computed_once


@dataclass(frozen=True)
class Counted:
    number: float
    asked: list[float] = field(default_factory=list)

    @computed_once
    def double(self) -> float:
        """Twice the number."""
        self.asked.append(self.number)
        return 2.0 * self.number


def test_each_instance_computes_once() -> None:
    one, other = Counted(1.0), Counted(2.0)
    assert [one.double, other.double, one.double, other.double] == [2.0, 4.0, 2.0, 4.0]
    assert (one.asked, other.asked) == ([1.0], [2.0])
    assert Counted.double.__doc__ == "Twice the number."


@dataclass(frozen=True)
class Meeting:
    both: threading.Barrier

    @computed_once
    def place(self) -> int:
        return self.both.wait(timeout=20.0)


def test_threads_do_not_wait_for_one_anothers_instances() -> None:
    """Each is computed only while the other is."""
    both = threading.Barrier(2)
    with ThreadPoolExecutor(2) as threads:
        places = list(threads.map(lambda meeting: meeting.place, [Meeting(both), Meeting(both)]))
    assert sorted(places) == [0, 1]
