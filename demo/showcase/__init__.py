"""The parts of the demo, one job a module."""
