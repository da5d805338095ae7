"""The laws of the catalogue's mechanisms, a file for each place where they act. Importing declares them all."""

from . import angle_channel, drive, hand, interface, joint, lever, torque_channel, trials  # noqa: F401
from .law import LAWS  # noqa: F401
