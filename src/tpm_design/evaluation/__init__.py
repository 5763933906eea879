"""Design → Evaluation: what was measured of one design, and what that means for the problem."""
