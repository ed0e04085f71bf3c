# SPDX-License-Identifier: Apache-2.0
# Opens volumes in Blender and compares their grids with what was expected:
#   blender --background --factory-startup --python-exit-code 1 --python open_in_blender.py -- \
#       FILE NAME:TYPE,NAME:TYPE ...
import sys

import bpy

words = sys.argv[sys.argv.index("--") + 1:]
for path, expected in zip(words[::2], words[1::2]):
    bpy.ops.object.volume_import(filepath=path)
    grids = bpy.context.object.data.grids
    assert grids.load(), grids.error_message
    found = ",".join(sorted(f"{grid.name}:{grid.data_type}" for grid in grids))
    assert found == expected, f"{path}: found {found}, expected {expected}"
