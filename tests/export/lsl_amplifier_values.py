"""What lsl_amplifier.py sends."""

import math


def sample(number):
    """EMG of flexor and extensor, uV."""
    return 100 * math.sin(0.7 * number), 60 * math.cos(1.1 * number)
