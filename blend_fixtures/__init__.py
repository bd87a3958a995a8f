"""Characters, cages and small rigs made from code, for tests and the demo.

`build` puts them into Blender; the rest is numpy.
"""
