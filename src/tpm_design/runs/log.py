"""Every evaluation of a search: counted, memoised, carried out in batches."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Literal

from tpm_design.evaluation.cutoffs import is_worse
from tpm_design.evaluation.evaluate import evaluate
from tpm_design.evaluation.result import Cutoff, Evaluation
from tpm_design.evaluation.slopes import Neighbours
from tpm_design.optimizers.base import BudgetSpent
from tpm_design.problem import Design, Problem
from tpm_design.runs.entry import Answers, Entry, Key, design_key, samples_digest
from tpm_design.runs.executors import Executor
from tpm_design.runs.ranking import best_entry, rank
from tpm_design.worker_threads import in_order


@dataclass(frozen=True)
class Asked:
    """A design, and the neighbours along which its slopes are asked for, None for none."""

    design: Design
    neighbours: Neighbours | None = None


class EvaluationLog:
    """Every distinct design evaluated so far in one round. The one place that counts evaluations.

    ``record`` is called with each entry, in order, as soon as it is there. ``first``: number of the first.
    ``answers``: evaluations that need not be repeated; they count like others. ``executor``: who evaluates.
    ``optima``: designs that the method noted as local optima. ``most_pieces``: in how many pieces each
    constraint came, at most.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        executor: Executor,
        record: Callable[[Entry], None] = lambda entry: None,
        first: int = 0,
        round_number: int = 1,
        answers: Answers = MappingProxyType({}),
    ) -> None:
        self.problem = problem
        self.judged_by = samples_digest(problem.samples)
        self._answers = answers
        self.first = first
        self.round_number = round_number
        self.entries: list[Entry] = []
        self.optima: tuple[Design, ...] = ()
        self.most_pieces: dict[str, int] = {}
        self._places: dict[Key, int] = {}
        self._record = record
        self._executor = executor

    def evaluations(
        self, designs: Sequence[Design], limit: int, cutoff: Cutoff | None = None
    ) -> list[Evaluation]:
        """``as_they_come``, all of them."""
        asked = deque(Asked(design) for design in designs)
        with closing(self.as_they_come(asked, limit, cutoff)) as evaluations:
            return list(evaluations)

    def as_they_come(
        self, asked: deque[Asked], limit: int, cutoff: Cutoff | None = None
    ) -> Generator[Evaluation]:
        """Evaluations of what is taken from the left of a queue, in order, each as soon as it and those
        before it are logged; more may be asked between them, as long as one is not given. Repeated designs
        are answered from the log, an aborted one only where ``cutoff`` would abort it as well: else it
        becomes another entry. Slopes alone make no other entry.

        Raises BudgetSpent once the log holds ``limit`` entries and another is needed; what fits is
        evaluated and logged first.
        """
        steps: deque[_Step] = deque()
        coming: dict[Key, bool] = {}
        left = limit - len(self.entries)
        questions: deque[Asked] = deque()
        measured = partial(_answered, cutoff=cutoff)
        with closing(self._executor.from_queue(measured, self.problem, questions)) as evaluated:
            results = in_order(evaluated)
            while asked or steps:
                while asked:
                    step = self._step(asked.popleft(), coming, cutoff)
                    left -= step.kind == "new"
                    if step.kind == "new" and left < 0:
                        step = replace(step, kind="beyond")
                    elif step.kind != "known" and step.answer is None:
                        questions.append(step.asked)
                    steps.append(step)
                step = steps.popleft()
                if step.kind == "beyond":
                    raise BudgetSpent
                if step.kind == "new":
                    self._append(step.key, step.answer or next(results))
                elif step.kind == "again":
                    place = self._places[step.key]
                    self.entries[place] = replace(self.entries[place], evaluation=next(results))
                yield self._known(step.key)

    def _step(self, asked: Asked, coming: dict[Key, bool], cutoff: Cutoff | None) -> _Step:
        """``coming``: of the designs asked so far, whether their slopes are known by then."""
        key, sloped = design_key(asked.design), asked.neighbours is not None
        if key not in coming and self._is_known(key, cutoff):
            coming[key] = self._known(key).slopes is not None
        if key not in coming:
            step = _Step(key, asked, "new", self._answer(key, cutoff, sloped=sloped))
        else:
            step = _Step(key, asked, "again" if sloped and not coming[key] else "known")
        coming[key] = sloped or coming.get(key, False)
        return step

    def _append(self, key: Key, result: Evaluation) -> None:
        self._places[key] = len(self.entries)
        entry = Entry(self.first + len(self.entries), result, self.round_number, self.judged_by)
        self.entries.append(entry)
        for label, pieces in result.pieces.items():
            self.most_pieces[label] = max(len(pieces), self.most_pieces.get(label, 1))
        self._record(entry)

    def _known(self, key: Key) -> Evaluation:
        return self.entries[self._places[key]].evaluation

    def _is_known(self, key: Key, cutoff: Cutoff | None) -> bool:
        if key not in self._places:
            return False
        known = self._known(key)
        return known.cutoff is None or (cutoff is not None and is_worse(self.problem, known, cutoff))

    def _answer(self, key: Key, cutoff: Cutoff | None, *, sloped: bool) -> Evaluation | None:
        """What an evaluation would give, if it is stored."""
        whole = self._answers.get((self.judged_by, key, None))
        if cutoff is None:
            return None if whole is not None and sloped and whole.slopes is None else whole
        # one that is worse may have been measured to the end for other reasons
        sure = whole is not None and not is_worse(self.problem, whole, cutoff)
        return whole if sure else self._answers.get((self.judged_by, key, cutoff))

    def best(self) -> Entry | None:
        """As ``best_entry``."""
        return best_entry(self.problem, self.entries)

    def rank(self, entry: Entry) -> tuple[float, float, int]:
        """As ``rank``."""
        return rank(self.problem, entry)


@dataclass(frozen=True)
class _Step:
    """What is given for a question: a ``new`` entry, with its ``answer`` where it is stored; one of the log,
    evaluated ``again`` for its slopes; a ``known`` one; nothing, ``beyond`` what may be evaluated."""

    key: Key
    asked: Asked
    kind: Literal["new", "again", "known", "beyond"]
    answer: Evaluation | None = None


def _answered(problem: Problem, asked: Asked, cutoff: Cutoff | None) -> Evaluation:
    return evaluate(problem, asked.design, cutoff, asked.neighbours)
