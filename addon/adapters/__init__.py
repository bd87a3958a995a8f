# SPDX-License-Identifier: GPL-3.0-or-later
"""The only readers and writers of Blender geometry: arrays out, arrays in, in bulk, float32."""
