"""Causes that are in no catalogue: plain functions of one argument at one place, and others. Importing declares them all."""

from . import functions, others  # noqa: F401
from .alien import ALIENS  # noqa: F401
