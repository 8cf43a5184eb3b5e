"""Benchmarks: pliant beside its peers on the same work, in one run, on one thread."""
