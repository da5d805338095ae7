"""The benchmark of `diagnose`: which sessions, how they are run, what is required, how it is told."""
