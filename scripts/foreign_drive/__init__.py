"""Runs the program on the emulated drive of fixtures/foreign_drive, and judges it by what that drive saw."""
