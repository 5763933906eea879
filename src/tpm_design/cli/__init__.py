"""The command line: parses, calls, prints. Heavy things are imported inside commands."""

from tpm_design.cli.app import main

__all__ = ["main"]
