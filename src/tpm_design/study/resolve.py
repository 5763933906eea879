"""A well-formed study → a Study: every name looked up, every default filled in, everything in SI."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from tpm_design.design_space import spans
from tpm_design.errors import did_you_mean
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.optimizers import default_method
from tpm_design.optimizers.base import Optimizer
from tpm_design.problem import Accuracy, Problem, Variable
from tpm_design.study.document import Document, read_document, where
from tpm_design.study.faults import Faults, shown
from tpm_design.study.form import parse
from tpm_design.study.goals import GoalReader
from tpm_design.study.model import (
    ARCHITECTURES,
    BoxModel,
    Center,
    CertifyModel,
    MechanismModel,
    OptimizerModel,
    Range,
    SphereModel,
    StudyModel,
)
from tpm_design.study.plain import plain
from tpm_design.study.plug_in import PlugIn, read_plug_in
from tpm_design.study.region import check_form, read_region
from tpm_design.study.registries import Registries, registries
from tpm_design.study.relations import check_ratios, read_ties
from tpm_design.study.space import (
    free_center,
    read_center,
    read_limits,
    read_mode,
    read_parameters,
)
from tpm_design.study.study import Certification, OptimizerSettings, Study
from tpm_design.study.sweep import SweepReader
from tpm_design.units import Units, si_unit


def load_study(path: str | Path, *, allow_code: bool = False) -> Study:
    """Reads and checks a study file. Raises StudyError: what is wrong, in which line, what to do.

    A study may name a Python file as its mechanism. The file is run only if ``allow_code``, else the study is
    refused; what is wrong in the file itself is a PlugInError.
    """
    document = read_document(Path(path))
    if ARCHITECTURES in document.data:
        Faults(document).stop(
            (ARCHITECTURES,),
            "this file compares several architectures",
            "Use it with optimize or validate; a run of one of them is a study for the other commands.",
        )
    return resolve(document, parse(document), registries(), allow_code=allow_code)


def resolve(document: Document, model: StudyModel, known: Registries, *, allow_code: bool = False) -> Study:
    """Checks what the names mean and fills in the rest. Raises StudyError, PlugInError."""
    faults = Faults(document)
    units = Units(model.units.length, model.units.angle)
    kind, plug_in = _kind(model.mechanism, document, known, faults, allow_code=allow_code)
    region = model.region
    if region is not None:
        check_form(region.type, kind, faults)
    center = region.center if region else None
    parameters = read_parameters(model.mechanism, kind, units, faults)
    check_ratios(model.mechanism, kind, parameters, faults)
    ties = read_ties(model.mechanism, kind, parameters, faults)
    limits = read_limits(model.mechanism.limits, kind, units, faults)
    certification = _certification(model.certify, kind, units, faults)
    optimizer = _optimizer(model.optimizer, len(model.objectives), known.optimizers, faults)
    faults.raise_if_any()  # the modes and the centre's bounds follow from the parameters

    ranges = spans(parameters)
    ranges |= {name: ranges[source] for name, source in ties.items()}
    modes = read_mode(model.mechanism.mode, kind, ranges, _isotropic(model), faults)
    quantities = dict(parameters)
    shape = written_region = None
    if region is not None and center is not None:
        shape, written_region = read_region(region, units, document.path.parent, faults)
        if isinstance(center, str):
            center = free_center(kind, ranges, modes, units, faults)
        quantities |= read_center(center, kind, modes, units, faults)
        written_region["center"] = center
    fixed: dict[str, float | str] = {n: q for n, q in quantities.items() if not isinstance(q, Variable)}
    variables = [q for q in quantities.values() if isinstance(q, Variable)]
    if len(modes) == 1:
        fixed["mode"] = next(iter(modes))
    else:
        variables.append(Variable("mode", "mode", values=tuple(modes)))

    reader = GoalReader(known.metrics, kind, units, limits, region is not None, (*quantities, *ties), faults)
    objectives = reader.read("objectives", model.objectives)
    constraints = reader.read("constraints", model.constraints)
    record = reader.read("record", model.record)
    problem = Problem(
        kind=kind,
        fixed=fixed,
        variables=tuple(variables),
        modes=modes,
        limits=limits,
        region=shape,
        objectives=tuple(goal for goal, _ in objectives),
        constraints=tuple(goal for goal, _ in constraints),
        record=tuple(goal for goal, _ in record),
        accuracy=Accuracy(model.accuracy.volume, model.accuracy.region_samples),
        ties=ties,
    )
    sweep = written_sweep = None
    if model.sweep is not None:
        sweep, written_sweep = SweepReader(problem, units, faults).read(model.sweep)
    faults.raise_if_any()

    mode = model.mechanism.mode
    resolved = {
        "version": model.version,
        "name": model.name,
        "units": model.units,
        "mechanism": {
            "type": model.mechanism.type,
            "file": None if plug_in is None else plug_in.name,
            "sha256": None if plug_in is None else plug_in.sha256,
            "parameters": {
                name: model.mechanism.parameters[name]
                for name in kind.parameter_names()
                if name in parameters or name in ties
            },
            "mode": mode if isinstance(mode, str) else (next(iter(modes.values())) or None),
            "limits": {name: model.mechanism.limits[name] for name in limits},
        },
        "region": written_region,
        "objectives": [written for _, written in objectives],
        "constraints": [written for _, written in constraints],
        "optimizer": model.optimizer.model_copy(update={"method": optimizer.method}),
        "accuracy": model.accuracy,
        "certify": model.certify,
        "sweep": written_sweep,
        "record": [written for _, written in record],
    }
    return Study(
        path=document.path,
        optimizer_place=where(document.path, document.line(("optimizer", "method"))),
        name=model.name,
        units=units,
        problem=problem,
        optimizer=optimizer,
        certification=certification,
        sweep=sweep,
        plug_in=plug_in,
        resolved_json=json.dumps(plain(resolved), ensure_ascii=False, allow_nan=False),
    )


def _kind(
    model: MechanismModel, document: Document, known: Registries, faults: Faults, *, allow_code: bool
) -> tuple[MechanismKind, PlugIn | None]:
    """The mechanism by its name, or from its file."""
    if model.file is not None:
        plug_in, kind = read_plug_in(
            model.file, model.sha256, document.path.parent, known.mechanisms, faults, allow_code=allow_code
        )
        return kind, plug_in
    name = str(model.type)
    if name not in known.mechanisms:
        remedy = did_you_mean(name, known.mechanisms)
        if name.endswith(".py"):
            remedy = f"Write `file: {name}` for a mechanism in a file of yours."
        faults.stop(("mechanism", "type"), f"there is no mechanism {shown(name)}", remedy)
    return known.mechanisms[name], None


def _isotropic(model: StudyModel) -> bool:
    """Whether the question stays the same when the axes are permuted or reflected, so that working modes
    which a symmetry of the mechanism makes equal need not all be searched."""
    goals = (*model.objectives, *model.constraints, *model.record)
    if any("home" in goal.options for goal in goals) or any(
        isinstance(limit, Range) for limit in model.mechanism.limits.values()
    ):
        return False
    region = model.region
    if region is None:
        return True
    center = region.center
    free = center == "free" or (
        isinstance(center, Center) and center.mirrored and center.x == center.y == center.z
    )
    cube = isinstance(region, BoxModel) and len(set(region.size)) == 1
    return free and (cube or isinstance(region, SphereModel))


def _certification(
    model: CertifyModel | None, kind: MechanismKind, units: Units, faults: Faults
) -> Certification | None:
    """What is to be proved of the best design, if anything."""
    if model is None:
        return None
    return Certification(_tolerance(model, kind, units, faults), model.boxes)


def _tolerance(model: CertifyModel, kind: MechanismKind, units: Units, faults: Faults) -> dict[str, float]:
    """Manufacturing tolerances, ±, SI, in the mechanism's order of parameters."""
    for name in model.tolerance:
        if kind.parameter(name) is None:
            remedy = did_you_mean(name, kind.parameter_names())
            faults.add(("certify", "tolerance", name), f"{kind.name} has no parameter {shown(name)}", remedy)
    if kind.tolerance_refusal is not None and any(model.tolerance.values()):
        faults.add(
            ("certify", "tolerance"),
            f"nothing is proved within tolerances of {kind.name}: {kind.tolerance_refusal}",
            "Remove the tolerances.",
        )
    found: dict[str, float] = {}
    for name in kind.parameter_names():
        parameter = kind.parameter(name)
        if parameter is None or name not in model.tolerance:
            continue
        if name != parameter.name and parameter.name in model.tolerance:
            faults.add(
                ("certify", "tolerance", name),
                f"{parameter.name} sets all limbs and {name} one of them",
                f"Keep one: {parameter.name} holds for each limb by itself.",
            )
        found[name] = units.to_si(model.tolerance[name], si_unit(parameter.dimension))
    return found


def _optimizer(
    model: OptimizerModel, objectives: int, methods: Mapping[str, Optimizer], faults: Faults
) -> OptimizerSettings:
    """The method, by default one for so many objectives, and the local method that polishes its result."""
    chosen = default_method(objectives) if model.method is None else model.method
    if chosen not in methods:
        faults.add(
            ("optimizer", "method"), f"there is no method {shown(chosen)}", did_you_mean(chosen, methods)
        )
    local = [name for name, method in methods.items() if not method.abilities.whole_space]
    if model.polish is not None and model.polish not in local:
        what = "is not a local method" if model.polish in methods else "does not exist"
        faults.add(
            ("optimizer", "polish"), f"{shown(model.polish)} {what}", did_you_mean(model.polish, local)
        )
    return OptimizerSettings(chosen, model.budget, model.seed, model.polish)
