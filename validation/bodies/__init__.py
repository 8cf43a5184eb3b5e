"""Articulated bodies of pliant beside other simulators of the same bodies."""
