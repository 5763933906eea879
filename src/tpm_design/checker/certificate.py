"""``certify --check``: a certificate's hash, its agreement with its study, and every proof in it again."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tpm_design.checker.agreement import disagreements
from tpm_design.checker.breaking import not_broken
from tpm_design.checker.claims import (
    OUTCOMES,
    Claim,
    Machine,
    Requirement,
    read_claim,
    read_machine,
    read_region,
    read_requirement,
)
from tpm_design.checker.cover import Cover, leaves
from tpm_design.checker.fields import AlteredError, Fields, canonical_sha256, read_certificate
from tpm_design.checker.proof import sum_of_links
from tpm_design.checker.regions import Box, Domain, Region
from tpm_design.checker.reproof import Claimed, Watch, first_failure
from tpm_design.checker.requirements import proved_slack, unproved
from tpm_design.checker.statements import Length, Locus
from tpm_design.errors import UsageError

FORMAT = 1
SLACK_ROUNDING = 1e-12


@dataclass(frozen=True)
class CheckResult:
    """``valid``: everything the certificate says is proved was proved again. ``lines``: what was checked,
    ``faults``: what is wrong. ``leaves``: boxes proved again."""

    valid: bool
    lines: tuple[str, ...]
    faults: tuple[str, ...]
    leaves: int
    seconds: float


def check_certificate(
    path: str | Path, *, workers: int = 1, watch: Watch = lambda progress: None
) -> CheckResult:
    """Checks a ``certificate.json``, with up to ``workers`` processes; the result is the same for any number.

    What contradicts itself or its study is told before anything is proved again, and the first leaf that
    cannot be proved again ends the check. ``watch`` is told how many leaves are done. With more than one
    worker the caller's main module must be one that can be imported. Raises UsageError where the file is none
    of a format known here.
    """
    began = time.perf_counter()
    try:
        certificate = read_certificate(Path(path))
    except AlteredError as error:
        return CheckResult(False, (), (f"altered: {error}",), 0, time.perf_counter() - began)
    check = _Check()
    check.run(certificate, workers, watch)
    return CheckResult(
        not check.faults, tuple(check.lines), tuple(check.faults), check.leaves, time.perf_counter() - began
    )


class _Check:
    """One check as it goes on."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.faults: list[str] = []
        self.leaves = 0

    def run(self, certificate: Fields, workers: int, watch: Watch) -> None:
        body = {key: value for key, value in certificate.data.items() if key != "sha256"}
        if certificate.text("sha256") != canonical_sha256(body):
            self.faults.append("altered: the SHA-256 of the contents is not the one written")
            return
        if certificate.value("format") != FORMAT:
            raise UsageError(
                f"the certificate's format is {certificate.value('format')!r}, not {FORMAT}",
                where=certificate.file,
                remedy="Check it with the version of tpm-design that wrote it.",
            )
        _refuse_plug_in(certificate)
        certificate.fields("versions")
        if certificate.text("study_sha256") != canonical_sha256(certificate.fields("study").data):
            self.faults.append("study_sha256 is not that of the study")
        machine, region = read_machine(certificate), read_region(certificate)
        mechanism = machine.mechanism
        claims = [read_claim(entry, mechanism) for entry in certificate.entries("statements")]
        requirements = [
            read_requirement(entry, len(claims), mechanism) for entry in certificate.entries("requirements")
        ]
        outcome = certificate.text("outcome", OUTCOMES)
        self._assumptions(certificate)
        self.faults += disagreements(certificate, machine, region, requirements)
        if self.faults:
            return
        for requirement in requirements:
            self._requirement(requirement, claims, machine, region)
        self._outcome(outcome, requirements)
        claimed = [
            cover
            for index, claim in enumerate(claims)
            for cover in self._claimed(index, claim, machine, region)
        ]
        if self.faults:
            return
        failure, self.leaves = first_failure(machine, claimed, workers, watch)
        if failure is not None:
            index, (box, letter) = failure
            self._unsound(index, claims[index], f"the leaf {letter} {_shown(box)} could not be proved again")
            return
        self.lines[:0] = [
            f"statement {index}, {claim.statement}: {claim.outcome}" for index, claim in enumerate(claims)
        ]

    def _unsound(self, index: int, claim: Claim, fault: str) -> None:
        self.faults.append(f"statement {index}, {claim.statement}: {fault}")

    def _assumptions(self, certificate: Fields) -> None:
        texts = certificate.items("assumptions")
        if not any(isinstance(text, str) and "axis directions are exact" in text for text in texts):
            self.faults.append("assumptions do not say that axis directions are exact")

    def _claimed(
        self, index: int, claim: Claim, machine: Machine, region: Region | None
    ) -> Iterator[Claimed]:
        """The covers that are to be proved again."""
        statement = claim.statement
        if isinstance(statement, Length):
            fault = _length_fault(statement, machine) if claim.outcome == "proved" else None
            if fault is not None:
                self._unsound(index, claim, fault)
            return
        if region is None:
            self._unsound(index, claim, "there is no region that it could speak of")
            return
        if claim.outcome != "proved" and not claim.covers:
            return
        distance = statement.distance if isinstance(statement, Locus) else 0.0
        domains = [Domain(body, distance) for body in region.parts]
        fault = _gap(claim, domains)
        if fault is not None:
            self._unsound(index, claim, fault)
            return
        # one body may have several covers, several poses have one each
        pairs = zip(claim.covers, domains if len(domains) > 1 else domains * len(claim.covers), strict=True)
        for cover, domain in pairs:
            try:
                size = _size(cover, claim.outcome == "proved")
            except ValueError as error:
                self._unsound(index, claim, str(error))
                return
            yield Claimed(index, statement, domain, cover, size)

    def _requirement(
        self, requirement: Requirement, claims: list[Claim], machine: Machine, region: Region | None
    ) -> None:
        name = f"requirement {requirement.label}"
        self.lines.append(f"{name}: {requirement.outcome}")
        self.faults += [
            f"{name}: {fault}" for fault in _requirement_faults(requirement, claims, machine, region)
        ]

    def _outcome(self, outcome: str, requirements: list[Requirement]) -> None:
        outcomes = {requirement.outcome for requirement in requirements}
        due = "refuted" if "refuted" in outcomes else "undecided" if "undecided" in outcomes else "proved"
        if outcome != due:
            self.faults.append(f"outcome is {outcome}, by its requirements it is {due}")


def _refuse_plug_in(certificate: Fields) -> None:
    """What a mechanism's own file says can only be believed: nothing here could contradict it."""
    study = certificate.data.get("study")
    mechanism = study.get("mechanism") if isinstance(study, dict) else None
    if isinstance(mechanism, dict) and "file" in mechanism:
        raise UsageError(
            f"the mechanism is a Python file of its user, {mechanism['file']!r}: it cannot be checked",
            where=certificate.file,
            remedy="The check writes every mechanism's equations anew, and knows the built-in ones alone. "
            "To prove it again by the same formulas, run `tpm-design certify` on the study.",
        )


def _gap(claim: Claim, domains: list[Domain]) -> str | None:
    """Whether the covers leave anything out."""
    roots = [cover.root for cover in claim.covers]
    if len(domains) == 1:
        whole = domains[0].covered_by(roots)
    elif len(roots) != len(domains):
        return f"there are {len(roots)} covers for {len(domains)} poses"
    else:
        whole = all(domain.covered_by([root]) for domain, root in zip(domains, roots, strict=True))
    return None if whole else "the covers leave out a part of the poses it speaks of"


def _size(cover: Cover, whole: bool) -> int:
    """How many leaves claim something. Raises ValueError where the tree is none, or ``whole`` and undecided
    somewhere."""
    size = 0
    for box, letter in leaves(cover):
        if letter != "u":
            size += 1
        elif whole:
            raise ValueError(f"it has an undecided leaf {_shown(box)}")
    return size


def _length_fault(statement: Length, machine: Machine) -> str | None:
    machines, links = machine.within_tolerance(), machine.mechanism.links
    floor, ceiling = statement.floor, statement.ceiling
    if floor is not None and not sum_of_links(machines, links, False) >= floor:
        return "the links may be shorter"
    if ceiling is not None and not sum_of_links(machines, links, True) <= ceiling:
        return "the links may be longer"
    return None


def _requirement_faults(
    requirement: Requirement, claims: list[Claim], machine: Machine, region: Region | None
) -> Iterator[str]:
    named = [claims[index] for index in requirement.statements]
    all_proved = all(claim.outcome == "proved" for claim in named)
    separate = region is not None and len(region.parts) > 1
    proved = [claim.statement for claim in named if claim.outcome == "proved"]
    lacking = unproved(requirement, machine.mechanism, proved, separate)
    if requirement.outcome == "proved":
        if lacking is not None:
            yield lacking
        elif not all_proved:
            yield "it names a statement that is not proved"
        elif requirement.slack is not None:
            last = proved_slack(requirement, named[-1].statement)
            if requirement.slack > last + SLACK_ROUNDING:
                yield f"its slack {requirement.slack} is more than the {last} that is proved"
    elif lacking is None and all_proved:
        yield f"it is said to be {requirement.outcome}, and its statements prove it"
    elif requirement.outcome == "refuted":
        reason = not_broken(requirement, machine, region)
        if reason is not None:
            yield reason


def _shown(box: Box) -> str:
    return " × ".join(f"[{low:.6g}, {high:.6g}]" for low, high in box)
