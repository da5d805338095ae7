"""Rig trials: what the rig does without a person, with the loads that a laboratory has.

The rig and its faults are those of the person's trials: the same laws of the catalogue act on a scenario whose trials are rig trials.
"""
