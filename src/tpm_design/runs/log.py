"""Every evaluation of a search: counted, memoised, carried out in batches."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

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
        with closing(self.as_they_come(designs, limit, cutoff)) as evaluations:
            return list(evaluations)

    def as_they_come(
        self,
        designs: Sequence[Design],
        limit: int,
        cutoff: Cutoff | None = None,
        neighbours: Sequence[Neighbours | None] = (),
    ) -> Generator[Evaluation]:
        """Evaluations of the designs, in order, each as soon as it and those before it are logged; repeated
        ones are answered from the log, an aborted one only where ``cutoff`` would abort it as well: else it
        becomes another entry. ``neighbours``: those of each design, None where its slopes are not asked for;
        slopes alone make no other entry.

        Raises BudgetSpent once the log holds ``limit`` entries and another is needed; what fits is
        evaluated and logged first.
        """
        keys = [design_key(design) for design in designs]
        asked = {key: around for key, around in zip(keys, neighbours, strict=False) if around is not None}
        wanted: dict[Key, _Wanted] = {}
        left, beyond = max(0, limit - len(self.entries)), None
        for key, design in zip(keys, designs, strict=True):
            question = _Question(design, asked.get(key))
            if key in wanted:
                continue
            if not self._is_known(key, cutoff):
                if not left:
                    beyond = key
                    break
                left -= 1
                wanted[key] = _Wanted(question, self._answer(key, cutoff, sloped=key in asked))
            elif key in asked and self._known(key).slopes is None:
                wanted[key] = _Wanted(question, None, again=True)
        open_ones = [one.question for one in wanted.values() if one.answer is None]
        measured = partial(_answered, cutoff=cutoff)
        with closing(self._executor.as_they_end(measured, self.problem, open_ones)) as evaluated:
            results = in_order(evaluated)
            for key in keys:
                one = wanted.pop(key, None)
                if one is not None and one.again:
                    place = self._places[key]
                    self.entries[place] = replace(self.entries[place], evaluation=next(results))
                elif one is not None:
                    self._append(key, one.answer or next(results))
                elif key == beyond:
                    raise BudgetSpent
                yield self._known(key)

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
class _Question:
    """A design, and the neighbours along which its slopes are asked for, None for none."""

    design: Design
    neighbours: Neighbours | None


@dataclass(frozen=True)
class _Wanted:
    """What is not in the log yet, or there without the slopes that are asked for (``again``); the ``answer``
    where it is stored."""

    question: _Question
    answer: Evaluation | None
    again: bool = False


def _answered(problem: Problem, question: _Question, cutoff: Cutoff | None) -> Evaluation:
    return evaluate(problem, question.design, cutoff, question.neighbours)
