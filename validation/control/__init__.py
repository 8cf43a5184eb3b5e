"""Control on the four tasks of CORD-SLS, and what else docs/control.md shows.

    python -m validation.control --json [--task NAME] [--runs N]
"""
