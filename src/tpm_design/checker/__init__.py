"""The second opinion on certificates: every proof again, by other means.

Plain Python on Arb's balls, written from the specification of the equations; it shares no code with the
rooms that make certificates.
"""

from tpm_design.checker.certificate import CheckResult, check_certificate
from tpm_design.checker.reproof import Progress

__all__ = ["CheckResult", "Progress", "check_certificate"]
