"""Reports: what a run found, as text and figures in its folder."""

from tpm_design.report.write import write_report

__all__ = ["write_report"]
