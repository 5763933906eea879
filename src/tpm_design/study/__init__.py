"""Study files: strict YAML in, a validated problem out; the only place that knows YAML."""

from tpm_design.study.comparison import Comparison, load_comparison
from tpm_design.study.design import choose_design
from tpm_design.study.plain import dump_yaml
from tpm_design.study.resolve import load_study
from tpm_design.study.schema import study_schema
from tpm_design.study.study import OptimizerSettings, Study
from tpm_design.study.sweep import GridSweep, ListSweep, SampleSweep, Sweep
from tpm_design.study.template import template

__all__ = [
    "Comparison",
    "GridSweep",
    "ListSweep",
    "OptimizerSettings",
    "SampleSweep",
    "Study",
    "Sweep",
    "choose_design",
    "dump_yaml",
    "load_comparison",
    "load_study",
    "study_schema",
    "template",
]
