"""Results held against earlier ones: a run against a baseline, stored designs against the program."""
