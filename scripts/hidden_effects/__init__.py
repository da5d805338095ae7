"""Test data for the diagnosis: wrist sessions with a known hidden effect.

Written apart from the crate on purpose: it shares none of its code, integrator, step or functional forms, so that a
diagnosis that finds these effects has found the effect and not its own reflection. See docs/benchmarks/generator.md.
"""
