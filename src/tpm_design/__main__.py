"""`python -m tpm_design`."""

from tpm_design.cli import main

main()
