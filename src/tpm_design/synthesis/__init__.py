"""The smallest machine that reaches a region, placed best: a convex relaxation of a study."""
